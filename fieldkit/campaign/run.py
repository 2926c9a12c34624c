"""fieldkit evaluate in a campaign: photographs in, rows of its table out. Goes on where a former run was stopped."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from fieldkit.cache import StageCache
from fieldkit.campaign.campaign_file import CAMPAIGN_FILE
from fieldkit.campaign.folder import VISITS_FOLDER, Campaign, read_campaign
from fieldkit.campaign.lock import campaign_lock
from fieldkit.campaign.names import folder_name
from fieldkit.campaign.sorting import Shot, Sorting, sort_photographs
from fieldkit.campaign.table import TABLE_FILE, Row, Table
from fieldkit.campaign.visit import Visit
from fieldkit.campaign.visiting import (
    VisitJob,
    VisitResult,
    evaluate_visit,
    read_record,
    visit_inputs,
)
from fieldkit.captures import Finding
from fieldkit.captures.selection import FoundPhoto, FoundPhotos, find_photographs, photographs_at
from fieldkit.errors import CaptureError, MetadataError, StorageError
from fieldkit.files import check_writable
from fieldkit.present.style import format_length
from fieldkit.results.report_files import EVALUATION_FILE, REFERENCE_FILE
from fieldkit.runtime.parallel import each_in_workers
from fieldkit.runtime.progress import Progress
from fieldkit.runtime.worker import Outcome

_RESULTS = (EVALUATION_FILE, REFERENCE_FILE, CAMPAIGN_FILE)
_OUTER_FOLDERS = 2  # names above the searched folder that may say plot and date
_SHOWN = 8


@dataclass(frozen=True)
class CampaignRun:
    """What `evaluate_campaign` did.

    Attributes:
        campaign: as it is now, with all its visits.
        photographs: found.
        evaluated: visits of this run.
        kept: visits of these photographs that were there already.
        left_out: photographs that belong to no visit, and why.
        findings: doubts and contradictions about the others.
    """

    campaign: Campaign
    photographs: int
    evaluated: tuple[Visit, ...]
    kept: tuple[Visit, ...]
    left_out: tuple[Finding, ...]
    findings: tuple[Finding, ...]

    @property
    def failed(self) -> int:
        """Visits of these photographs without a result."""
        return sum(bool(visit.error) for visit in (*self.evaluated, *self.kept))


def evaluate_campaign(
    folder: Path,
    captures: Path,
    *,
    cache: StageCache,
    progress: Progress,
    workers: int = 1,
    wait: bool = True,
    overwrite: bool = False,
) -> CampaignRun:
    """Sort photographs into a campaign's plots and dates, and evaluate every visit that is new or changed.

    A visit is a plot on a date. Its photographs add up: those that an earlier run found, and that are still where they
    were, count together with new ones (a re-flight). Its row says what it was made from, so that nothing is computed
    twice, and what changed is computed again. A run that is killed leaves whole visits only.

    Args:
        folder: of the campaign.
        captures: folder with photographs in it and below it; only read.
        cache: of stages.
        progress: told of stages, visits and findings.
        workers: processes, a visit each; the results do not depend on it.
        wait: for another run in this campaign to end; else it is an error.
        overwrite: evaluate also what is there already.

    Raises:
        UsageError: another run works in the campaign, and ``wait`` is off.
        MetadataError: a file of the campaign is missing or malformed.
        CaptureError: there are no photographs, or none belongs to any plot.
        StorageError: the disk is full or not writable.
    """
    folder = read_campaign(folder).folder
    check_writable(folder)
    with campaign_lock(folder, wait=wait, note=progress.note), Table(folder / TABLE_FILE) as table:
        campaign = read_campaign(folder)
        _sweep(folder / VISITS_FOLDER)
        rows = {(row.visit.plot, row.visit.date): row for row in table.rows()}
        for row in _lost_rows(campaign, rows):
            table.put(row)
            rows[row.visit.plot, row.visit.date] = row
        found, sorting = _sorted(campaign, captures, progress)
        _say(campaign, sorting, found, progress)
        jobs = _jobs(campaign, captures, found, sorting, cache)
        kept = [] if overwrite else _unchanged(folder, jobs, rows, table)
        same = {(visit.plot, visit.date) for visit in kept}
        todo = [job for job in jobs if (job.plot.id, job.date) not in same]
        evaluated: list[Visit] = []
        try:
            with progress.stage("Visits", len(jobs)) as advance, closing(_evaluate(todo, workers)) as results:
                advance(len(kept))
                for row in results:
                    table.put(row)
                    evaluated.append(row.visit)
                    progress.note(f"{row.visit.plot} {row.visit.date}: {_sentence(row.visit)}")
                    advance(1)
        finally:
            _sweep(folder / VISITS_FOLDER)  # of workers that were stopped in the middle
    return CampaignRun(
        read_campaign(folder),
        len(found.photos),
        tuple(evaluated),
        tuple(kept),
        (*found.findings, *sorting.left_out),
        sorting.findings,
    )


def _evaluate(todo: Sequence[VisitJob], workers: int) -> Generator[Row, None, None]:
    """The rows of visits as they are done; those whose worker died are tried once more, one at a time."""
    again: list[VisitJob] = []
    with closing(each_in_workers(evaluate_visit, todo, workers=workers)) as results:
        for number, outcome in results:
            if outcome.result is None and workers > 1:
                again.append(todo[number])
            else:
                yield _row(todo[number], outcome)
    with closing(each_in_workers(evaluate_visit, again, workers=1)) as results:
        for number, outcome in results:
            yield _row(again[number], outcome)


def _row(job: VisitJob, outcome: Outcome[VisitResult]) -> Row:
    result = outcome.result
    if result is None:
        visit = Visit(
            job.plot.id, job.date, captures=job.captures, images=len(job.photos), error=outcome.failure, notes=job.notes
        )
        return Row(visit, "")
    if result.storage is not None:
        message, path, remedy = result.storage
        raise StorageError(message, path=path, remedy=remedy)
    return Row(result.visit, result.inputs)


def _sorted(campaign: Campaign, captures: Path, progress: Progress) -> tuple[FoundPhotos, Sorting]:
    """The photographs below ``captures``, and where they belong, together with those of earlier runs."""
    visits = (campaign.folder / VISITS_FOLDER).resolve()

    def skip(folder: Path) -> bool:
        return any((folder / name).is_file() for name in _RESULTS[:2]) or folder.resolve() == visits

    found = find_photographs(captures, skip=skip, progress=progress)
    if not found.photos:
        raise CaptureError(
            "there are no usable photographs in this folder, nor below it", path=captures,
            remedy="Give the folder that holds the photographs of one or more plots.",
        )  # fmt: skip
    outer = _outer(campaign.folder, captures)
    shots = [Shot(each.place, each.photo, (*outer, *each.folders)) for each in found.photos]
    sorting = sort_photographs(shots, campaign.plots, campaign.plan)
    earlier = _earlier(campaign, found, sorting)
    if earlier:
        shots += [Shot(each.place, each.photo, belongs=belongs) for each, belongs in earlier]
        sorting = sort_photographs(shots, campaign.plots, campaign.plan)
        found = replace(found, photos=(*found.photos, *(each for each, _ in earlier)))
    if not sorting.visits:
        first = sorting.left_out[0]
        raise CaptureError(
            f"none of the {len(found.photos)} photographs could be sorted into a plot "
            f"({first.name}: {first.message})", path=captures,
            remedy="Put them into folders PLOT/DATE, or check the plots of the campaign.",
        )  # fmt: skip
    return found, sorting


def _outer(folder: Path, captures: Path) -> tuple[str, ...]:
    """Names of the searched folder and of those about it that may say a plot or a date; not the campaign's own."""
    captures, folder = captures.resolve(), folder.resolve()
    parts = captures.relative_to(folder).parts if captures.is_relative_to(folder) else captures.parts
    return tuple(parts[-_OUTER_FOLDERS:])


