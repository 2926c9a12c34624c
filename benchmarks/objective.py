"""`python -m benchmarks objective`: r(z) on recorded photographs, and by the proxy of their reference."""

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
    configurations: int = 20
    """Subsets of `recorded`."""


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
    "recorded": _recorded,
    "proxy": _proxy,
}


def run_objective(
    output: Path, names: Sequence[str], options: ObjectiveOptions, *, progress: Progress, overwrite: bool = False
) -> list[StudyResult]:
    """Run studies one after the other and write results.json, results.md and their pictures.

    Args:
        output: folder of the result.
        names: of `STUDIES`; empty takes ``recorded``.
        options: for all of them.
        overwrite: replace an earlier result in ``output``.
    """
    return run_studies(output, names, STUDIES, ["recorded"], options, progress=progress, overwrite=overwrite)
