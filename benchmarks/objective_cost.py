"""The cost of an evaluation by stage, and the gain of a second worker."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from benchmarks.objective_scenes import VIEWS, TuningPlot, tuning_plot
from benchmarks.result import Cell, ResultTable, StudyResult
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.run.evaluations import Job, evaluating
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.vocabulary import SearchFidelity

LIMITS_S: dict[str, float] = {"draft": 5.0, "standard": 9.0}
SCENE = "case-1"
_KEPT = ", drawings kept"


def run_cost(
    plot: TuningPlot | None = None,
    fidelities: Sequence[SearchFidelity] = ("draft", "standard", "fine"),
    *,
    repeats: int = 3,
    progress: Progress,
) -> StudyResult:
    """Median CPU seconds of an evaluation at each fidelity, with renderer and compiled kernels warm.

    Each fidelity is timed with everything drawn anew, as for sets far from all others, and with kept drawings.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    plot = plot or tuning_plot(SCENE)
    measured: dict[str, list[Evaluation]] = {}
    for name in fidelities:
        objective = Objective(plot.source, ObjectiveSettings(name))
        with progress.stage(f"{name}: {repeats} evaluations", 2 * repeats + 1) as advance:
            objective.evaluate(plot.ring)
            advance(1)
            for column in (name, f"{name}{_KEPT}"):
                for _ in range(repeats):
                    if column == name:
                        plot.source.forget_drawings()
                    measured.setdefault(column, []).append(objective.evaluate(plot.ring))
                    advance(1)
    plot.source.close()
    return StudyResult(
        name="cost",
        title="One evaluation of the objective",
        tables=(cost_table(measured),),
        notes=(
            f"{VIEWS} views on a ring about {plot.name}.",
            "CPU seconds on one thread, the median of the repeats; the scene is uploaded and all kernels compiled.",
            "Rendering includes the noise and writing the JPEGs.",
        ),
        figures={
            "cpu_s": {name: float(np.median([e.cpu_s for e in found])) for name, found in measured.items()},
            "limits_s": LIMITS_S,
            "evaluations": {name: [e.figures() for e in found] for name, found in measured.items()},
        },
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def stage_cpu_s(found: Evaluation, stage: str) -> float:
    """CPU seconds of one stage; 0 if it was not run."""
    return sum(each.cpu_s for each in found.times if each.name == stage)


def cost_table(measured: dict[str, list[Evaluation]]) -> ResultTable:
    """Median CPU seconds by stage, a column per fidelity."""
    stages = list(dict.fromkeys(s.name for found in measured.values() for e in found for s in e.times))
    rows: list[tuple[Cell, ...]] = [
        (stage, *(f"{np.median([stage_cpu_s(e, stage) for e in found]):.2f}" for found in measured.values()))
        for stage in stages
    ]
    rows.append(("everything", *(f"{np.median([e.cpu_s for e in found]):.2f}" for found in measured.values())))
    limits = [LIMITS_S.get(name.removesuffix(_KEPT)) for name in measured]
    rows.append(("allowed", *(None if limit is None else f"{limit:.0f}" for limit in limits)))
    return ResultTable("CPU seconds of one evaluation", ("stage", *(f"{name}>" for name in measured)), tuple(rows))


def run_throughput(
    plot: TuningPlot | None = None, fidelity: SearchFidelity = "draft", *, evaluations: int = 100, progress: Progress
) -> StudyResult:
    """Evaluations per minute of one and of two worker processes, with the same sets of cameras."""
    wall, cpu = time.perf_counter(), time.process_time()
    plot = plot or tuning_plot()
    objective = Objective(plot.source, ObjectiveSettings(fidelity))
    sets = [plot.envelope.sample(VIEWS, seed) for seed in range(evaluations)]
    seconds: dict[int, float] = {}
    results: dict[int, list[Evaluation]] = {}
    for workers in (1, 2):
        with (
            evaluating(objective, Context(workers=workers)) as pool,
            progress.stage(f"{workers} workers", evaluations) as advance,
        ):
            for _ in pool.each(Job(plot.ring) for _ in range(2 * workers)):  # all workers started and warm
                pass
            start = time.perf_counter()
            found = []
            for evaluation in pool.each(Job(cameras) for cameras in sets):
                found.append(evaluation)
                advance(1)
            seconds[workers], results[workers] = time.perf_counter() - start, found
    rows: list[tuple[Cell, ...]] = [
        (workers, f"{spent:.0f}", f"{60 * evaluations / spent:.2f}", f"{seconds[1] / spent:.2f}",
         f"{np.mean([e.cpu_s for e in results[workers]]):.1f}", sum(not e.measured for e in results[workers]))
        for workers, spent in seconds.items()
    ]  # fmt: skip
    columns = ("workers>", "wall s>", "evaluations per minute>", "times one worker>", "CPU s each>", "broken>")
    return StudyResult(
        name="throughput",
        title="Two workers against one",
        tables=(ResultTable(f"{evaluations} evaluations ({fidelity})", columns, tuple(rows)),),
        notes=(
            "Wall time: other work on the machine takes from it. Both workers counts ran the same sets of cameras.",
            f"Results equal in all figures: {'yes' if results[1] == results[2] else 'no'}.",
        ),
        figures={"seconds": seconds, "ratio": seconds[1] / seconds[2], "equal": results[1] == results[2]},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )
