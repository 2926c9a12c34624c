"""fieldkit evaluate in a campaign: photographs in, visits out; a run goes on where an earlier one ended.

A visit holds a digest of all that its result depends on. Where that is still the same, the visit is kept.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from filelock import FileLock, Timeout

from fieldkit.cache import StageCache, digest
from fieldkit.campaign.evaluate_visit import VisitJob, evaluate_visit, failed_visit
from fieldkit.campaign.reading import Campaign, Visits, keep_visit, read_campaign, stage_versions
from fieldkit.campaign.sorting import PhotoToSort, Sorting, sort_photographs
from fieldkit.captures import find_mask
from fieldkit.captures.selection import FoundPhoto, FoundPhotos, capture_of, find_photographs, photographs_at
from fieldkit.errors import CaptureError, FieldkitError, MetadataError, StorageError
from fieldkit.evaluation.evaluate_plot import unforeseen
from fieldkit.figures.spreadsheets import TRAITS_FILE, trait_row, traits_csv
from fieldkit.figures.style import format_length
from fieldkit.files import check_writable, remove_if_abandoned, storage_errors, write_atomic
from fieldkit.results.finding import Finding
from fieldkit.results.report_files import EVALUATION_FILE, REFERENCE_FILE, file_sha256
from fieldkit.results.visit import VISITS_FOLDER, Visit
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.runtime.worker import NoWorkersError
from fieldkit.wording import count

LOCK_FILE = ".lock"
_POLL_S = 0.5
"""Time between two tries to lock a campaign, seconds."""
_RESULTS = (EVALUATION_FILE, REFERENCE_FILE)
_OUTER_FOLDERS = 2  # names above the searched folder that may say plot and date
_SHOWN = 8
"""Most findings that are told."""


@dataclass(frozen=True)
class CampaignRun:
    """What `evaluate_campaign` did."""

    campaign: Campaign
    """As it is now, with all its visits."""
    photographs: int
    evaluated: tuple[Visit, ...]
    """Visits of this run."""
    kept: tuple[Visit, ...]
    """Visits of these photographs that were there already."""
    left_out: tuple[Finding, ...]
    """Photographs that belong to no visit, and why."""
    findings: tuple[Finding, ...]
    """Doubts and contradictions about the others."""

    @property
    def failed(self) -> int:
        """Visits of these photographs without a result."""
        return sum(bool(visit.error) for visit in (*self.evaluated, *self.kept))


def evaluate_campaign(
    folder: Path, captures: Path, context: Context | None = None, *, overwrite: bool = False
) -> CampaignRun:
    """Sort photographs into a campaign's plots and dates, and evaluate every visit that is new or changed.

    A visit is a plot on a date. Its photographs add up: those that an earlier run found, and that are still where they
    were, count together with new ones (a re-flight). It says what it was made from, so that nothing is computed twice,
    and what changed is computed again. A run that is killed leaves whole visits only. At its end traits.csv
    is made of all visits.
    """
    context = context or Context.usual()
    progress = context.progress
    campaign = read_campaign(folder)
    folder = campaign.folder
    check_writable(folder)
    _ = (campaign.evaluation.reconstruction, campaign.evaluation.wanted_rasters)  # refuse what is not installed
    with campaign_lock(folder, note=progress.note):
        sweep(folder)
        campaign = read_campaign(folder)  # another run may have ended meanwhile
        visits = {visit.key: visit for visit in campaign.visits}
        found, sorting = _sorted(campaign, captures, visits, progress)
        _say(campaign, sorting, found, progress)
        jobs = _jobs(campaign, captures, found, sorting, context.cache)
        kept = [] if overwrite else unchanged(jobs, visits)
        same = {visit.key for visit in kept}
        todo = [job for job in jobs if (job.plot.name, job.date) not in same]
        try:
            weights = [1.0] * len(kept) + [float(len(job.photos)) for job in todo]
            with progress.stage("Visits", len(weights), weights=weights) as advance:
                advance(len(kept))
                evaluated = _evaluated(folder, todo, context, advance)
        finally:
            sweep(folder)  # of workers that were stopped in the middle
        campaign = write_traits(folder)
    left_out = (*found.findings, *sorting.left_out)
    return CampaignRun(campaign, len(found.photos), evaluated, tuple(kept), left_out, sorting.findings)


def _evaluated(
    folder: Path, todo: Sequence[VisitJob], context: Context, advance: Callable[[int], None]
) -> tuple[Visit, ...]:
    """The visits, each kept in the campaign's folder and told of as it is done."""
    evaluated = []
    if not todo:  # then neither processes nor a cluster are needed
        return ()
    with context.executor() as executor:
        jobs = {executor.submit(evaluate_visit, job): job for job in todo}
        for future in as_completed(jobs):
            visit = _visit(jobs[future], future)
            if not visit.folder:
                keep_visit(folder, visit)
            evaluated.append(visit)
            context.progress.note(f"{visit.plot} {visit.date}: {_sentence(visit)}")
            advance(1)
    return tuple(evaluated)


def _visit(job: VisitJob, future: Future[Visit]) -> Visit:
    """What came of a visit; what need not happen again (a bug, no memory) is tried at the next run."""
    try:
        return future.result()
    except (StorageError, NoWorkersError):
        raise
    except Exception as error:  # one plot must not stop the others
        return failed_visit(job, str(error if isinstance(error, FieldkitError) else unforeseen(error).message))


def write_traits(folder: Path) -> Campaign:
    """Write traits.csv of all visits of a campaign, which is given as it is now."""
    campaign = read_campaign(folder)
    rows = (trait_row(v.plot, v.date, v.traits, v.error) for v in campaign.visits)
    write_atomic(folder / TRAITS_FILE, traits_csv(rows))
    return campaign


@contextmanager
def campaign_lock(folder: Path, *, note: Callable[[str], None]) -> Iterator[None]:
    """Hold a campaign's lock within the block; it ends with the process that holds it."""
    lock = FileLock(folder / LOCK_FILE)
    with storage_errors(folder):
        try:
            lock.acquire(timeout=0)
        except Timeout:
            note("waiting: another run works in this campaign")
            lock.acquire(poll_interval=_POLL_S)
    try:
        yield
    finally:
        lock.release()


def visit_inputs(job: VisitJob) -> str:
    """Digest of everything a visit's result depends on: photographs, sidecars, plan, settings, plot, reference, and
    the versions of all stages.
    """
    capture = capture_of(job.photos, camera=job.camera)
    masks = [find_mask(photo.path) for photo in capture.photos] if job.evaluation.mask == "file" else []
    plot, rasters = job.plot, job.evaluation.wanted_rasters
    # Digests of visits without rasters are as they were before there were any.
    evaluation = job.evaluation.model_dump_json(exclude={"rasters", "gsd_m"})
    return digest(
        "visit",
        stage_versions(),
        [(photo.name, photo.sha256) for photo in capture.photos],
        dict(capture.priors),
        capture.groups,
        capture.metric_source,
        capture.origin,
        capture.markers,
        [None if mask is None else file_sha256(mask) for mask in masks],
        job.plan.model_dump_json(),
        evaluation,
        (plot.latitude_deg, plot.longitude_deg, plot.row_heading_deg, plot.shape, plot.size_m),
        plot.reference_sha256,
        plot.reference_sha256_now(),
        *(() if rasters is None else (rasters,)),
        *((capture.to_take_off_m,) if capture.to_take_off_m else ()),
    )


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
    """Photographs that earlier runs sorted into some visits, that are still where they were, and that are new here."""
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


