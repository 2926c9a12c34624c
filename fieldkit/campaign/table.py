"""campaign.sqlite: one row per plot and date.

Journal mode is SQLite's rollback journal with full syncing, not WAL: a campaign has one writer at a time, the table
then is one file that can be copied at any moment, and it needs no shared memory, which network disks do not have. A
process that is killed while it writes leaves a journal, and the next one that opens the table rolls it back.
"""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from fieldkit.campaign.visit import Visit
from fieldkit.errors import MetadataError, StorageError

TABLE_FILE = "campaign.sqlite"
VERSION = 1
_APPLICATION_ID = 0x666B6370  # "fkcp"
_TIMEOUT_S = 30.0
_REMEDY = "Move it away; `fieldkit evaluate` then makes a new one from the folders in visits/."

_COLUMNS = {
    "plot": "TEXT NOT NULL",
    "date": "TEXT NOT NULL",
    "inputs": "TEXT NOT NULL",
    "captures": "TEXT NOT NULL",
    "folder": "TEXT NOT NULL",
    "images": "INTEGER NOT NULL",
    "registered": "INTEGER NOT NULL",
    "right": "INTEGER NOT NULL",
    "pose_rms_m": "REAL",
    "chamfer_m": "REAL",
    "accuracy_m": "REAL",
    "completeness_m": "REAL",
    "f_score": "TEXT NOT NULL",
    "predicted_chamfer_m": "REAL",
    "predicted_low_m": "REAL",
    "predicted_high_m": "REAL",
    "height_m": "REAL",
    "cover": "REAL",
    "hull_m3": "REAL",
    "cpu_s": "REAL NOT NULL",
    "error": "TEXT NOT NULL",
    "notes": "TEXT NOT NULL",
}
_FIELDS = tuple(name for name in _COLUMNS if name != "inputs")
_FLOATS = tuple(name for name, kind in _COLUMNS.items() if kind.startswith("REAL"))
_COUNTS = ("images", "registered", "right")
_NAMES = ", ".join(f'"{name}"' for name in _COLUMNS)


@dataclass(frozen=True)
class Row:
    """A visit and the digest of all its results depend on; "" where it is to be evaluated again."""

    visit: Visit
    inputs: str


class Table:
    """A campaign's table, open.

    Args:
        path: of the file; made where it is missing.

    Raises:
        MetadataError: it is no such table, of a newer version, or damaged.
        StorageError: it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with _errors(path):
            self._database = _connect(path, "rwc")
            try:
                self._prepare()
            except BaseException:
                self._database.close()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._database.close()

    def rows(self) -> list[Row]:
        """All rows, by plot and date.

        Raises:
            MetadataError: a row holds what no fieldkit wrote.
        """
        with _errors(self.path):
            found = self._database.execute(f"SELECT {_NAMES} FROM visits ORDER BY plot, date").fetchall()
        return [_row(values, self.path) for values in found]

    def put(self, row: Row) -> None:
        """Add a row, or replace the one of its plot and date; on disk when this returns."""
        values = visit_values(row.visit) | {"inputs": row.inputs}
        marks = ", ".join("?" * len(_COLUMNS))
        with _errors(self.path), self._database:
            self._database.execute(
                f"INSERT OR REPLACE INTO visits ({_NAMES}) VALUES ({marks})", [values[name] for name in _COLUMNS]
            )

    def _prepare(self) -> None:
        database = self._database
        database.execute("PRAGMA journal_mode = DELETE")
        database.execute("PRAGMA synchronous = FULL")
        if database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            _check(database, self.path)
            return
        columns = ", ".join(f'"{name}" {kind}' for name, kind in _COLUMNS.items())
        with database:
            database.execute("BEGIN IMMEDIATE")
            database.execute(f"CREATE TABLE IF NOT EXISTS visits ({columns}, PRIMARY KEY (plot, date))")
            database.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
            database.execute(f"PRAGMA user_version = {VERSION}")


def read_rows(path: Path) -> list[Row]:
    """The rows of a campaign's table; none where there is no file. Nothing is made or changed.

    Raises:
        MetadataError: it is no such table, of a newer version, or damaged.
    """
    if not path.exists():
        return []
    with _errors(path):
        try:
            database = _connect(path, "rw")  # a killed run's journal can be rolled back by a writer only
            database.execute("SELECT count(*) FROM sqlite_master")
        except sqlite3.OperationalError:
            database = _connect(path, "ro")
        try:
            if not database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
                return []  # killed while it was made
            _check(database, path)
            found = database.execute(f"SELECT {_NAMES} FROM visits ORDER BY plot, date").fetchall()
        finally:
            database.close()
    return [_row(values, path) for values in found]


def visit_values(visit: Visit) -> dict[str, Any]:
    """A visit's fields as plain values; mappings and tuples as JSON text."""
    values = {name: getattr(visit, name) for name in _FIELDS}
    values["f_score"] = json.dumps(dict(visit.f_score), sort_keys=True)
    values["notes"] = json.dumps(list(visit.notes), ensure_ascii=False)
    return values


def visit_of(values: dict[str, Any]) -> Visit:
    """The reverse of `visit_values`.

    Raises:
        ValueError: a value is not of its field's kind.
    """
    fields = {name: values[name] for name in _FIELDS}
    for name in _FLOATS:
        number = fields[name]
        if number is None and name != "cpu_s":
            continue
        if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
            raise ValueError(f"{name} is not a number")
        fields[name] = float(number)
    for name in _COUNTS:
        if not isinstance(fields[name], int) or isinstance(fields[name], bool) or fields[name] < 0:
            raise ValueError(f"{name} is not a count")
    for name in ("plot", "date", "captures", "folder", "error", "f_score", "notes"):
        if not isinstance(fields[name], str):
            raise ValueError(f"{name} is not text")
    date.fromisoformat(fields["date"])
    parts = fields["folder"].split("/")
    if fields["folder"] and (parts[0] != "visits" or ".." in parts or "\0" in fields["folder"]):
        raise ValueError("folder leads out of the campaign's visits")
    try:
        scores, notes = json.loads(fields["f_score"]), json.loads(fields["notes"])
    except RecursionError as error:
        raise ValueError("f_score or notes are not JSON") from error
    if not isinstance(scores, dict) or not all(isinstance(v, int | float) for v in scores.values()):
        raise ValueError("f_score is not a table of numbers")
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise ValueError("notes are not a list of texts")
    fields["f_score"] = {str(key): float(value) for key, value in scores.items()}
    fields["notes"] = tuple(notes)
    return Visit(**fields)


def _row(values: tuple[Any, ...], path: Path) -> Row:
    named = dict(zip(_COLUMNS, values, strict=True))
    try:
        if not isinstance(named["inputs"], str):
            raise ValueError("inputs is not text")
        return Row(visit_of(named), named["inputs"])
    except ValueError as error:
        where = f"the row of {named['plot']!r} on {named['date']!r}"[:200]
        raise MetadataError(f"{where}: {error}", path=path, remedy=_REMEDY) from error


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, timeout=_TIMEOUT_S)


def _check(database: sqlite3.Connection, path: Path) -> None:
    application = database.execute("PRAGMA application_id").fetchone()[0]
    version = database.execute("PRAGMA user_version").fetchone()[0]
    if application != _APPLICATION_ID:
        raise MetadataError("is not the table of a campaign", path=path, remedy=_REMEDY)
    if version != VERSION:
        remedy = "Install a newer fieldkit." if version > VERSION else _REMEDY
        raise MetadataError(f"has version {version}; this fieldkit reads {VERSION}", path=path, remedy=remedy)


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