def _earlier(campaign: Campaign, found: FoundPhotos, sorting: Sorting) -> list[tuple[FoundPhoto, tuple[str, str]]]:
    """Photographs that earlier runs sorted into the same visits, and that are not among these."""
    known = {each.photo.sha256 for each in found.photos}
    result = []
    for visit in sorting.visits:
        record = read_record(campaign.folder / VISITS_FOLDER / folder_name(visit.plot) / visit.date)
        if record is None:
            continue
        paths = [campaign.folder / path for sha256, path in record.photographs.items() if sha256 not in known]
        for each in photographs_at(paths):
            if each.photo.sha256 in record.photographs and each.photo.sha256 not in known:
                known.add(each.photo.sha256)
                result.append((each, (visit.plot, visit.date)))
    return result


def _jobs(
    campaign: Campaign, captures: Path, found: FoundPhotos, sorting: Sorting, cache: StageCache
) -> list[VisitJob]:
    photos = {each.place: each for each in found.photos}
    jobs = []
    for visit in sorting.visits:
        chosen = tuple(photos[place] for place in visit.places)
        job = VisitJob(
            plot=campaign.plot(visit.plot),
            date=visit.date,
            photos=chosen,
            captures=_common(captures, chosen),
            notes=visit.notes,
            folder=campaign.folder,
            plan=campaign.plan_of(visit.plot, visit.date),
            evaluation=campaign.evaluation,
            camera=campaign.camera_file,
            cache=None if cache.root is None else cache.root,
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


def _unchanged(folder: Path, jobs: Sequence[VisitJob], rows: dict[tuple[str, str], Row], table: Table) -> list[Visit]:
    """Visits that are done already: in the table or, where a run was killed before it came to that, in their folder."""
    kept = []
    for job in jobs:
        place = folder / job.place
        row = rows.get((job.plot.id, job.date))
        if not job.inputs or not (place / EVALUATION_FILE).is_file():
            continue
        if row is not None and row.inputs == job.inputs:
            kept.append(row.visit)
            continue
        record = read_record(place)
        if record is not None and record.inputs == job.inputs:
            table.put(Row(record.visit, record.inputs))
            kept.append(record.visit)
    return kept


def _lost_rows(campaign: Campaign, rows: dict[tuple[str, str], Row]) -> Iterator[Row]:
    """Rows of visits whose folders are there and whose rows are not."""
    places = {row.visit.folder for row in rows.values()}
    for place in sorted((campaign.folder / VISITS_FOLDER).glob("*/*/")):
        if f"{VISITS_FOLDER}/{place.parent.name}/{place.name}" in places:
            continue
        record = read_record(place)
        if record is None or (record.visit.plot, record.visit.date) in rows:
            continue
        if folder_name(record.visit.plot) == place.parent.name and record.visit.date == place.name:
            yield Row(record.visit, record.inputs)


def _sweep(visits: Path) -> None:
    """Remove what killed runs left behind; a folder whose maker lives is locked and stays."""
    for place in visits.glob("*/.*.partial"):
        with suppress(OSError):
            descriptor = os.open(place, os.O_RDONLY)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(place, ignore_errors=True)
            finally:
                os.close(descriptor)


def _say(campaign: Campaign, sorting: Sorting, found: FoundPhotos, progress: Progress) -> None:
    told = [*found.findings, *sorting.left_out, *sorting.findings]
    for finding in told[:_SHOWN]:
        progress.note(f"{finding.name}: {finding.message}{' (left out)' if finding.left_out else ''}")
    if len(told) > _SHOWN:
        progress.note(f"and {len(told) - _SHOWN} more findings; --json lists them all")
    for plot in campaign.vanished:
        progress.note(f"{plot}: has visits, but is no longer among the plots")


def _sentence(visit: Visit) -> str:
    if visit.error:
        return visit.error
    counts = f"{visit.right} of {visit.images} photographs used"
    if visit.chamfer_m is not None:
        return f"chamfer {format_length(visit.chamfer_m)}, {counts}"
    if visit.predicted_chamfer_m is not None:
        return f"chamfer predicted {format_length(visit.predicted_chamfer_m)}, {counts}"
    return counts
