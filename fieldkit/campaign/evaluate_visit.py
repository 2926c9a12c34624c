"""What a worker does: one visit evaluated and written into its folder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fieldkit.cache import StageCache
from fieldkit.campaign.reading import CampaignPlot, stage_versions, visit_place
from fieldkit.campaign.visit_frame import place_visit, wanted_sidecars
from fieldkit.captures import Capture
from fieldkit.captures.bursts import by_station
from fieldkit.captures.selection import FoundPhoto, capture_of
from fieldkit.errors import MetadataError
from fieldkit.evaluation.adherence import ComparedPlan
from fieldkit.evaluation.conversion import evaluation_report
from fieldkit.evaluation.evaluate_plot import RESERVED, PlotCapture, Scoring, evaluate_plot, write_evaluation
from fieldkit.evaluation.reference import Reference
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.files import atomic_folder
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.fields import clean_text
from fieldkit.results.finding import COARSE_RASTERS, NO_RASTERS, TOLD
from fieldkit.results.plan import Plan
from fieldkit.results.report_files import EVALUATION_FILE, REFERENCE_FILE
from fieldkit.results.visit import VISIT_FILE, Visit, save_visit
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.sites.fit import plants_outgrown
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.version import __version__
from fieldkit.wording import count


@dataclass(frozen=True)
class VisitJob:
    """What a worker needs to evaluate a visit."""

    plot: CampaignPlot
    date: str
    """ISO 8601."""
    photos: tuple[FoundPhoto, ...]
    captures: str
    """Their folder, for people."""
    notes: tuple[str, ...]
    """Of sorting."""
    folder: Path
    """Of the campaign."""
    plan: Plan
    """That was flown."""
    evaluation: EvaluationSettings
    camera: Path | None
    """Calibration of photographs without one."""
    cache: Path | None
    """Its root, or None."""
    inputs: str = ""
    """Digest of all that the result depends on; "" where it could not be made."""

    @property
    def place(self) -> str:
        """The visit's folder, relative to the campaign's."""
        return visit_place(self.plot.name, self.date)


def evaluate_visit(job: VisitJob) -> Visit:
    """Evaluate a visit and write its folder.

    What is wrong with its photographs or files is kept as its ``error`` with its inputs, so that it is not met again
    before something changes.
    """
    place = job.folder / job.place
    marker = EVALUATION_FILE if (place / EVALUATION_FILE).is_file() else VISIT_FILE
    with atomic_folder(place, overwrite=True, marker=marker) as folder:
        visit = _evaluated(job, folder)
        save_visit(folder, visit)
    return visit


def failed_visit(job: VisitJob, error: str) -> Visit:
    """A visit that came to nothing and is tried again by the next run."""
    return Visit(images=len(job.photos), error=error, **_of_job(job, job.notes))


def _of_job(job: VisitJob, notes: Iterable[str]) -> dict[str, Any]:
    """A visit's fields that are known before it is evaluated."""
    return {
        "plot": job.plot.name,
        "date": job.date,
        "captures": job.captures,
        "notes": tuple(dict.fromkeys(notes)),
        "fieldkit": __version__,
        "stages": stage_versions(),
        "photographs": _paths(job),
    }


def _paths(job: VisitJob) -> dict[str, str]:
    found = {}
    for each in job.photos:
        path = each.photo.path
        inside = path.is_relative_to(job.folder)
        name = (path.relative_to(job.folder) if inside else path).as_posix()
        if clean_text(name) == name:  # bytes that are no UTF-8 cannot be kept: such a photograph is given again
            found[each.photo.sha256] = name
    return found


def _evaluated(job: VisitJob, folder: Path) -> Visit:
    spent = Spent.now()
    settings, notes = job.evaluation.reconstruction, list(job.notes)

    def given() -> PlotCapture:
        reference = _reference(job.plot)
        known = None if reference is None else reference.known_plot()
        capture = by_station(capture_of(job.photos, camera=job.camera), settings.mask)
        without = wanted_sidecars(capture, job.plan, known)
        if without:
            notes.append(f"{' and '.join(sorted(without))} passed over: the positions are taken from GPS")
            capture = by_station(capture_of(job.photos, camera=job.camera, without=without), settings.mask)
        placed = place_visit(capture, job.plot, job.plan, known, seed=settings.seed)
        notes.extend((*placed.notes, *_against_plan(capture, job.plan)))
        rasters = job.evaluation.wanted_rasters
        return PlotCapture(
            capture,
            Scoring.against(reference, refine=job.evaluation.refine, distances_m=job.evaluation.distances_m),
            placed.plot,
            placed.outline,
            None if rasters is None else replace(rasters, at_origin=placed.at_origin),
            None if placed.plot is None else ComparedPlan(job.plan, placed.plot.source),
        )

    name = plot_file_name(job.plot.name, (*RESERVED, VISIT_FILE))
    plot = evaluate_plot(
        job.plot.name, given, folder, name, settings, Context(StageCache(job.cache)), photographs=len(job.photos)
    )
    report = evaluation_report(
        Path(job.captures).name,
        [plot],
        settings,
        reference_sha256=job.plot.reference_sha256,
        refine=job.evaluation.refine,
        distances_m=job.evaluation.distances_m,
        seconds=spent.seconds,
        cpu_seconds=spent.cpu_seconds,
    )
    write_evaluation(folder, report)
    said = _of_job(job, [*notes, *_remarks(job, plot)])
    return Visit.of_evaluation(plot, folder=job.place, cpu_s=spent.cpu_seconds, inputs=job.inputs, **said)


def _remarks(job: VisitJob, plot: PlotEvaluation) -> Iterator[str]:
    """What else a person should know of an evaluation."""
    yield from (finding.message for finding in plot.findings if finding.code in (*TOLD, COARSE_RASTERS))
    yield from (f"no rasters: {finding.message}" for finding in plot.findings if finding.code == NO_RASTERS)
    top_m = None if plot.traits is None else plot.traits.height_m
    outgrown = None if top_m is None else plants_outgrown(job.plan, top_m)
    if outgrown is not None:
        yield f"{outgrown.message}. {outgrown.remedy}"
    if plot.prediction is not None and plot.prediction.reason:
        yield f"no prediction: {plot.prediction.reason}"


def _against_plan(capture: Capture, plan: Plan) -> list[str]:
    have, asked = len(capture.photos), len(plan.stations)
    if have == asked:
        return []
    return [f"{count(have, 'photograph')}, {'fewer' if have < asked else 'more'} than the plan's {asked}"]


def _reference(plot: CampaignPlot) -> Reference | None:
    if plot.reference is None:
        return None
    if plot.reference_sha256_now() != plot.reference_sha256:
        file = plot.reference / REFERENCE_FILE
        if not file.is_file():
            raise MetadataError(
                f"the reference of {plot.name} is not there", path=file, remedy="Correct its path in campaign.toml."
            )
        raise MetadataError(
            f"the reference of {plot.name} is not the one that campaign.toml names by its sha256",
            path=file,
            remedy="Put its new sha256 into campaign.toml; all visits of the plot are then evaluated again.",
        )
    return Reference(plot.reference)
