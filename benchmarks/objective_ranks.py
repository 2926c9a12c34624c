"""Rank correlation of cheap and expensive evaluations, and the noise of values."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from benchmarks.curves import draw_agreement
from benchmarks.objective_scenes import SCENES, VIEWS, TuningPlot, tuning_plot
from benchmarks.result import Cell, ResultTable, StudyResult
from fieldkit.pictures.panels import png
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.objective.simulated import SimulatedSource
from fieldkit.planning.run.evaluations import Job, evaluating
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.vocabulary import SearchFidelity

_NOISE_SETS = 5


@dataclass(frozen=True)
class Ranks:
    """The comparison of a scene."""

    scene: str
    """Its name."""
    cheap: tuple[float, ...]
    fine: tuple[float, ...]
    """Values of the configurations at the two fidelities, metres."""
    repeats: tuple[tuple[float, ...], ...]
    """Cheap values over the seeds, per repeated configuration."""
    cpu_s: tuple[float, float]
    """Mean CPU seconds of an evaluation at each fidelity."""

    @property
    def spearman(self) -> float:
        """Rank correlation of the two fidelities."""
        return float(spearmanr(self.cheap, self.fine).statistic)

    @property
    def noise(self) -> float:
        """Root of the mean variance over seeds, metres."""
        return float(np.sqrt(np.mean([np.var(values, ddof=1) for values in self.repeats])))

    @property
    def spread(self) -> float:
        """Standard deviation between configurations at one seed, metres."""
        return float(np.std(self.cheap, ddof=1))


def run_ranks(
    plots: Sequence[TuningPlot] | None = None,
    *,
    configurations: int = 20,
    seeds: int = 5,
    scenes: int = len(SCENES),
    workers: int = 1,
    fidelities: tuple[SearchFidelity, SearchFidelity] = ("standard", "fine"),
    progress: Progress,
) -> StudyResult:
    """Evaluate random feasible configurations at two fidelities, and five of them at more seeds."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = []
    for index in range(len(plots) if plots is not None else scenes):
        plot = plots[index] if plots is not None else tuning_plot(SCENES[index])
        found.append(compare(plot, fidelities, configurations, seeds, workers, progress))
    return StudyResult(
        name="ranks",
        title="Do cheap evaluations rank alike?",
        tables=(rank_table(found, fidelities),),
        notes=(
            f"{configurations} random feasible configurations of {VIEWS} views per scene, the same at both fidelities.",
            f"Noise: root of the mean variance of {_NOISE_SETS} of them over {seeds} seeds (sensor, RANSAC).",
            "The poses are exact, and known to mapping to 10 mm; what their noise does is the study `noise`.",
            "Spread: standard deviation between the configurations at one seed.",
        ),
        figures={
            each.scene: {
                "cheap": each.cheap, "fine": each.fine, "repeats": each.repeats, "spearman": each.spearman,
                "noise_m": each.noise, "spread_m": each.spread, "cpu_s": each.cpu_s,
            }
            for each in found
        },
        pictures={"ranks.png": png(draw_agreement({e.scene: (e.cheap, e.fine) for e in found}, fidelities))},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )  # fmt: skip


def compare(
    plot: TuningPlot,
    fidelities: tuple[SearchFidelity, SearchFidelity],
    configurations: int,
    seeds: int,
    workers: int,
    progress: Progress,
) -> Ranks:
    """Compare one scene at both fidelities."""
    sets = [plot.envelope.sample(VIEWS, seed) for seed in range(configurations)]
    values: list[list[Evaluation]] = []
    for name in fidelities:
        jobs = [Job(cameras) for cameras in sets]
        values.append(_evaluated(f"{plot.name}, {name}", plot.source, name, jobs, workers, progress))
    again = sets[:_NOISE_SETS]
    repeats = _evaluated(
        f"{plot.name}, seeds", plot.source, fidelities[0], _repeated(again, range(1, seeds)), workers, progress
    )
    by_set = [
        (values[0][k].value_m, *(e.value_m for e in repeats[k * (seeds - 1) : (k + 1) * (seeds - 1)]))
        for k in range(len(again))
    ]
    cost = [float(np.mean([e.cpu_s for e in each])) for each in values]
    cheap, fine = (tuple(e.value_m for e in each) for each in values)
    return Ranks(plot.name, cheap, fine, tuple(by_set), (cost[0], cost[1]))


def rank_table(found: Sequence[Ranks], fidelities: tuple[str, str]) -> ResultTable:
    """A row per scene."""
    rows: list[tuple[Cell, ...]] = [
        (
            each.scene, f"{each.spearman:.2f}", f"{1000 * min(each.cheap):.1f}–{1000 * max(each.cheap):.1f}",
            f"{1000 * min(each.fine):.1f}–{1000 * max(each.fine):.1f}", f"{1000 * each.noise:.2f}",
            f"{1000 * each.spread:.2f}", f"{each.noise / each.spread:.2f}" if each.spread > 0 else None,
            f"{each.cpu_s[0]:.1f}", f"{each.cpu_s[1]:.1f}",
        )
        for each in found
    ]  # fmt: skip
    cheap, dear = fidelities
    columns = (
        "scene", "Spearman>", f"{cheap}, mm>", f"{dear}, mm>", "noise, mm>", "spread, mm>", "noise / spread>",
        f"{cheap}, CPU s>", f"{dear}, CPU s>",
    )  # fmt: skip
    return ResultTable(f"{cheap} against {dear}", columns, tuple(rows))


def _repeated(sets: Sequence[Cameras], seeds: Sequence[int]) -> list[Job]:
    return [Job(cameras, seed) for cameras in sets for seed in seeds]


def _evaluated(
    title: str, source: SimulatedSource, fidelity: SearchFidelity, jobs: Sequence[Job], workers: int, progress: Progress
) -> list[Evaluation]:
    found = []
    objective = Objective(source, ObjectiveSettings(fidelity))
    with evaluating(objective, Context(workers=workers)) as evaluations, progress.stage(title, len(jobs)) as advance:
        for evaluation in evaluations.each(jobs):
            found.append(evaluation)
            advance(1)
    return found
