"""What a planning run shows while it goes on: a live view on a terminal, lines in a log, JSON lines for machines."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fieldkit.cli.boundary import say
from fieldkit.figures.style import format_length, format_seconds
from fieldkit.planning.objective.source import FIDELITIES
from fieldkit.planning.run.folder import LogEntry
from fieldkit.planning.run.outcome import best_so_far, weights_of
from fieldkit.planning.settings import SearchSettings
from fieldkit.wording import count

if TYPE_CHECKING:
    from rich.console import RenderableType

_BARS = "▁▂▃▄▅▆▇█"
_LINE_EVERY_S = 10.0
_WIDTH = 48


@dataclass
class Status:
    """What has come of a run so far."""

    total: int
    """Evaluations of the search, at most."""
    confirmations: int
    """At most, to come after it."""
    entries: list[LogEntry] = field(default_factory=list)
    """Finished."""
    weight: float = 1.0
    """What a confirmation takes, in evaluations of the search."""
    told: float = field(default_factory=time.monotonic)
    """When the last one was, on the monotonic clock, seconds."""

    def expect(self, total: int) -> None:
        """The search has this many evaluations, at most."""
        self.total = total

    def add(self, entry: LogEntry) -> None:
        """An evaluation has finished."""
        self.entries.append(entry)
        self.told = time.monotonic()

    @property
    def done(self) -> int:
        """Evaluations of the search that are done."""
        return sum(entry.stage == "search" for entry in self.entries)

    @property
    def confirmed(self) -> int:
        return len(self.entries) - self.done

    @property
    def best(self) -> LogEntry | None:
        """The search's best."""
        measured = [entry for entry in self.entries if entry.stage == "search" and entry.measured]
        return min(measured, key=lambda entry: entry.value_m, default=None)

    @property
    def best_text(self) -> str:
        """Its value and where it comes from; of several plots also which it was on, for some are easier than others."""
        best = self.best
        if best is None:
            return ""
        on = f", on plot {best.plot}" if len({entry.plot for entry in self.entries}) > 1 else ""
        return f"{format_length(best.value_m)} ({best.origin}{on})"

    @property
    def per_minute(self) -> float:
        """Evaluations, over the whole run so far."""
        seconds = max((entry.finished_s for entry in self.entries), default=0.0)
        return 60.0 * len(self.entries) / seconds if seconds > 0 else 0.0

    @property
    def seconds_left(self) -> float | None:
        """At most, from the last evaluation on, by the pace so far; None before the first one."""
        seconds = max((entry.finished_s for entry in self.entries), default=0.0)
        work = self.done + self.weight * self.confirmed
        searched = self.done if self.confirmed else self.total
        left = searched + self.weight * self.confirmations - work
        return seconds * left / work if work and left > 0 else None

    def line(self) -> str:
        """One line for a log."""
        left = self.seconds_left
        if self.confirmed:
            ending = "" if left is None else f", {format_seconds(left)} left"
            return f"confirming: {self.confirmed} of {self.confirmations}{ending}"
        parts = [f"{self.done} of at most {self.total}"]
        if self.best_text:
            parts.append(f"best {self.best_text}")
        if left is not None:
            after = f" with {count(self.confirmations, 'confirmation')}" if self.confirmations else ""
            parts.append(f"{self.per_minute:.1f} a minute, at most {format_seconds(left)} left{after}")
        return ", ".join(parts)

    def curve(self, width: int = _WIDTH) -> str:
        """The best so far as a sparkline, from the first values down."""
        measured = [entry for entry in self.entries if entry.stage == "search" and entry.measured]
        low = best_so_far(sorted(measured, key=lambda entry: entry.number))
        return sparkline([best for best in low if best is not None], width)


