"""`python -m benchmarks engine`: studies of the engine, each with its alternative in the same run."""

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
class EngineOptions:
    """Options of the studies."""

    data: Path | None
    """Folder of the recorded sets, or None."""
    cache: StageCache
    """For unmeasured stages (the dense models, the reference)."""
    draws: int = 5
    """Of the priors' noise and of the blind mappers' seeds."""
    scene: bool = True
    """In `scaling`, also build the scene with the ground."""
    whole_grid: bool = False
    """In `few-views`, try every noise on every subset."""
    scenes: tuple[str, ...] = ()
    """Of `match-decay`: names or files, "all" for all of fieldkit's; empty takes the tuning scenes."""


def _dense(_: EngineOptions, progress: Progress) -> StudyResult:
    from benchmarks.dense_stereo import run_dense

    return run_dense(progress=progress)


def _evaluation(options: EngineOptions, progress: Progress) -> StudyResult:
    from benchmarks.full_evaluation import run_evaluation

    return run_evaluation(options.data, cache=options.cache, progress=progress)


def _scaling(data: Path, options: EngineOptions, progress: Progress) -> StudyResult:
    from benchmarks.scaling import run_scaling

    return run_scaling(data, scene=options.scene, cache=options.cache, progress=progress)


def _few_views(data: Path, options: EngineOptions, progress: Progress) -> StudyResult:
    from benchmarks.few_views import GOALS, SUBSETS, Plan, run_few_views

    plan = Plan(SUBSETS, GOALS, draws=options.draws, whole_grid=options.whole_grid)
    return run_few_views(data, plan, cache=options.cache, progress=progress)


def _known_poses(data: Path, options: EngineOptions, progress: Progress) -> StudyResult:
    from benchmarks.known_poses import run_known_poses

    return run_known_poses(data, phases=options.draws, cache=options.cache, progress=progress)


def _learned_ties(data: Path, options: EngineOptions, progress: Progress) -> StudyResult:
    from benchmarks.known_poses import run_known_poses

    return run_known_poses(data, phases=options.draws, cache=options.cache, progress=progress, learned=True)


def _references(data: Path, options: EngineOptions, progress: Progress) -> StudyResult:
    from benchmarks.references import run_references

    return run_references(data, cache=options.cache, progress=progress)


def _subset_scores(data: Path, options: EngineOptions, progress: Progress) -> StudyResult:
    from benchmarks.subset_scores import run_subset_scores

    return run_subset_scores(data, cache=options.cache, progress=progress)


def _match_decay(options: EngineOptions, progress: Progress) -> StudyResult:
    from benchmarks.match_decay import run_match_decay

    return run_match_decay(options.data, options.scenes, progress=progress)


Run = Callable[[EngineOptions, Progress], StudyResult]


def _on_data(name: str, title: str, run: Callable[[Path, EngineOptions, Progress], StudyResult]) -> Run:
    """A study of the recorded sets, skipped with a reason without them."""

    def study(options: EngineOptions, progress: Progress) -> StudyResult:
        if options.data is None:
            return StudyResult(name, title, skipped=NO_DATA)
        return run(options.data, options, progress)

    return study


STUDIES: dict[str, Run] = {
    "dense": _dense,
    "evaluation": _evaluation,
    "scaling": _on_data("scaling", "Cost against the number of photographs", _scaling),
    "few-views": _on_data("few-views", "Few views", _few_views),
    "known-poses": _on_data("known-poses", "How well poses are known", _known_poses),
    "learned-ties": _on_data("learned-ties", "Learned matches where ties are weak", _learned_ties),
    "references": _on_data("references", "References of the recorded sets", _references),
    "match-decay": _match_decay,
    "subset-scores": _on_data("subset-scores", "Few views, scored", _subset_scores),
}
SPEED = ("dense", "evaluation", "scaling")
"""The studies of speed, run by default; the others are about quality."""


def run_engine(
    output: Path, names: Sequence[str], options: EngineOptions, *, progress: Progress, overwrite: bool = False
) -> list[StudyResult]:
    """Run studies one after the other and write results.json, results.md and their pictures."""
    return run_studies(output, names, STUDIES, SPEED, options, progress=progress, overwrite=overwrite)
