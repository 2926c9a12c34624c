"""Progress as people see it: Rich's bars on a terminal, plain lines in a log, nothing with --json."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from fieldkit.cli.boundary import say
from fieldkit.figures.style import format_seconds
from fieldkit.runtime.progress import Advance, Progress, Silent

_LINE_EVERY_S = 10.0
_PACE_OVER_S = 600.0
"""The time left goes by the steps of so many last seconds: one step may take minutes."""


@contextmanager
def open_progress(*, as_json: bool) -> Iterator[Progress]:
    """Progress that suits where stderr goes."""
    if as_json:
        yield Silent()
    elif sys.stderr.isatty():
        with _bars() as bars:
            yield bars
    else:
        yield Lines()


class Lines:
    """A line when a stage starts, at most one every ten seconds meanwhile, and one with its time at the end."""

    @contextmanager
    def stage(
        self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None
    ) -> Iterator[Advance]:
        """A stage in plain lines."""
        start = shown = time.monotonic()
        count = 0

        def advance(steps: int) -> None:
            nonlocal count, shown
            count += steps
            now = time.monotonic()
            if now - shown >= _LINE_EVERY_S:
                shown = now
                done, work = _work(count, total, weights)
                left = f", {format_seconds((now - start) * (work / done - 1.0))} left" if work and done else ""
                say(f"{name}: {count}{f' of {total}' if total else ''}{left}")

        say(f"{name} …")
        yield advance
        say(f"{name}: done in {format_seconds(time.monotonic() - start)}")

    def note(self, message: str) -> None:
        """A finding on a line of its own."""
        say(f"note: {message}")


@contextmanager
def _bars() -> Iterator[Progress]:
    from rich import progress
    from rich.console import Console

    console = Console(stderr=True, highlight=False)
    columns = (
        progress.TextColumn("{task.description}"),
        progress.BarColumn(bar_width=None),
        progress.TextColumn("{task.fields[steps]}"),
        progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
    )
    with progress.Progress(
        *columns, console=console, refresh_per_second=4, expand=True, speed_estimate_period=_PACE_OVER_S
    ) as display:

        class Bars:
            @contextmanager
            def stage(
                self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None
            ) -> Iterator[Advance]:
                count = 0

                def advance(steps: int) -> None:
                    nonlocal count
                    count += steps
                    display.update(task, completed=_work(count, total, weights)[0], steps=f"{count}/{total or '?'}")

                whole = _work(0, total, weights)[1]
                task = display.add_task(name, total=whole, steps=f"0/{total or '?'}")
                yield advance
                display.update(task, total=whole or 1, completed=whole or 1)

            def note(self, message: str) -> None:
                console.print(f"note: {message}", markup=False)

        yield Bars()


def _work(count: int, total: int | None, weights: Sequence[float] | None) -> tuple[float, float | None]:
    """The work of ``count`` steps and of all; a step is 1 where steps have no weights."""
    if weights is None or len(weights) != total:
        return count, total
    return sum(weights[:count]), sum(weights)
