"""Campaigns of earlier fieldkits: a campaign.sqlite that held every visit's row, and visit.json of version 1.

There a row could be without a folder, so the table is read until each of its rows has a visit.json of today.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fieldkit.documents.json_file import first_problem, read_json_object
from fieldkit.errors import MetadataError, StorageError
from fieldkit.regular_files import is_other_than_file
from fieldkit.results.report_files import EVALUATION_FILE
from fieldkit.results.traits import COLUMNS as TRAITS_COLUMNS
from fieldkit.results.visit import ROW, Visit

TABLE_FILE = "campaign.sqlite"
APPLICATION_ID = 0x666B6370  # "fkcp"
TABLE_VERSION = 2
"""Of today's table, which is made of the visits' folders; one of version 1 held what was nowhere else."""
_BESIDE = ("-journal", "-wal", "-shm")
_TIMEOUT_S = 30.0
_TABLES = "SELECT count(*) FROM sqlite_master"
_MAX_BYTES = 256 << 20
_REMEDY = "Move it away; visits that have a folder in visits/ are kept."
_LATER = ("fieldkit", "doubts", *TRAITS_COLUMNS)
_FIELDS = tuple(name for name in ROW if name not in _LATER)
_COLUMNS = ", ".join(f'"{name}"' for name in (*_FIELDS, "inputs"))


def read_earlier_table(campaign: Path) -> list[Visit]:
    """The visits of a campaign.sqlite that held them; none where there is no file, or today's, which is an export.

    Raises:
        MetadataError: it is no such table, of a newer version, or damaged, or a row holds what no fieldkit wrote.
        StorageError: it cannot be opened.
    """
    path = campaign / TABLE_FILE
    if not path.exists():
        return []
    for file in (path, *(path.with_name(f"{TABLE_FILE}{end}") for end in _BESIDE)):  # SQLite would wait for a FIFO
        if is_other_than_file(file):
            raise MetadataError("is not a regular file", path=file, remedy=_REMEDY)
    with _errors(path), closing(_opened(path)) as database:
        if not database.execute(_TABLES).fetchone()[0]:
            return []  # killed while it was made
        if not _holds_visits(database, path):
            return []
        found = database.execute(f"SELECT {_COLUMNS} FROM visits ORDER BY plot, date").fetchall()
    rows = [dict(zip((*_FIELDS, "inputs"), values, strict=True)) for values in found]
    return [_visit_of_row(row, campaign) for row in rows]


def visit_of_version_1(document: dict[str, Any], campaign: Path) -> Visit | None:
    """The visit of a visit.json of version 1; None where it cannot be used: its row may be in the table."""
    try:
        return _visit(document["visit"], campaign, str(document["inputs"]), document["photographs"])
    except (KeyError, TypeError, ValueError):
        return None


def _visit_of_row(row: dict[str, Any], campaign: Path) -> Visit:
    try:
        return _visit(row, campaign, row["inputs"], {})
    except ValueError as error:
        problem = first_problem(error) if isinstance(error, ValidationError) else str(error)
        where = f"the row of {row['plot']!r} on {row['date']!r}"[:200]
        raise MetadataError(f"{where}: {problem}", path=campaign / TABLE_FILE, remedy=_REMEDY) from error


def _visit(row: dict[str, Any], campaign: Path, inputs: str, photographs: dict[str, str]) -> Visit:
    """A visit of columns, of which ``f_score`` and ``notes`` are JSON. Raises ValueError: nobody wrote that."""
    fields = {name: row[name] for name in _FIELDS}
    try:
        scores, notes = json.loads(fields["f_score"]), json.loads(fields["notes"])
    except (RecursionError, TypeError) as error:
        raise ValueError("f_score or notes are not JSON") from error
    if not isinstance(notes, list):
        raise ValueError("notes are not a list of texts")
    fields |= {"f_score": scores, "notes": tuple(notes), "inputs": inputs, "photographs": photographs}
    visit = Visit.model_validate(fields)
    return visit.model_copy(update={"fieldkit": _computed_by(campaign / visit.folder)}) if visit.folder else visit


def _computed_by(folder: Path) -> str:
    """The version of fieldkit that a visit's evaluation names; "" where there is none."""
    with suppress(MetadataError):
        return str(read_json_object(folder / EVALUATION_FILE, "", noun="report", max_bytes=_MAX_BYTES).get("fieldkit"))
    return ""


def _opened(path: Path) -> sqlite3.Connection:
    try:
        return _connected(path, "rw")  # a killed run's journal can be rolled back by a writer only
    except sqlite3.OperationalError:
        return _connected(path, "ro")


def _connected(path: Path, mode: str) -> sqlite3.Connection:
    """A connection that has read; one that cannot is closed."""
    database = sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, timeout=_TIMEOUT_S)
    try:
        database.execute(_TABLES).close()
    except BaseException:
        database.close()
        raise
    return database


def _holds_visits(database: sqlite3.Connection, path: Path) -> bool:
    """Whether a table is the only place of its rows."""
    application = database.execute("PRAGMA application_id").fetchone()[0]
    version = database.execute("PRAGMA user_version").fetchone()[0]
    if application != APPLICATION_ID:
        raise MetadataError("is not the table of a campaign", path=path, remedy=_REMEDY)
    if not 0 < version <= TABLE_VERSION:
        remedy = "Install a newer fieldkit." if version > TABLE_VERSION else _REMEDY
        raise MetadataError(
            f"has version {version}; this fieldkit reads 1 to {TABLE_VERSION}", path=path, remedy=remedy
        )
    return bool(version < TABLE_VERSION)


@contextmanager
def _errors(path: Path) -> Iterator[None]:
    """SQLite's errors as fieldkit's."""
    try:
        yield
    except sqlite3.OperationalError as error:
        text = str(error)
        if "no such column" in text or "no such table" in text:
            raise MetadataError("is not the table of a campaign", path=path, remedy=_REMEDY) from error
        remedy = "Check its permissions, the space left on the disk, and that no other program holds it open."
        raise StorageError(f"cannot be used: {text}", path=path, remedy=remedy) from error
    except (sqlite3.Error, OverflowError, UnicodeError) as error:
        raise MetadataError(f"is damaged: {error}", path=path, remedy=_REMEDY) from error
