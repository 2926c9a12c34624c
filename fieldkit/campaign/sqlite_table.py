"""campaign.sqlite: all visits as one table, for other programs. It is made of the visits' folders and never read."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from fieldkit.campaign.earlier_formats import APPLICATION_ID, TABLE_FILE, TABLE_VERSION
from fieldkit.files import write_atomic
from fieldkit.results.traits import REASONS, VALUES
from fieldkit.results.visit import ROW, Visit


def write_table(campaign: Path, visits: Sequence[Visit]) -> None:
    """Write campaign.sqlite, whole or not at all: a row per visit, keyed by plot and date.

    Raises:
        StorageError: the disk is full or not writable; an older table is left as it was.
    """
    columns = ", ".join(f'"{name}" {_kind(name)}' for name in ROW)
    with closing(sqlite3.connect(":memory:")) as database:
        database.execute(f"CREATE TABLE visits ({columns}, PRIMARY KEY (plot, date))")
        marks = ", ".join("?" * len(ROW))
        database.executemany(f"INSERT INTO visits VALUES ({marks})", [_values(visit) for visit in visits])
        database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        database.execute(f"PRAGMA user_version = {TABLE_VERSION}")
        database.commit()
        write_atomic(campaign / TABLE_FILE, database.serialize())


def _values(visit: Visit) -> list[Any]:
    row = visit.row().values()
    return [json.dumps(v, ensure_ascii=False, sort_keys=True) if isinstance(v, dict | list) else v for v in row]


def _kind(name: str) -> str:
    """SQLite's type for a field."""
    types: dict[Any, str] = {int: "INTEGER NOT NULL", float: "REAL NOT NULL", float | None: "REAL"}
    if name in VALUES:
        return "REAL"
    return "TEXT NOT NULL" if name == REASONS else types.get(Visit.model_fields[name].annotation, "TEXT NOT NULL")
