"""Tables made of rows."""

from fieldkit.figures.content import MOST_ROWS, Column, tabulated


def test_columns_that_say_nothing_are_left_out() -> None:
    even = Column("even", True)
    rows = [{"name": f"{k}", "never": None, even: "yes" if k % 2 == 0 else None} for k in (1, 2)]
    table = tabulated("t", rows, "A note.")
    assert table.columns == (Column("name"), even)
    assert table.rows == (("1", None), ("2", "yes"))
    assert table.note == "A note."
    assert tabulated("t", []).rows == ()


def test_long_tables_are_cut_and_say_so() -> None:
    table = tabulated("t", [{"k": f"{k}"} for k in range(MOST_ROWS + 1)])
    assert len(table.rows) == MOST_ROWS
    assert table.note == f"The first {MOST_ROWS} of {MOST_ROWS + 1}."
