"""`python -m benchmarks campaign`: many plots and dates with one plan, predictions of their scores, and the report."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.field_check import run_field_check
from benchmarks.patterns import run_patterns
from benchmarks.plant_counts import run_plant_counts
from benchmarks.plant_figures import run_plant_figures
from benchmarks.result import StudyResult
from benchmarks.score_prediction import run_score_prediction
from benchmarks.season import PLOTS, run_season
from benchmarks.suite import run_studies
from benchmarks.trials import run_trials
from fieldkit.cache import StageCache
from fieldkit.runtime.progress import Progress

CAPTURES = 80
"""Captures of 13 photographs: a campaign of 40 plots on two dates."""
SEASON_FOLDER, CAPTURES_FOLDER = "season", "captures"


@dataclass(frozen=True)
class CampaignOptions:
    """Options of the studies."""

    data: Path | None = None
    """Folder of the recorded image sets, or None."""
    cache: StageCache = field(default_factory=lambda: StageCache(None))
    """The stage cache."""
    scenes: tuple[str, ...] = ()
    """Of ``field-check``, by default the held-out ones."""
    blocks: tuple[str, ...] = ()
    """Of ``trials``: stages and flights such as V10/five-8; of ``patterns``: stages, or V10/7, a shipped one."""
    count: int | None = None
    """Captures of ``field-check`` (80), plots of ``season`` (40)."""
    width_px: int = 2000
    """Of the photographs of ``season``."""
    seed: int = 0
    """Of everything random."""
    workers: int = 1
    """Number of threads and processes."""
    work: Path | None = None
    """Keeps photographs and evaluations; None takes a temporary folder."""


@contextmanager
def _folder(options: CampaignOptions, name: str) -> Iterator[Path]:
    if options.work is not None:
        (options.work / name).mkdir(parents=True, exist_ok=True)
        yield options.work / name
        return
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def _season(options: CampaignOptions, progress: Progress) -> StudyResult:
    with _folder(options, SEASON_FOLDER) as folder:
        return run_season(
            options.count or PLOTS,
            seed=options.seed,
            width_px=options.width_px,
            workers=options.workers,
            work=folder,
            progress=progress,
        )


def _field_check(options: CampaignOptions, progress: Progress) -> StudyResult:
    return run_field_check(
        options.scenes,
        captures=options.count or CAPTURES,
        seed=options.seed,
        cache=options.cache,
        workers=options.workers,
        work=options.work,
        progress=progress,
    )


def _plant_figures(options: CampaignOptions, progress: Progress) -> StudyResult:
    with _folder(options, CAPTURES_FOLDER) as folder:
        return run_plant_figures(folder, progress=progress)


def _plant_counts(options: CampaignOptions, progress: Progress) -> StudyResult:
    return run_plant_counts(options.scenes, progress=progress)


def _score_prediction(options: CampaignOptions, progress: Progress) -> StudyResult:
    with _folder(options, CAPTURES_FOLDER) as folder:
        return run_score_prediction(folder, data=options.data, cache=options.cache, progress=progress)


def _trials(options: CampaignOptions, progress: Progress) -> StudyResult:
    with _folder(options, "trials") as folder:
        return run_trials(options.blocks, work=folder, workers=options.workers, cache=options.cache, progress=progress)


def _patterns(options: CampaignOptions, progress: Progress) -> StudyResult:
    with _folder(options, "patterns") as folder:
        return run_patterns(options.blocks, work=folder, progress=progress)


STUDIES: dict[str, Callable[[CampaignOptions, Progress], StudyResult]] = {
    "season": _season,
    "trials": _trials,
    "patterns": _patterns,
    "field-check": _field_check,
    "plant-figures": _plant_figures,
    "plant-counts": _plant_counts,
    "score-prediction": _score_prediction,
}
DEFAULT = ("season", "field-check")


def run_campaign(
    output: Path, names: Sequence[str], options: CampaignOptions, *, progress: Progress, overwrite: bool = False
) -> list[StudyResult]:
    """Run studies one after the other and write results.json and results.md.

    Args:
        output: folder of the result.
        names: of `STUDIES`; none takes `DEFAULT`.
        options: for all of them.
        overwrite: replace an earlier result in ``output``.
    """
    return run_studies(output, names, STUDIES, list(DEFAULT), options, progress=progress, overwrite=overwrite)
