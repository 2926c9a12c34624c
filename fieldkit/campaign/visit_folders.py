"""Where a campaign keeps its visits: visit.json in visits/PLOT/DATE, and nowhere else."""

from __future__ import annotations

from pathlib import Path

from fieldkit.campaign.earlier_formats import read_earlier_table, visit_of_version_1
from fieldkit.campaign.folder_names import folder_name
from fieldkit.evaluation.reference import CLOUD_FILE
from fieldkit.results.report_files import EVALUATION_FILE, load_evaluation_report
from fieldkit.results.visit import VISITS_FOLDER, Visit
from fieldkit.results.visit_file import VISIT_FILE, save_visit, visit_document, visit_of_document

Visits = dict[tuple[str, str], Visit]
"""By plot and date."""
_OWN = (VISIT_FILE, EVALUATION_FILE)


def visit_place(plot: str, date: str) -> str:
    """A visit's folder, relative to the campaign's."""
    return f"{VISITS_FOLDER}/{folder_name(plot)}/{date}"


def visit_cloud(campaign: Path, visit: Visit) -> Path | None:
    """The cloud of a visit's plants; None where it has none.

    Raises:
        MetadataError: its evaluation.json is missing or damaged.
    """
    return None if visit.error else visit_files(campaign, visit).get(CLOUD_FILE)


def visit_files(campaign: Path, visit: Visit) -> dict[str, Path]:
    """The files of a visit's evaluation that are still there, by their own name without folders.

    Raises:
        MetadataError: its evaluation.json is missing or damaged.
    """
    if not visit.folder:
        return {}
    folder = campaign / visit.folder
    listed = [file.name for plot in load_evaluation_report(folder).plots for file in plot.files]
    return {Path(name).name: folder / name for name in listed if (folder / name).is_file()}


def read_visits(campaign: Path) -> list[Visit]:
    """All visits of a campaign's folder, by plot and date. Nothing is made or changed.

    A visit that lies in another folder than its own (a copy) is passed over.

    Raises:
        MetadataError: a visit.json is damaged or of a newer version, or so is the table of an earlier fieldkit.
    """
    return _read(campaign)[0]


def adopt_earlier_visits(campaign: Path) -> bool:
    """Give every visit of an earlier fieldkit a visit.json of today.

    Returns:
        Whether each has one; else a folder that holds something else is in the way.

    Raises:
        MetadataError: as `read_visits`.
        StorageError: the disk is full or not writable.
    """
    visits, today = _read(campaign)
    kept = [keep_visit(campaign, visit) for visit in visits if visit.key not in today]
    return all(kept)


def keep_visit(campaign: Path, visit: Visit) -> bool:
    """Write a visit into its folder, beside an evaluation that may be there.

    Returns:
        Whether it could be: a folder that holds something else than a visit is somebody's other work.

    Raises:
        StorageError: the disk is full or not writable.
    """
    place = campaign / visit_place(*visit.key)
    if place.is_dir() and any(place.iterdir()) and not any((place / name).is_file() for name in _OWN):
        return False
    save_visit(place, visit)
    return True


def _read(campaign: Path) -> tuple[list[Visit], Visits]:
    """All visits by plot and date, and those that have a visit.json of today's format."""
    rows = read_earlier_table(campaign)  # first: a run may be taking it into the folders just now
    today, before = _in_folders(campaign)
    visits = dict(today)
    for row in rows:
        if row.key not in visits:
            visits[row.key] = _newer(row, before.get(row.key))
    return sorted((before | visits).values(), key=lambda visit: visit.key), today


def _in_folders(campaign: Path) -> tuple[Visits, Visits]:
    """The visits in the folders: those of today's format, and those of version 1."""
    today: Visits = {}
    before: Visits = {}
    for file in sorted((campaign / VISITS_FOLDER).glob(f"[!.]*/[!.]*/{VISIT_FILE}")):
        place = file.parent
        document = visit_document(place)
        is_version_1 = document.get("version") == 1
        visit = visit_of_version_1(document, campaign) if is_version_1 else visit_of_document(document, place)
        if visit is not None and campaign / visit_place(*visit.key) == place:
            (before if is_version_1 else today)[visit.key] = visit
    return today, before


def _newer(row: Visit, record: Visit | None) -> Visit:
    """Of an earlier table's row and the visit.json beside the evaluation, which was written first, the newer one.

    A row without inputs is of a later try that came to nothing and left the folder as it was.
    """
    if record is None:
        return row
    return record if row.inputs else row.model_copy(update={"photographs": record.photographs})
