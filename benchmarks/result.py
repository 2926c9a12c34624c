"""The result of a study: figures for machines, tables and sentences for people."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

Cell = str | int | float | None


@dataclass(frozen=True)
class ResultTable:
    """A table of a study."""

    title: str
    """Of the table."""
    columns: tuple[str, ...]
    """Names with units; those ending in ">" are set flush right."""
    rows: tuple[tuple[Cell, ...], ...]
    """Cells in the columns' order, as text; None is a dash."""

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError(f"{self.title}: every row needs {len(self.columns)} cells")

    @classmethod
    def of(cls, title: str, found: Sequence[Any]) -> ResultTable:
        """What dataclasses of one kind hold, a row each."""
        rows = [asdict(each) for each in found]
        cells = (tuple(f"{v:.3g}" if isinstance(v, float) else v for v in row.values()) for row in rows)
        return cls(title, tuple(f"{name}>" for name in rows[0]), tuple(cells))

    def markdown(self) -> str:
        """The table in GitHub's Markdown, with its title as a paragraph above."""
        head = "| " + " | ".join(column.rstrip(">") for column in self.columns) + " |"
        rule = "|" + "|".join(" ---: " if column.endswith(">") else " --- " for column in self.columns) + "|"
        body = ["| " + " | ".join(_text(cell) for cell in row) + " |" for row in self.rows]
        return "\n".join([self.title, "", head, rule, *body]) + "\n"


@dataclass(frozen=True)
class StudyResult:
    """The result of a study."""

    name: str
    """As `--only` takes it."""
    title: str
    """In a few words."""
    skipped: str = ""
    """Why nothing was measured; empty if it was."""
    tables: tuple[ResultTable, ...] = ()
    """For people."""
    notes: tuple[str, ...] = ()
    """Sentences about the tables."""
    figures: dict[str, Any] = field(default_factory=dict)
    """Everything measured, plain values."""
    pictures: dict[str, bytes] = field(default_factory=dict)
    """PNG files by name."""
    wall_s: float = 0.0
    cpu_s: float = 0.0
    """Of the whole study."""

    def markdown(self) -> str:
        """A section of Markdown."""
        parts = [f"## {self.title} (`{self.name}`)\n"]
        if self.skipped:
            parts.append(f"Not measured: {self.skipped}\n")
        parts += [table.markdown() for table in self.tables]
        parts += [f"![{name}]({name})\n" for name in self.pictures]
        if self.notes:
            parts.append("\n".join(f"- {note}" for note in self.notes) + "\n")
        return "\n".join(parts)

    def as_dict(self) -> dict[str, Any]:
        """Everything but the pictures' bytes, as JSON takes it."""
        found = asdict(self)
        found["pictures"] = sorted(self.pictures)
        plain: dict[str, Any] = json.loads(json.dumps(found, default=_plain))
        return plain


def spread(values: Sequence[float | None], digits: int = 1) -> str:
    """``median (least–most)``, only ``median`` if all are equal, a dash without values (None, nan)."""
    known = [value for value in values if value is not None and not np.isnan(value)]
    if not known:
        return "–"
    low, middle, high = (f"{v:.{digits}f}" for v in (min(known), float(np.median(known)), max(known)))
    return middle if low == high else f"{middle} ({low}–{high})"


def _text(cell: Cell) -> str:
    if cell is None:
        return "–"
    return f"{cell:.3g}" if isinstance(cell, float) else str(cell)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, bytes):
        return len(value)
    raise TypeError(f"{type(value).__name__} is no plain value")
