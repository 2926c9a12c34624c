"""Campaigns of earlier fieldkits: campaign.sqlite of version 1, visit.json of version 1."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.campaign import Visit, read_campaign
from fieldkit.campaign.earlier_formats import read_earlier_table
from fieldkit.campaign.sqlite_table import write_table
from fieldkit.campaign.visit_folders import adopt_earlier_visits, read_visits
from fieldkit.errors import FieldkitError, MetadataError, StorageError
from fieldkit.results.traits import COLUMNS
from fieldkit.results.visit_file import visit_document, visit_of_document
from tests.campaign.examples import campaign_folder, field

_COLUMNS = """
    plot TEXT NOT NULL, date TEXT NOT NULL, inputs TEXT NOT NULL, captures TEXT NOT NULL, folder TEXT NOT NULL,
    images INTEGER NOT NULL, registered INTEGER NOT NULL, "right" INTEGER NOT NULL, pose_rms_m REAL, chamfer_m REAL,
    accuracy_m REAL, completeness_m REAL, f_score TEXT NOT NULL, predicted_chamfer_m REAL, predicted_low_m REAL,
    predicted_high_m REAL, height_m REAL, cover REAL, hull_m3 REAL, cpu_s REAL NOT NULL, error TEXT NOT NULL,
    notes TEXT NOT NULL
"""
FULL = Visit(
    plot="r1c1", date="2026-06-18", captures="flights/1", folder="visits/r1c1/2026-06-18", images=13, registered=12,
    right=11, pose_rms_m=0.02, chamfer_m=0.011, accuracy_m=0.006, completeness_m=0.005, f_score={"0.010": 0.9},
    predicted_chamfer_m=0.012, predicted_low_m=0.01, predicted_high_m=0.015,
    cpu_s=20.5, error="", notes=("one", "two ü"), inputs="abc",
)  # fmt: skip
FAILED = Visit(plot="r1c1", date="2026-06-25", error="it’s <b>broken</b>")
FIELD = field(1, 2)


def earlier_row(visit: Visit) -> dict[str, Any]:
    """The columns of a visit in an earlier table."""
    row = {name: value for name, value in visit.row().items() if name not in ("fieldkit", "doubts", *COLUMNS)}
    row |= {"height_m": 0.7, "cover": 0.2, "hull_m3": 0.3}  # by earlier definitions: they are not taken over
    return row | {"f_score": json.dumps(visit.f_score), "notes": json.dumps(visit.notes), "inputs": visit.inputs}


def write_earlier_table(campaign: Path, *visits: Visit, changed: dict[str, Any] | None = None) -> Path:
    """A campaign.sqlite as fieldkit wrote it when that was where visits were kept."""
    file = campaign / "campaign.sqlite"
    with closing(sqlite3.connect(file)) as database:
        database.execute(f"CREATE TABLE IF NOT EXISTS visits ({_COLUMNS}, PRIMARY KEY (plot, date))")
        for visit in visits:
            row = earlier_row(visit) | (changed or {})
            names = ", ".join(f'"{name}"' for name in row)
            marks = ", ".join("?" * len(row))
            database.execute(f"INSERT INTO visits ({names}) VALUES ({marks})", list(row.values()))
        database.execute("PRAGMA application_id = 0x666B6370")
        database.execute("PRAGMA user_version = 1")
        database.commit()
    return file


def write_earlier_visit(campaign: Path, visit: Visit, fieldkit: str = "0.0.9") -> Path:
    """A visit's folder as an earlier fieldkit left it."""
    place = campaign / "visits" / visit.plot / visit.date
    place.mkdir(parents=True)
    row = {name: value for name, value in earlier_row(visit).items() if name != "inputs"}
    document = {"kind": "visit", "version": 1, "inputs": visit.inputs, "visit": row, "photographs": {"ab": "a.jpg"}}
    (place / "visit.json").write_text(json.dumps(document))
    (place / "evaluation.json").write_text(json.dumps({"fieldkit": fieldkit}))
    return place


def test_a_campaign_of_an_earlier_fieldkit_goes_on_without_losing_a_row(tmp_path: Path) -> None:
    folder = campaign_folder(tmp_path, FIELD)
    lost = FULL.model_copy(update={"plot": "r1c2", "folder": "visits/r1c2/2026-06-18"})  # killed before its row came
    died = FAILED.model_copy(update={"plot": "gone"})
    write_earlier_visit(folder, FULL)
    write_earlier_visit(folder, lost)
    file = write_earlier_table(folder, FULL, FAILED, died)
    before = file.read_bytes()
    expected = {
        FULL.key: FULL.model_copy(update={"fieldkit": "0.0.9", "photographs": {"ab": "a.jpg"}}),
        lost.key: lost.model_copy(update={"fieldkit": "0.0.9", "photographs": {"ab": "a.jpg"}}),
        FAILED.key: FAILED,
        died.key: died,
    }
    shown = read_campaign(folder).visits
    assert {visit.key: visit for visit in shown} == expected
    assert file.read_bytes() == before  # reading changes nothing
    assert adopt_earlier_visits(folder)
    assert read_campaign(folder).visits == shown  # killed here, the table and the folders say the same
    write_table(folder, shown)
    assert read_campaign(folder).visits == shown
    file.unlink()
    assert read_campaign(folder).visits == shown
    for visit in shown:
        its = folder / "visits" / visit.plot / visit.date
        assert visit_of_document(visit_document(its), its) == visit


