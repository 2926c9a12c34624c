"""How a run goes on where an earlier one ended: which visits are there already, and what makes one be computed again.

A visit holds a digest of all that its result depends on. Where that is still the same, the visit is kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from fieldkit.cache import digest
from fieldkit.campaign.evaluate_visit import VisitJob
from fieldkit.campaign.visits import Visits, stage_versions
from fieldkit.captures import find_mask
from fieldkit.captures.selection import FoundPhoto, capture_of, photographs_at
from fieldkit.files import remove_if_abandoned
from fieldkit.results.report_files import EVALUATION_FILE, file_sha256
from fieldkit.results.visit import VISITS_FOLDER, Visit


def visit_inputs(job: VisitJob) -> str:
    """Digest of everything a visit's result depends on: photographs, sidecars, plan, settings, plot, reference, and
    the versions of all stages.

    Raises:
        MetadataError: a sidecar is malformed.
    """
    capture = capture_of(job.photos, camera=job.camera)
    masks = [find_mask(photo.path) for photo in capture.photos] if job.evaluation.mask == "file" else []
    plot, rasters = job.plot, job.evaluation.wanted_rasters
    # Digests of visits without rasters are as they were before there were any.
    evaluation = job.evaluation.model_dump_json(exclude={"rasters", "gsd_m"})
    return digest(
        "visit", stage_versions(), [(photo.name, photo.sha256) for photo in capture.photos], dict(capture.priors),
        capture.groups, capture.metric_source, capture.origin, capture.markers,
        [None if mask is None else file_sha256(mask) for mask in masks],
        job.plan.model_dump_json(), evaluation,
        (plot.latitude_deg, plot.longitude_deg, plot.row_heading_deg, plot.shape, plot.size_m), plot.reference_sha256,
        plot.reference_sha256_now(), *(() if rasters is None else (rasters,)),
    )  # fmt: skip


def unchanged(jobs: Sequence[VisitJob], visits: Visits) -> list[Visit]:
    """The visits of jobs that are done already."""
    kept = []
    for job in jobs:
        visit = visits.get((job.plot.name, job.date))
        same = visit is not None and job.inputs != "" and visit.inputs == job.inputs
        if visit is not None and same and (job.folder / job.place / EVALUATION_FILE).is_file():
            kept.append(visit)
    return kept


def earlier_photographs(
    folder: Path, keys: Iterable[tuple[str, str]], visits: Visits, found: Iterable[FoundPhoto]
) -> list[tuple[FoundPhoto, tuple[str, str]]]:
    """Photographs that earlier runs sorted into some visits, that are still where they were, and that are new here.

    Args:
        folder: of the campaign.
        keys: plot and date of the visits.
        visits: of the campaign.
        found: photographs that are known.
    """
    known = {each.photo.sha256 for each in found}
    result = []
    for key in keys:
        photographs = visits[key].photographs if key in visits else {}
        paths = [folder / path for sha256, path in photographs.items() if sha256 not in known]
        for each in photographs_at(paths):
            if each.photo.sha256 in photographs and each.photo.sha256 not in known:
                known.add(each.photo.sha256)
                result.append((each, key))
    return result


def sweep(folder: Path) -> None:
    """Remove what killed runs left in a campaign's folder; what belongs to a run that lives is locked and stays."""
    for place in (folder / VISITS_FOLDER).glob("*/.*.partial"):
        remove_if_abandoned(place)