def sparkline(values: Sequence[float], width: int) -> str:
    """Values as at most ``width`` bars; the last of each group counts, the lowest value has the lowest bar."""
    if not values:
        return ""
    count = min(width, len(values))
    shown = [values[(k + 1) * len(values) // count - 1] for k in range(count)]
    low, high = min(shown), max(shown)
    scale = (len(_BARS) - 1) / (high - low) if high > low else 0.0
    return "".join(_BARS[round((value - low) * scale)] for value in shown)


@contextmanager
def open_watch(
    settings: SearchSettings, before: Sequence[LogEntry], *, as_json: bool
) -> Iterator[tuple[Callable[[LogEntry], None], Callable[[int], None]]]:
    """What is told of every evaluation of a run and of their number, in the way that suits where stderr goes.

    Args:
        settings: of the run.
        before: what its log holds already.
        as_json: write a JSON object per evaluation, a line each, to stderr.
    """
    confirmed, searched = (FIDELITIES[name].drawn_side for name in (settings.confirm_fidelity, settings.fidelity))
    weight = (confirmed / searched) ** 2
    status = Status(settings.evaluations, settings.finalists * settings.repeats, list(before), weight)
    if as_json:
        yield _json_lines(status), status.expect
    elif sys.stderr.isatty():
        with _live(status, settings) as watch:
            yield watch, status.expect
    else:
        yield _lines(status), status.expect


def _json_lines(status: Status) -> Callable[[LogEntry], None]:
    def watch(entry: LogEntry) -> None:
        status.add(entry)
        best = status.best
        told: dict[str, Any] = {
            "stage": entry.stage, "number": entry.number, "origin": entry.origin, "value_m": entry.value_m,
            "best_m": None if best is None else best.value_m, "done": status.done, "of": status.total,
        }  # fmt: skip
        say(json.dumps(told, ensure_ascii=False))

    return watch


def _lines(status: Status) -> Callable[[LogEntry], None]:
    shown = [time.monotonic()]

    def watch(entry: LogEntry) -> None:
        status.add(entry)
        now = time.monotonic()
        if now - shown[0] >= _LINE_EVERY_S or status.done == status.total:
            shown[0] = now
            say(status.line())

    return watch


@contextmanager
def _live(status: Status, settings: SearchSettings) -> Iterator[Callable[[LogEntry], None]]:
    from rich.console import Console
    from rich.live import Live

    class View:
        def __rich__(self) -> RenderableType:
            return _picture(status, settings)

    view = View()
    with Live(view, console=Console(stderr=True, highlight=False), refresh_per_second=2):

        def watch(entry: LogEntry) -> None:
            status.add(entry)

        yield watch


def _picture(status: Status, settings: SearchSettings) -> RenderableType:
    from rich.panel import Panel
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    rows = Table.grid(padding=(0, 2))
    rows.add_column(style="dim")
    rows.add_column()
    left = status.seconds_left
    if left is not None:
        left = max(0.0, left - (time.monotonic() - status.told))
    if status.total:
        rows.add_row(
            "evaluations", ProgressBar(total=status.total, completed=status.done, width=_WIDTH, finished_style="green")
        )
        rows.add_row("", f"{status.done} of at most {status.total}, {status.per_minute:.1f} a minute")
    if status.confirmed:
        rows.add_row("confirming", f"{status.confirmed} of {status.confirmations}")
    if status.best_text:
        rows.add_row("best so far", Text(status.best_text))
        rows.add_row("", Text(status.curve(), style="cyan"))
    weights = next((found for entry in reversed(status.entries) if (found := weights_of(entry))), {})
    if weights:
        rows.add_row("models", "  ".join(f"{name} {weight:.2f}" for name, weight in weights.items()))
    rows.add_row("time left", "–" if left is None else f"at most {format_seconds(left)}")
    like = "" if settings.plots == 1 else f"{settings.plots} plots like "
    title = f"{settings.method}: {settings.cameras} cameras on {like}{settings.source.name}"
    return Panel(rows, title=Text(title), title_align="left", expand=False)
