"""campaign.sqlite."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
import textwrap
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.campaign.table import Row, Table, read_rows, visit_of, visit_values
from fieldkit.campaign.visit import Visit
from fieldkit.errors import FieldkitError, MetadataError, StorageError

FULL = Visit(
    "r1c1", "2026-06-18", captures="flights/1", folder="visits/r1c1/2026-06-18", images=13, registered=12, right=11,
    pose_rms_m=0.02, chamfer_m=0.011, accuracy_m=0.006, completeness_m=0.005, f_score={"0.010": 0.9},
    predicted_chamfer_m=0.012, predicted_low_m=0.01, predicted_high_m=0.015, height_m=0.7, cover=0.2, hull_m3=0.3,
    cpu_s=20.5, error="", notes=("one", "two ü"),
)  # fmt: skip


def test_rows_come_back_and_replace_each_other(tmp_path: Path) -> None:
    file = tmp_path / "campaign.sqlite"
    assert read_rows(file) == []
    assert not file.exists()
    failed = Visit("r1c1", "2026-06-25", error="it’s <b>broken</b>")
    with Table(file) as table:
        table.put(Row(FULL, "abc"))
        table.put(Row(failed, ""))
        assert table.rows() == [Row(FULL, "abc"), Row(failed, "")]
        table.put(Row(failed, "later"))
    assert read_rows(file) == [Row(FULL, "abc"), Row(failed, "later")]
    assert [path.name for path in tmp_path.iterdir()] == ["campaign.sqlite"]  # one file, to be copied at any time


@given(st.text(max_size=20), st.floats(allow_nan=False, allow_infinity=False), st.lists(st.text(max_size=9)))
def test_values_round_trip(text: str, number: float, notes: list[str]) -> None:
    visit = Visit("p", "2026-01-01", captures=text, height_m=number, notes=tuple(notes), f_score={"0.010": 0.5})
    assert visit_of(visit_values(visit)) == visit


@pytest.mark.parametrize(
    "change",
    [
        {"date": "soon"}, {"chamfer_m": float("nan")}, {"chamfer_m": "x"}, {"images": -1}, {"images": 1.5},
        {"folder": "/etc"}, {"folder": "visits/../../etc"}, {"notes": "[1]"}, {"f_score": "[["}, {"plot": 7},
        {"cpu_s": None}, {"notes": "[" * 100_000},
    ],
)  # fmt: skip
def test_values_that_nobody_wrote(change: dict[str, object]) -> None:
    with pytest.raises(ValueError):
        visit_of(visit_values(FULL) | change)


def test_rows_that_nobody_wrote(tmp_path: Path) -> None:
    file = tmp_path / "campaign.sqlite"
    with Table(file) as table:
        table.put(Row(FULL, "abc"))
    with sqlite3.connect(file) as database:
        database.execute("UPDATE visits SET chamfer_m = 'far', plot = '<b>'")
    database.close()
    with pytest.raises(MetadataError, match="the row of '<b>' on '2026-06-18': chamfer_m is not a number") as caught:
        read_rows(file)
    assert caught.value.path == file
    assert caught.value.remedy


@pytest.mark.parametrize("content", [b"", b"SQLite format 3\0", b"nonsense" * 200, "truncated", "other", "newer"])
def test_other_files(content: bytes | str, tmp_path: Path) -> None:
    file = tmp_path / "campaign.sqlite"
    if isinstance(content, bytes):
        file.write_bytes(content)
    else:
        with Table(file) as table:
            table.put(Row(FULL, "abc"))
        if content == "truncated":
            file.write_bytes(file.read_bytes()[:5000])
        else:
            with sqlite3.connect(file) as database:
                database.execute(f"PRAGMA {'user_version = 9' if content == 'newer' else 'application_id = 1'}")
            database.close()
    if content == b"":
        assert read_rows(file) == []  # killed while it was made
        with Table(file) as table:
            table.put(Row(FULL, "abc"))
        assert len(read_rows(file)) == 1
        return
    for use in (read_rows, Table):
        with pytest.raises((MetadataError, StorageError)) as caught:
            use(file)
        assert caught.value.path == file
        assert caught.value.exit_code == 3
        assert caught.value.remedy


def test_damaged_files_are_rows_or_errors(tmp_path: Path) -> None:
    whole = tmp_path / "campaign.sqlite"
    with Table(whole) as table:
        for k in range(20):
            table.put(Row(replace(FULL, plot=f"p{k}"), "abc"))
    intact = whole.read_bytes()
    damaged = tmp_path / "damaged.sqlite"

    @settings(max_examples=100)
    @given(st.lists(st.tuples(st.integers(0, 20_000), st.binary(min_size=1, max_size=4)), min_size=1, max_size=6))
    def check(damage: list[tuple[int, bytes]]) -> None:
        data = bytearray(intact)
        for place, wrong in damage:
            data[place % len(data) : place % len(data) + len(wrong)] = wrong
        damaged.write_bytes(data)
        with suppress(FieldkitError):
            assert all(isinstance(row, Row) for row in read_rows(damaged))

    check()


def test_a_place_that_cannot_be_written(unwritable: Path) -> None:
    with pytest.raises(StorageError):
        Table(unwritable / "campaign.sqlite")


@pytest.mark.slow
def test_killed_while_writing(tmp_path: Path) -> None:
    """Whatever was put before the kill is there, and the table can be written to."""
    script = textwrap.dedent("""
        import sys
        from pathlib import Path
        from fieldkit.campaign.table import Row, Table
        from fieldkit.campaign.visit import Visit
        with Table(Path(sys.argv[1])) as table:
            for k in range(100_000):
                plot = f"{sys.argv[2]}-{k % 50}"
                table.put(Row(Visit(plot, "2026-01-01", captures="x" * 2000, images=k), str(k)))
                print(k, flush=True)
    """)
    file = tmp_path / "campaign.sqlite"
    for seconds in (0.1, 0.3, 0.2):
        command = [sys.executable, "-c", script, str(file), str(seconds)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        said = process.stdout.readline()
        try:
            process.wait(seconds)
        except subprocess.TimeoutExpired:
            process.kill()
        said += process.stdout.read()
        process.wait()
        process.stdout.close()
        last = int(said.split()[-1])
        newest = max(int(row.inputs) for row in read_rows(file) if row.visit.plot.startswith(f"{seconds}-"))
        assert newest in (last, last + 1)
