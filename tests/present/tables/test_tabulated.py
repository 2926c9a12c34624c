"""Tables made of things."""

from __future__ import annotations

from fieldkit.present.content import Column
from fieldkit.present.tables.tabulated import MOST_ROWS, tabulated


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
