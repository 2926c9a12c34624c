"""Tables with one row per thing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from fieldkit.figures.content import Cell, Column, Table

MOST_ROWS = 400
"""Largest number of rows of a table; files hold all."""

_Thing = TypeVar("_Thing")


def tabulated(
    caption: str, things: Sequence[_Thing], columns: Iterable[tuple[Column, Callable[[_Thing], Cell]]], note: str = ""
) -> Table:
    """A row for each of the first things; empty columns are left out.

    Args:
        caption: above it.
        things: of the rows; beyond `MOST_ROWS` a note gives their number.
        columns: each with the function that gives its cell.
        note: below it.
    """
    shown = things[:MOST_ROWS]
    filled = [(column, [cell(thing) for thing in shown]) for column, cell in columns]
    kept = [(column, cells) for column, cells in filled if not shown or any(cell is not None for cell in cells)]
    rows = tuple(zip(*(cells for _, cells in kept), strict=True))
    return Table(caption, tuple(column for column, _ in kept), rows, f"{note} {cut_note(len(things))}".strip())


def cut_note(rows: int) -> str:
    """That a table shows the first of so many rows only; empty where it has them all."""
    return f"The first {MOST_ROWS} of {rows}." if rows > MOST_ROWS else ""
