"""Tables made of rows."""

from fieldkit.figures.content import MOST_ROWS, Column, tabulated
from fieldkit.figures.tables.adherence import station_table
from fieldkit.results.evaluation import AdherenceEntry


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


def test_stations_beyond_the_most_are_counted() -> None:
    for count, said in ((MOST_ROWS, ""), (MOST_ROWS + 3, f" The first {MOST_ROWS} of {MOST_ROWS + 3}.")):
        missing = tuple(f"station {k + 1}" for k in range(count))
        found = AdherenceEntry(
            stations=(), missing=missing, extra=(), horizontal_rms_m=None, yaw_rms_deg=None, pitch_rms_deg=None
        )
        table = station_table(found)
        assert len(table.rows) == MOST_ROWS
        assert table.note == f"Achieved less planned, by the autopilot's own estimate.{said}"