def test_which_of_a_row_and_its_folder_is_newer(tmp_path: Path) -> None:
    """A folder is written before its row; a try that came to nothing leaves a row without inputs, and the folder."""
    folder = campaign_folder(tmp_path, FIELD)
    newer = FULL.model_copy(update={"inputs": "later", "chamfer_m": 0.5})
    write_earlier_visit(folder, newer)
    file = write_earlier_table(folder, FULL)
    assert [visit.chamfer_m for visit in read_visits(folder)] == [0.5]
    file.unlink()
    write_earlier_table(folder, FAILED.model_copy(update={"date": FULL.date}))
    (visit,) = read_visits(folder)
    assert (visit.error, visit.photographs) == (FAILED.error, {"ab": "a.jpg"})


def test_a_row_whose_folder_is_taken_stays_in_the_table(tmp_path: Path) -> None:
    folder = campaign_folder(tmp_path, FIELD)
    taken = folder / "visits" / FAILED.plot / FAILED.date
    taken.mkdir(parents=True)
    (taken / "thesis.txt").write_text("mine")
    write_earlier_table(folder, FAILED)
    assert not adopt_earlier_visits(folder)
    assert read_visits(folder) == [FAILED]
    assert [path.name for path in taken.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize(
    "change",
    [
        {"date": "soon"}, {"chamfer_m": float("inf")}, {"chamfer_m": "x"}, {"images": -1}, {"images": 1.5},
        {"folder": "/etc"}, {"folder": "visits/../../etc"}, {"notes": "[1]"}, {"f_score": "[["}, {"cpu_s": "x"},
        {"notes": "[" * 100_000}, {"inputs": b"x"}, {"notes": "1"}, {"f_score": "[]"},
    ],
)  # fmt: skip
def test_rows_that_nobody_wrote(change: dict[str, object], tmp_path: Path) -> None:
    file = write_earlier_table(tmp_path, FULL, changed={"plot": "<b>", **change})
    with pytest.raises(MetadataError, match="the row of '<b>' on '") as caught:
        read_earlier_table(tmp_path)
    assert caught.value.path == file
    assert caught.value.remedy


def test_records_that_nobody_wrote_are_passed_over(tmp_path: Path) -> None:
    place = write_earlier_visit(tmp_path, FULL)
    intact = json.loads((place / "visit.json").read_text())
    for change in ({"visit": 1}, {"visit": {}}, {"photographs": {"ab": 1}}, {"photographs": {"ab": "\0"}}):
        (place / "visit.json").write_text(json.dumps(intact | change))
        assert read_visits(tmp_path) == []


@pytest.mark.parametrize("content", [b"", b"SQLite format 3\0", b"nonsense" * 200, "truncated", "other", "newer"])
def test_other_files(content: bytes | str, tmp_path: Path) -> None:
    file = tmp_path / "campaign.sqlite"
    if isinstance(content, bytes):
        file.write_bytes(content)
    else:
        write_earlier_table(tmp_path, FULL)
        if content == "truncated":
            file.write_bytes(file.read_bytes()[:5000])
        else:
            with sqlite3.connect(file) as database:
                database.execute(f"PRAGMA {'user_version = 9' if content == 'newer' else 'application_id = 1'}")
            database.close()
    if content == b"":
        assert read_earlier_table(tmp_path) == []  # killed while it was made
        return
    with pytest.raises((MetadataError, StorageError)) as caught:
        read_earlier_table(tmp_path)
    assert caught.value.path == file
    assert caught.value.exit_code == 3
    assert caught.value.remedy


def test_damaged_files_are_rows_or_errors(tmp_path: Path) -> None:
    whole = write_earlier_table(tmp_path, *(FULL.model_copy(update={"plot": f"p{k}"}) for k in range(20)))
    intact = whole.read_bytes()
    folder = tmp_path / "damaged"
    folder.mkdir()

    @settings(max_examples=100)
    @given(st.lists(st.tuples(st.integers(0, 20_000), st.binary(min_size=1, max_size=4)), min_size=1, max_size=6))
    def check(damage: list[tuple[int, bytes]]) -> None:
        data = bytearray(intact)
        for place, wrong in damage:
            data[place % len(data) : place % len(data) + len(wrong)] = wrong
        (folder / "campaign.sqlite").write_bytes(data)
        with suppress(FieldkitError):
            assert all(isinstance(row, Visit) for row in read_earlier_table(folder))

    check()