def _sorted(campaign: Campaign, captures: Path, visits: Visits, progress: Progress) -> tuple[FoundPhotos, Sorting]:
    """The photographs below ``captures``, and where they belong, together with those of earlier runs."""
    own = (campaign.folder / VISITS_FOLDER).resolve()

    def skip(folder: Path) -> bool:
        return any((folder / name).is_file() for name in _RESULTS) or folder.resolve() == own

    found = find_photographs(captures, skip=skip, progress=progress)
    outer, plans = _outer(campaign.folder, captures), [campaign.carried_plan(plot.name) for plot in campaign.plots]
    shots = [PhotoToSort(each.place, each.photo, (*outer, *each.folders)) for each in found.photos]
    sorting = sort_photographs(shots, campaign.plots, plans)
    keys = [(visit.plot, visit.date) for visit in sorting.visits]
    earlier = earlier_photographs(campaign.folder, keys, visits, found.photos)
    if earlier:
        shots += [PhotoToSort(each.place, each.photo, belongs=belongs) for each, belongs in earlier]
        sorting = sort_photographs(shots, campaign.plots, plans)
        found = replace(found, photos=(*found.photos, *(each for each, _ in earlier)))
    if not sorting.visits:
        first = sorting.left_out[0]
        raise CaptureError(
            f"of {count(len(found.photos), 'photograph')} none could be sorted into a plot "
            f"({first.subject}: {first.message})",
            path=captures,
            remedy="Put them into folders PLOT/DATE, give --shared, or check the plots of the campaign.",
        )
    return found, sorting


def _outer(folder: Path, captures: Path) -> tuple[str, ...]:
    """Names of the searched folder and of those about it that may say a plot or a date; not the campaign's own."""
    captures, folder = captures.resolve(), folder.resolve()
    parts = captures.relative_to(folder).parts if captures.is_relative_to(folder) else captures.parts
    return tuple(parts[-_OUTER_FOLDERS:])


def _jobs(
    campaign: Campaign, captures: Path, found: FoundPhotos, sorting: Sorting, cache: StageCache
) -> list[VisitJob]:
    photos, plots = {each.place: each for each in found.photos}, {plot.name: plot for plot in campaign.plots}
    jobs = []
    for visit in sorting.visits:
        chosen = tuple(photos[place] for place in visit.places)
        job = VisitJob(
            plot=plots[visit.plot],
            date=visit.date,
            photos=chosen,
            captures=_common(captures, chosen),
            notes=visit.notes,
            folder=campaign.folder,
            plan=campaign.carried_plan(visit.plot),
            evaluation=campaign.evaluation,
            camera=campaign.camera_file,
            cache=None if cache.root is None else cache.root.absolute(),
        )
        with suppress(MetadataError):  # a malformed sidecar; evaluating says so in the visit's row
            job = replace(job, inputs=visit_inputs(job))
        jobs.append(job)
    return jobs


def _common(captures: Path, photos: Sequence[FoundPhoto]) -> str:
    """The folder of photographs, as given."""
    shared = Path(os.path.commonpath([each.photo.path.parent for each in photos]))
    root = captures.absolute()
    return str(captures / shared.relative_to(root)) if shared.is_relative_to(root) else str(shared)


def _say(campaign: Campaign, sorting: Sorting, found: FoundPhotos, progress: Progress) -> None:
    told = [*found.findings, *sorting.left_out, *sorting.findings]
    for finding in told[:_SHOWN]:
        progress.note(f"{finding.subject}: {finding.message}{' (left out)' if finding.left_out else ''}")
    if len(told) > _SHOWN:
        progress.note(f"and {count(len(told) - _SHOWN, 'more finding')}; --json lists all")
    for plot in campaign.vanished:
        progress.note(f"{plot}: has visits, but is no longer among the plots")


def _sentence(visit: Visit) -> str:
    if visit.error:
        return visit.error
    without = [f"no rasters: {visit.no_rasters}"] if visit.no_rasters else []
    counts = "; ".join([f"{visit.right} of {count(visit.images, 'photograph')} used", *without])
    if visit.chamfer_m is not None:
        return f"chamfer {format_length(visit.chamfer_m)}, {counts}"
    if visit.predicted_chamfer_m is not None:
        return f"chamfer predicted {format_length(visit.predicted_chamfer_m)}, {counts}"
    return counts
