"""`ablation`: the field method's settings one at a time, on a stand-in for the objective that costs milliseconds.

The stand-in is the geometric score's distance and tie, with the noise of an evaluation. It has the optimum's shape
(sets of cameras, visibility, constraints) and none of an evaluation's price, so that every setting can be tried on
several seeds. The method's own geometric score is off, for it would know the answer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fieldkit.benchmarks.result import Cell, ResultTable
from fieldkit.planning.geometric import GeometricScore
from fieldkit.planning.methods.bosfm import Bosfm
from fieldkit.planning.methods.circle import CircleSearch
from fieldkit.planning.methods.field import Field, FieldSettings
from fieldkit.planning.methods.random import Random
from fieldkit.planning.search import Judge, Method, Problem, Result, lowest
from fieldkit.planning.surrogates.sets import SET_KERNELS

NOISE = 0.05
"""Standard deviation of an evaluation, as a share of its value: what draft evaluations were measured to have."""
_STREAM = 71
Value = Callable[[Result], float]


@dataclass(frozen=True)
class Ended:
    """How a search on the stand-in ended.

    Attributes:
        value_m: of the set it would choose, without noise.
        half_m: likewise after half of the evaluations.
    """

    value_m: float
    half_m: float


def variants() -> dict[str, Callable[[Problem, int], Method]]:
    """The field method first, then with one setting changed, then what else there is."""
    chosen = replace(FieldSettings(), geometry=False)
    first, least, largest = chosen.shares
    settings = {
        "field": chosen,
        "4 initial trials": replace(chosen, initial=4),
        "16 initial trials": replace(chosen, initial=16),
        "trust region from the 32nd trial": replace(chosen, structured=32),
        "trust region from the 56th trial": replace(chosen, structured=56),
        "structured sets only": replace(chosen, structured=1_000_000),
        "every third trial structured": replace(chosen, every=3),
        "no structured set in the trust region": replace(chosen, every=1_000_000),
        "8 structured sets to choose from": replace(chosen, pool=8),
        "72 structured sets to choose from": replace(chosen, pool=72),
        "20 moves to choose from": replace(chosen, moves=20),
        "180 moves to choose from": replace(chosen, moves=180),
        "first steps half as large": replace(chosen, shares=(0.5 * first, least, largest)),
        "first steps twice as large": replace(chosen, shares=(2.0 * first, least, largest)),
        "patience 2": replace(chosen, patience=2),
        "patience 8": replace(chosen, patience=8),
        "1 centre": replace(chosen, centers=1),
        "4 centres": replace(chosen, centers=4),
        "noise free": replace(chosen, noise=0.0),
        "noise of 10 % at least": replace(chosen, noise=0.1),
        "reach half as long": replace(chosen, reach=0.5 * chosen.reach),
        "reach twice as long": replace(chosen, reach=2.0 * chosen.reach),
        "RBF only": replace(chosen, kernels=SET_KERNELS[:1]),
        "Matérn 5/2 only": replace(chosen, kernels=SET_KERNELS[1:]),
    }
    made: dict[str, Callable[[Problem, int], Method]] = {name: partial(_field, each) for name, each in settings.items()}
    return made | {
        "random": Random,
        "circle-aim": partial(CircleSearch, aim=True),
        "bosfm": lambda problem, seed: Bosfm(problem, seed=seed),
    }


def search(problem: Problem, method: Method, evaluations: int, seed: int) -> Ended:
    """Run a method on the stand-in.

    Args:
        problem: of a scene.
        method: of the same problem.
        evaluations: at most.
        seed: of the noise.
    """
    score = GeometricScore(problem)
    results: list[Result] = []
    true: list[float] = []
    half = float("nan")
    for number in range(evaluations):
        trial = method.propose(number, results, ())
        if trial is None:
            break
        found = score.score(trial.cameras)
        true.append(found.distance_m + found.tie_m)
        noise = np.random.default_rng([seed, _STREAM, number]).standard_normal()
        results.append(Result(trial, float(true[-1] * np.exp(NOISE * noise))))
        if number + 1 == evaluations // 2:
            half = _chosen(method, results, true)
    return Ended(_chosen(method, results, true), half)


def _field(settings: FieldSettings, problem: Problem, seed: int) -> Method:
    return Field(problem, settings, seed)


def _chosen(method: Method, results: list[Result], true: list[float]) -> float:
    best = method.favourites(results, 1) if isinstance(method, Judge) else lowest(results, 1)
    return true[best[0].number]


def ablation_table(found: Mapping[str, Mapping[str, tuple[Ended, ...]]]) -> ResultTable:
    """A row per variant: what it ends at against `field`'s mean of the same scene and seeds.

    Args:
        found: runs by scene and variant.
    """
    rows: list[tuple[Cell, ...]] = []
    for name in dict.fromkeys(variant for each in found.values() for variant in each):
        cells: list[Cell] = [name]
        ends: list[float] = []
        halves: list[float] = []
        for each in found.values():
            base = float(np.mean([run.value_m for run in each["field"]]))
            own = [run.value_m / base for run in each[name]]
            cells.append(f"{np.mean(own):.3f}")
            ends += own
            halves += [run.half_m / base for run in each[name]]
        error = f" ± {np.std(ends, ddof=1) / np.sqrt(len(ends)):.3f}" if len(ends) > 1 else ""
        rows.append((*cells, f"{np.mean(ends):.3f}{error}", f"{np.mean(halves):.3f}"))
    columns = ("variant", *(f"{scene}>" for scene in found), "all>", "after half>")
    return ResultTable("Value of the set chosen ÷ field's mean", columns, tuple(rows))
