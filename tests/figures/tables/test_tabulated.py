"""Tables made of things."""

from __future__ import annotations

from fieldkit.figures.content import Column
from fieldkit.figures.tables.adherence import station_table
from fieldkit.figures.tables.tabulated import MOST_ROWS, tabulated
from fieldkit.results.evaluation import AdherenceEntry


def test_columns_that_say_nothing_are_left_out() -> None:
    columns = (
        (Column("name"), str),
        (Column("never"), lambda _: None),
        (Column("even"), lambda k: "yes" if k % 2 == 0 else None),
    )
    table = tabulated("t", (1, 2), columns, "A note.")
    assert [column.label for column in table.columns] == ["name", "even"]
    assert table.rows == (("1", None), ("2", "yes"))
    assert table.note == "A note."


def test_no_things_give_no_rows_and_all_columns() -> None:
    table = tabulated("t", (), ((Column("name"), str), (Column("never"), lambda _: None)))
    assert (len(table.columns), table.rows, table.note) == (2, (), "")


def test_long_tables_are_cut_and_say_so() -> None:
    table = tabulated("t", range(MOST_ROWS + 1), ((Column("k"), str),))
    assert len(table.rows) == MOST_ROWS
    assert table.note == f"The first {MOST_ROWS} of {MOST_ROWS + 1}."


def test_stations_beyond_the_most_are_counted() -> None:
    for count, said in ((MOST_ROWS, ""), (MOST_ROWS + 3, f" The first {MOST_ROWS} of {MOST_ROWS + 3}.")):
        missing = tuple(f"station {k + 1}" for k in range(count))
        found = AdherenceEntry(
            stations=(), missing=missing, extra=(), horizontal_rms_m=None, yaw_rms_deg=None, pitch_rms_deg=None
        )
        table = station_table(found)
        assert len(table.rows) == MOST_ROWS
        assert table.note == f"Achieved less planned, by the autopilot's own estimate.{said}"
