"""How figures and tables look: one style for all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import JustifyMethod
    from rich.table import Table


def table(title: str, *columns: str) -> Table:
    """An empty table for the terminal; columns whose name ends in ">" are set flush right."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    result = Table(title=title, box=SIMPLE_HEAD, title_justify="left", title_style="bold", padding=(0, 1, 0, 0))
    for column in columns:
        # Folded where the terminal is narrow: a figure cut off could be read as another.
        justify: JustifyMethod = "right" if column.endswith(">") else "left"
        result.add_column(column.rstrip(">"), justify=justify, overflow="fold")
    return result


def format_length(length: float | None, *, metric: bool = True) -> str:
    """A length for people: ``4.4 mm``, ``0.27 m``, ``12.3 m``; without a metric source, ``0.27 units``."""
    if length is None:
        return "–"
    if not metric:
        return f"{length:.3g} units"
    if abs(length) < 0.0995:
        millimetres = 1000.0 * length
        return f"{millimetres:.2f} mm" if abs(millimetres) < 1 else f"{millimetres:.1f} mm"
    return f"{length:.2f} m" if abs(length) < 10 else f"{length:.1f} m"


def format_number(value: float | None, digits: int = 2) -> str:
    """A number with a fixed count of decimals; a dash for None."""
    return "–" if value is None else f"{value:.{digits}f}"


def format_count(count: int | None) -> str:
    """A count with thousands separated; a dash for None."""
    return "–" if count is None else f"{count:,}"


def format_seconds(seconds: float) -> str:
    """``8.3 s``, ``2:05 min``, ``1:02:05 h``."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d} h" if minutes >= 60 else f"{minutes}:{rest:02d} min"
