"""traits.csv: the traits of every plot and date, a row each; docs/traits.md."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from fieldkit.documents.csv_text import csv_text
from fieldkit.files import write_atomic
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.traits import COLUMNS, REASONS, VALUES, TraitsEntry

TRAITS_FILE = "traits.csv"
TABLE_COLUMNS = ("plot", "date", *COLUMNS)
_DECIMALS = 4

Row = list[object]


def trait_row(plot: str, date: str | None, traits: TraitsEntry | None, error: str = "") -> Row:
    """A row of the table.

    Args:
        plot: its id, as the trial's design has it.
        date: ISO 8601; None where it is not known.
        traits: None where the plot has no result.
        error: why it has none.
    """
    found = (traits or TraitsEntry()).row()
    reasons = found[REASONS] if traits is not None else error
    return [plot, date, *(None if (v := found[name]) is None else round(v, _DECIMALS) for name in VALUES), reasons]


def plot_rows(plots: Iterable[PlotEvaluation]) -> Iterator[Row]:
    """A row for each plot of an evaluation."""
    for plot in plots:
        yield trait_row(plot.name, plot.date, plot.traits, "" if plot.error is None else plot.error.message)


def traits_csv(rows: Iterable[Row]) -> str:
    """The table as text: UTF-8, commas, decimal points, empty cells for missing values."""
    return csv_text(TABLE_COLUMNS, rows)


def write_traits_csv(path: Path, rows: Iterable[Row]) -> None:
    """Write the table.

    Raises:
        StorageError: the place is full or not writable.
    """
    write_atomic(path, traits_csv(rows))
