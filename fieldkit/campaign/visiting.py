"""One visit evaluated and written: what a worker does."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fieldkit.cache import StageCache, digest
from fieldkit.campaign.campaign_file import EvaluationTable
from fieldkit.campaign.folder import VISITS_FOLDER, CampaignPlot
from fieldkit.campaign.names import folder_name
from fieldkit.campaign.placing import place_visit, wanted_sidecars
from fieldkit.campaign.table import visit_of, visit_values
from fieldkit.campaign.visit import Visit
from fieldkit.captures import Capture, find_mask
from fieldkit.captures.selection import FoundPhoto, capture_of
from fieldkit.documents.json_file import read_json_object
from fieldkit.errors import FieldkitError, MetadataError, StorageError
from fieldkit.evaluation.conversion import evaluation_report, failed_plot
from fieldkit.evaluation.evaluate import PLOTS_FILE
from fieldkit.evaluation.plan_adherence import FlownPlan, write_adherence
from fieldkit.evaluation.reference import Reference
from fieldkit.evaluation.scoring import Scoring, Spent, score_capture
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.missions.plan_site.fit import plants_outgrown
from fieldkit.present.spreadsheets.plots import write_plots_csv
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.plan import Plan
from fieldkit.results.report_files import EVALUATION_FILE, REFERENCE_FILE, describe_files, file_sha256, save_report
from fieldkit.runtime.progress import Silent

VISIT_FILE = "visit.json"
_VERSION = 4  # part of the inputs' digest: raised when evaluating a visit changes its results
_MAX_BYTES = 8 << 20
_TOLD = (
    "volume-cuts-plants", "steep-ground", "refinement-not-converged", "too-few-positions", "several-take-offs",
    "mixed-cameras",
)  # fmt: skip


@dataclass(frozen=True)
class VisitJob:
    """What a worker needs to evaluate a visit.

    Attributes:
        plot: of the campaign.
        date: ISO 8601.
        photos: of the visit.
        captures: their folder, for people.
        notes: of sorting.
        folder: of the campaign.
        plan: that was flown.
        evaluation: settings.
        camera: calibration of photographs without one.
        cache: its root, or None.
        inputs: digest of all that the result depends on; "" where it could not be made.
    """

    plot: CampaignPlot
    date: str
    photos: tuple[FoundPhoto, ...]
    captures: str
    notes: tuple[str, ...]
    folder: Path
    plan: Plan
    evaluation: EvaluationTable
    camera: Path | None
    cache: Path | None
    inputs: str = ""

    @property
    def place(self) -> str:
        """The visit's folder, relative to the campaign's."""
        return f"{VISITS_FOLDER}/{folder_name(self.plot.id)}/{self.date}"


@dataclass(frozen=True)
class VisitResult:
    """What came of a visit.

    Attributes:
        visit: its row.
        inputs: of the job; "" where it is to be tried again.
        storage: message, path and remedy, where the disk is full or not writable; then the visit is not done.
    """

    visit: Visit
    inputs: str
    storage: tuple[str, str, str] | None = None


@dataclass(frozen=True)
class VisitRecord:
    """visit.json: a visit's row beside its evaluation, so that the table can be made again from the folders.

    Attributes:
        visit: the row.
        inputs: digest.
        photographs: paths, absolute or relative to the campaign's folder, by their SHA-256.
    """

    visit: Visit
    inputs: str
    photographs: dict[str, str]


def visit_inputs(job: VisitJob) -> str:
    """Digest of everything a visit's result depends on: photographs, sidecars, plan, settings, plot and reference.

    Raises:
        MetadataError: a sidecar is malformed.
    """
    capture = capture_of(job.photos, camera=job.camera)
    masks = [find_mask(photo.path) for photo in capture.photos] if job.evaluation.mask == "file" else []
    plot = job.plot
    return digest(
        "visit", _VERSION, [(photo.name, photo.sha256) for photo in capture.photos], dict(capture.priors),
        capture.groups, capture.metric_source, capture.origin, capture.markers,
        [None if mask is None else file_sha256(mask) for mask in masks],
        job.plan.model_dump_json(), job.evaluation.model_dump_json(),
        (plot.latitude_deg, plot.longitude_deg, plot.row_heading_deg), plot.reference_sha256, _reference_now(plot),
    )  # fmt: skip


def evaluate_visit(job: VisitJob) -> VisitResult:
    """Evaluate a visit and write its folder. Raises nothing: what goes wrong is in the visit's ``error``.

    Its errors are kept with its inputs, so that they are not met again before something changes; what need not happen
    again (a bug, no memory) is tried at the next run.
    """
    visit = Visit(job.plot.id, job.date, captures=job.captures, notes=job.notes, images=len(job.photos))
    try:
        with atomic_folder(job.folder / job.place, overwrite=True, marker=EVALUATION_FILE) as folder:
            visit = _evaluated(job, folder)
            _save_record(folder / VISIT_FILE, VisitRecord(visit, job.inputs, _paths(job)))
    except StorageError as error:
        return VisitResult(visit, "", (error.message, str(error.path or job.folder), error.remedy))
    except FieldkitError as error:
        return VisitResult(replace(visit, error=str(error)), "")
    except MemoryError:
        return VisitResult(replace(visit, error="not enough memory"), "")
    except Exception as error:  # one plot must not stop the others
        return VisitResult(replace(visit, error=f"a bug in fieldkit: {type(error).__name__}: {error}"), "")
    return VisitResult(visit, job.inputs)


def read_record(folder: Path) -> VisitRecord | None:
    """The visit.json of a visit's folder; None where there is none that can be used."""
    try:
        document = read_json_object(folder / VISIT_FILE, "", noun="visit", max_bytes=_MAX_BYTES)
        if document.get("kind") != "visit" or document.get("version") != 1:
            return None
        photographs = document["photographs"]
        if not all(isinstance(k, str) and isinstance(v, str) and "\0" not in v for k, v in photographs.items()):
            return None
        return VisitRecord(visit_of(document["visit"]), str(document["inputs"]), photographs)
    except (MetadataError, KeyError, TypeError, ValueError, AttributeError):
        return None


