"""CSV text: commas, decimal points, newlines, empty cells for missing values."""

from __future__ import annotations

import csv
import io
import math
import unicodedata
from collections.abc import Iterable, Sequence

_WRITTEN_OUT = ("Cc", "Cf", "Cs", "Zl", "Zp")
_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")


def csv_text(columns: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """A header and rows of values as text; see `csv_cell`."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([csv_cell(name) for name in columns])
    writer.writerows([csv_cell(value) for value in row] for row in rows)
    return text.getvalue()


def finite_numbers(text: str) -> tuple[float, ...]:
    """Numbers with commas between; none where any part of the text is no number."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return numbers if all(map(math.isfinite, numbers)) else ()


def on_one_line(text: str) -> str:
    r"""Text whose controls, direction marks and bytes that are no UTF-8 are written out, as ``\n`` and ``\u202e``.

    So no name breaks a row, for readers by lines as well, and none turns about what stands beside it.
    """
    return "".join(c.encode("unicode_escape").decode() if unicodedata.category(c) in _WRITTEN_OUT else c for c in text)


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
            return f"'{on_one_line(value)}" if value.startswith(_FORMULA_STARTS) else on_one_line(value)
        case _:
            return str(value)
