"""`python -m benchmarks objective`: the cost and the reliability of evaluations of r(z)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.result import StudyResult
from benchmarks.suite import run_studies
from fieldkit.cache import StageCache
from fieldkit.runtime.progress import Progress

NO_DATA = "FIELDKIT_DATA is unset; it names the folder with the recorded image sets."


@dataclass(frozen=True)
class ObjectiveOptions:
    """Options of the studies."""

    data: Path | None
    """Folder of the recorded sets, or None."""
    cache: StageCache
    """Of features and views of recorded photographs."""
    evaluations: int = 100
    """Of `throughput`."""
    configurations: int = 20
    """Of `ranks`, per scene, and subsets of `recorded`."""
    scenes: int = 3
    """Of `ranks`."""
    seeds: int = 5
    """Of `ranks`, `noise` and `numbers`."""
    workers: int = 1
    """Number of processes of `ranks` and `noise`."""


def _cost(_: ObjectiveOptions, progress: Progress) -> StudyResult:
    from benchmarks.objective_cost import run_cost

    return run_cost(progress=progress)


def _throughput(options: ObjectiveOptions, progress: Progress) -> StudyResult:
    from benchmarks.objective_cost import run_throughput

    return run_throughput(evaluations=options.evaluations, progress=progress)


def _ranks(options: ObjectiveOptions, progress: Progress) -> StudyResult:
    from benchmarks.objective_ranks import run_ranks

    return run_ranks(
        configurations=options.configurations, seeds=options.seeds, scenes=options.scenes, workers=options.workers,
        progress=progress,
    )  # fmt: skip


def _noise(options: ObjectiveOptions, progress: Progress) -> StudyResult:
    from benchmarks.objective_noise import run_noise

    return run_noise(seeds=options.seeds, workers=options.workers, progress=progress)


def _recorded(options: ObjectiveOptions, progress: Progress) -> StudyResult:
    if options.data is None:
        return StudyResult("recorded", "The objective on a recorded set", skipped=NO_DATA)
    from benchmarks.recorded_scores import run_recorded

    return run_recorded(options.data, subsets=options.configurations, cache=options.cache, progress=progress)


def _proxy(options: ObjectiveOptions, progress: Progress) -> StudyResult:
    if options.data is None:
        return StudyResult("proxy", "Does a proxy rank sets of views as the photographs do?", skipped=NO_DATA)
    from benchmarks.proxy_scores import run_proxy

    return run_proxy(options.data, cache=options.cache, progress=progress)


STUDIES: dict[str, Callable[[ObjectiveOptions, Progress], StudyResult]] = {
    "cost": _cost,
    "throughput": _throughput,
    "ranks": _ranks,
    "noise": _noise,
    "recorded": _recorded,
    "proxy": _proxy,
}


def run_objective(
    output: Path, names: Sequence[str], options: ObjectiveOptions, *, progress: Progress, overwrite: bool = False
) -> list[StudyResult]:
    """Run studies one after the other and write results.json, results.md and their pictures.

    Args:
        output: folder of the result.
        names: of `STUDIES`; empty takes ``cost``.
        options: for all of them.
        overwrite: replace an earlier result in ``output``.
    """
    return run_studies(output, names, STUDIES, ["cost"], options, progress=progress, overwrite=overwrite)
