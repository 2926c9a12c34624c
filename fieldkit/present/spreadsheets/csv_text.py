"""CSV text: commas, decimal points, newlines, empty cells for missing values."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")


def csv_text(columns: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """A header and rows of values as text; see `csv_cell`."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([csv_cell(value) for value in row] for row in rows)
    return text.getvalue()


def csv_cell(value: object) -> str:
    """A value as a cell's text; a text that a spreadsheet would take for a formula gets a leading quote."""
    match value:
        case None:
            return ""
        case bool():
            return "true" if value else "false"
        case float():
            return repr(value)
        case str():
            # A spreadsheet would run a name such as "=HYPERLINK(…)"; the quote makes it text.
            return f"'{value}" if value.startswith(_FORMULA_STARTS) else value
        case _:
            return str(value)
