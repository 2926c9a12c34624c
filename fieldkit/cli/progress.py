"""Progress as people see it: bars on a terminal, plain lines in a log, nothing with --json."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from fieldkit.cli.boundary import say
from fieldkit.cli.pace import Pace
from fieldkit.figures.style import format_seconds
from fieldkit.runtime.progress import Advance, Progress, Silent

_LINE_EVERY_S = 10.0


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
        self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None, workers: int = 1
    ) -> Iterator[Advance]:
        """A stage in plain lines."""
        start = shown = time.monotonic()
        pace = Pace(start, total or 0, weights, workers)
        count = 0

        def advance(steps: int) -> None:
            nonlocal count, shown
            count += steps
            now = time.monotonic()
            pace.done(count, now)
            if now - shown >= _LINE_EVERY_S:
                shown = now
                left_s = pace.left_s(now)
                left = "" if left_s is None else f", {format_seconds(left_s)} left"
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
    from rich.text import Text

    console = Console(stderr=True, highlight=False)

    class _Left(progress.ProgressColumn):
        def render(self, task: progress.Task) -> Text:
            left_s = None if task.finished else task.fields["pace"].left_s(time.monotonic())
            return Text("" if left_s is None else f"{format_seconds(left_s)} left")

    columns = (
        progress.TextColumn("{task.description}"),
        progress.BarColumn(bar_width=None),
        progress.MofNCompleteColumn(),
        progress.TimeElapsedColumn(),
        _Left(),
    )
    with progress.Progress(*columns, console=console, refresh_per_second=4, expand=True) as display:

        class Bars:
            @contextmanager
            def stage(
                self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None, workers: int = 1
            ) -> Iterator[Advance]:
                pace = Pace(time.monotonic(), total or 0, weights, workers)
                count = 0

                def advance(steps: int) -> None:
                    nonlocal count
                    count += steps
                    pace.done(count, time.monotonic())
                    display.update(task, completed=count)

                task = display.add_task(name, total=total, pace=pace)
                yield advance
                done = max(1, count if total is None else total)
                display.update(task, total=done, completed=done)

            def note(self, message: str) -> None:
                console.print(f"note: {message}", markup=False)

        yield Bars()