def _save_record(path: Path, record: VisitRecord) -> None:
    document: dict[str, Any] = {
        "kind": "visit", "version": 1, "inputs": record.inputs, "visit": visit_values(record.visit),
        "photographs": record.photographs,
    }  # fmt: skip
    write_atomic(path, json.dumps(document, indent=2, ensure_ascii=False) + "\n")


def _paths(job: VisitJob) -> dict[str, str]:
    found = {}
    for each in job.photos:
        path = each.photo.path
        inside = path.is_relative_to(job.folder)
        found[each.photo.sha256] = (path.relative_to(job.folder) if inside else path).as_posix()
    return found


def _evaluated(job: VisitJob, folder: Path) -> Visit:
    spent = Spent.now()
    settings, notes = job.evaluation.settings, list(job.notes)
    scoring: Scoring | None = None
    name = folder_name(job.plot.id)
    try:
        reference = _reference(job.plot)
        scoring = Scoring.against(
            reference, refine=job.evaluation.refine and reference is not None, distances_m=job.evaluation.distances_m
        )
        known = None if reference is None else reference.known_plot()
        capture = capture_of(job.photos, camera=job.camera)
        without = wanted_sidecars(capture, job.plan, known)
        if without:
            notes.append(f"{' and '.join(sorted(without))} passed over: the positions are taken from GPS")
            capture = capture_of(job.photos, camera=job.camera, without=without)
        placed = place_visit(capture, job.plot, job.plan, known, seed=settings.seed)
        notes += [*placed.notes, *_against_plan(capture, job.plan)]
        plot = score_capture(
            job.plot.id, capture, placed.plot, folder, settings, scoring,
            spent=spent, cache=StageCache(job.cache), progress=Silent(), subfolder=name,
        )  # fmt: skip
        if placed.plot is not None:
            plot = FlownPlan.of(job.plan, placed.plot.source).compare(plot, name, Path(job.captures), capture)
            plot = write_adherence(folder, name, plot)
    except StorageError:
        raise
    except FieldkitError as error:
        plot = failed_plot(
            job.plot.id, error, seconds=spent.seconds, cpu_seconds=spent.cpu_seconds, photographs=len(job.photos)
        )
    notes += [finding.message for finding in plot.findings if finding.code in _TOLD]
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
    write_plots_csv(folder / PLOTS_FILE, report)
    report = report.model_copy(update={"files": describe_files(folder, [PLOTS_FILE])})
    save_report(folder / EVALUATION_FILE, report)
    return _visit(job, plot, notes, spent.cpu_seconds)


def _visit(job: VisitJob, plot: PlotEvaluation, notes: Iterable[str], cpu_s: float) -> Visit:
    prediction, plants = plot.prediction, plot.plants
    said = list(notes)
    top_m = None if plants is None else plants.height_max_m
    outgrown = None if top_m is None else plants_outgrown(job.plan, top_m)
    if outgrown is not None:
        said.append(f"{outgrown.message}. {outgrown.remedy}")
    if prediction is not None and prediction.reason:
        said.append(f"no prediction: {prediction.reason}")
    return Visit(
        plot=job.plot.id,
        date=job.date,
        captures=job.captures,
        folder=job.place,
        images=plot.images,
        registered=plot.registered,
        right=plot.right,
        pose_rms_m=plot.pose_rms_m if plot.metric else None,
        chamfer_m=plot.chamfer_m,
        accuracy_m=plot.accuracy_m,
        completeness_m=plot.completeness_m,
        f_score=dict(plot.f_score or {}),
        predicted_chamfer_m=None if prediction is None else prediction.chamfer_m,
        predicted_low_m=None if prediction is None else prediction.low_m,
        predicted_high_m=None if prediction is None else prediction.high_m,
        height_m=None if plants is None else plants.height_m,
        cover=None if plants is None else plants.cover,
        hull_m3=None if plants is None else plants.hull_m3,
        cpu_s=cpu_s,
        error="" if plot.error is None else plot.error.message,
        notes=tuple(dict.fromkeys(said)),
    )


def _against_plan(capture: Capture, plan: Plan) -> list[str]:
    have, asked = len(capture.photos), len(plan.stations)
    if have == asked:
        return []
    return [f"{have} photographs, {'fewer' if have < asked else 'more'} than the plan's {asked}"]


def _reference(plot: CampaignPlot) -> Reference | None:
    if plot.reference is None:
        return None
    if _reference_now(plot) != plot.reference_sha256:
        file = plot.reference / REFERENCE_FILE
        if not file.is_file():
            raise MetadataError(
                f"the reference of {plot.id} is not there", path=file, remedy="Correct its path in campaign.toml."
            )
        raise MetadataError(
            f"the reference of {plot.id} is not the one that campaign.toml names by its sha256", path=file,
            remedy="Put its new sha256 into campaign.toml; all visits of the plot are then evaluated again.",
        )  # fmt: skip
    return Reference(plot.reference)


def _reference_now(plot: CampaignPlot) -> str:
    """The SHA-256 of the reference.json that is there; "" where there is none."""
    if plot.reference is None:
        return ""
    try:
        return file_sha256(plot.reference / REFERENCE_FILE)
    except OSError:
        return ""
