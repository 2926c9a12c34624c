"""`ablation`: settings of the method `field` one at a time, on a stand-in for the objective that costs milliseconds.

The stand-in has the objective's structure (sets of cameras, visibility, constraints) without its cost, so that every
setting can be tried on several seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.planners.random_sets import Random, TunedBosfm
from benchmarks.planners.rings import CircleAim
from benchmarks.result import Cell, ResultTable
from fieldkit.planning.methods.bosfm import Bosfm
from fieldkit.planning.methods.field import Field, FieldSettings
from fieldkit.planning.problem import Judge, Method, PlanningProblem, Result, lowest
from fieldkit.planning.score.geometric import GeometricScore, ScoreSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.surrogate.set_process import FEATURES, SetEmbedding

NOISE = 0.05
"""Standard deviation of an evaluation as a share of its value, as measured for draft evaluations."""
_OTHER = ScoreSettings(best_angle_deg=14.0, tail_deg=17.0, pixel_m=0.006, error_px=0.7)
_WEIGHTS = (0.4, 1.5, 0.2)
_POINTS = 1800
_WAVES, _REACH, _UNKNOWN = 300, 0.4, 0.08
_STREAM = 71
Value = Callable[[Result], float]


class StandIn:
    """A value of sets that the geometric score predicts about as well as real evaluations.

    It is a sum of the same terms with other weights, from a score with other constants, times a smooth random function
    of the embedded set, e^(± 8 %) (random Fourier features of a Gaussian kernel).

    Args:
        problem: of a scene.
        seed: of the random function.
    """

    def __init__(self, problem: PlanningProblem, seed: int) -> None:
        self._score = GeometricScore(problem, settings=_OTHER, points=_POINTS)
        self._embedding = SetEmbedding(problem)
        rng = np.random.default_rng([seed, _STREAM])
        self._frequencies = rng.standard_normal((FEATURES, _WAVES)) / _REACH
        self._phases = rng.uniform(0.0, 2.0 * np.pi, _WAVES)

    def __call__(self, cameras: Cameras) -> float:
        """Metres, without noise."""
        found = self._score.score(cameras)
        expected = float(np.dot(_WEIGHTS, (found.gap_m, found.noise_m, found.tie_m)))
        waves = np.cos(self._embedding([cameras])[0] @ self._frequencies + self._phases)
        return expected * float(np.exp(_UNKNOWN * np.sqrt(2.0 / _WAVES) * waves.sum()))


@dataclass(frozen=True)
class Ended:
    """How a search on the stand-in ended."""

    value_m: float
    """Of the set it would choose, without noise."""
    half_m: float
    """Likewise after half of the evaluations."""
    stopped_m: float
    """Likewise where it would have stopped by itself, or at the end."""
    stopped: int
    """After how many evaluations that was."""


def variants() -> dict[str, Callable[[PlanningProblem, int], Method]]:
    """The method `field` first, then with one setting changed, then other methods."""
    settings = {
        "field": FieldSettings(),
        "4 initial trials": FieldSettings(initial=4),
        "12 initial trials": FieldSettings(initial=12),
        "noise of 1 % at least": FieldSettings(noise=0.01),
        "noise of 10 % at least": FieldSettings(noise=0.1),
    }
    made: dict[str, Callable[[PlanningProblem, int], Method]] = {
        name: partial(_field, each) for name, each in settings.items()
    }
    return made | {
        "random": Random,
        "circle-aim": CircleAim,
        "bosfm": lambda problem, seed: Bosfm(problem, seed=seed),
        "bosfm-tuned": lambda problem, seed: TunedBosfm(problem, seed=seed),
    }


def search(problem: PlanningProblem, method: Method, evaluations: int, seed: int) -> Ended:
    """Run a method on the stand-in.

    Args:
        problem: of a scene.
        method: of the same problem.
        evaluations: at most.
        seed: of the stand-in and of the noise.
    """
    stand_in = StandIn(problem, seed)
    results: list[Result] = []
    true: list[float] = []
    half, stopped = float("nan"), None
    for number in range(evaluations):
        trial = method.propose(number, results, ())
        if trial is None:
            break
        if stopped is None and trial.gain is not None and trial.gain.negligible:
            stopped = number, _chosen(method, results, true)
        true.append(stand_in(trial.cameras))
        noise = np.random.default_rng([seed, _STREAM, number]).standard_normal()
        results.append(Result(trial, float(true[-1] * np.exp(NOISE * noise)), True, problem.count))
        if number + 1 == evaluations // 2:
            half = _chosen(method, results, true)
    value = _chosen(method, results, true)
    count, stopped_m = stopped or (len(results), value)
    return Ended(value, half, stopped_m, count)


def _field(settings: FieldSettings, problem: PlanningProblem, seed: int) -> Method:
    return Field(problem, settings, seed)


def _chosen(method: Method, results: list[Result], true: list[float]) -> float:
    best = method.favourites(results, 1) if isinstance(method, Judge) else lowest(results, 1)
    return true[best[0].number]


def ablation_table(found: Mapping[str, Mapping[str, tuple[Ended, ...]]]) -> ResultTable:
    """A row per variant: its final value against `field`'s mean over the same scene and seeds.

    Args:
        found: runs by scene and variant.
    """
    rows: list[tuple[Cell, ...]] = []
    for name in dict.fromkeys(variant for each in found.values() for variant in each):
        cells: list[Cell] = [name]
        ends: list[float] = []
        halves: list[float] = []
        stops: list[float] = []
        for each in found.values():
            base = float(np.mean([run.value_m for run in each["field"]]))
            own = [run.value_m / base for run in each[name]]
            cells.append(f"{np.mean(own):.3f}")
            ends += own
            halves += [run.half_m / base for run in each[name]]
            stops += [run.stopped_m / base for run in each[name]]
        error = f" ± {np.std(ends, ddof=1) / np.sqrt(len(ends)):.3f}" if len(ends) > 1 else ""
        after = np.mean([run.stopped for each in found.values() for run in each[name]])
        rows.append(
            (*cells, f"{np.mean(ends):.3f}{error}", f"{np.mean(halves):.3f}", f"{np.mean(stops):.3f}", f"{after:.0f}")
        )
    columns = ("variant", *(f"{scene}>" for scene in found), "all>", "after half>", "where it stops>", "evaluations>")
    return ResultTable("Value of the set chosen ÷ field's mean", columns, tuple(rows))
