"""Progress as people see it: a line that is rewritten on a terminal, lines in a log, nothing with --json."""

from __future__ import annotations

import inspect
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import ParamSpec, TypeVar

from fieldkit.cli.boundary import say
from fieldkit.figures.style import format_seconds
from fieldkit.runtime.context import Context
from fieldkit.runtime.executor import lacks_main_guard
from fieldkit.runtime.machine import usual_workers
from fieldkit.runtime.progress import Advance, Progress, Silent

P = ParamSpec("P")
T = TypeVar("T")

_LINE_EVERY_S = 10.0
"""Time between lines where output is no terminal, seconds."""
_REWRITTEN_EVERY_S = 0.25
"""Time between drawings of the bar, seconds."""
_BAR = 20  # characters
_ERASE = "\r\x1b[K"


@contextmanager
def open_progress(*, as_json: bool) -> Iterator[Progress]:
    """Progress that suits where stderr goes."""
    if as_json:
        yield Silent()
        return
    lines, ended = Lines(rewritten=sys.stderr.isatty()), threading.Event()

    def beat() -> None:
        while not ended.wait(_REWRITTEN_EVERY_S):
            lines.beat()

    beating = threading.Thread(target=beat, daemon=True)
    beating.start()
    try:
        yield lines
    finally:
        ended.set()
        beating.join()
        lines.erase()


def with_usual_context(function: Callable[P, T]) -> Callable[P, T]:
    """A verb that, where no context is given, shows its progress and takes as many workers as it may."""
    signature = inspect.signature(function)
    if "context" not in signature.parameters:
        return function

    @wraps(function)
    def shown(*arguments: P.args, **keywords: P.kwargs) -> T:
        bound = signature.bind(*arguments, **keywords)
        if bound.arguments.get("context") is not None:
            return function(*arguments, **keywords)
        workers = 1 if lacks_main_guard() else usual_workers()
        with open_progress(as_json=False) as progress:
            bound.arguments["context"] = Context.usual(progress=progress, workers=workers)
            return function(*bound.args, **bound.kwargs)

    return shown


class Lines:
    """A line when a stage starts and one with its time at the end; between them how far it is, every ten seconds.

    Args:
        rewritten: on a terminal: how far it is stands in the last line, with a bar, and is always of now.
    """

    def __init__(self, *, rewritten: bool = False) -> None:
        self._rewritten, self._lock = rewritten, threading.Lock()
        begun = self._said = time.monotonic()
        self._stages: list[Callable[[float], str]] = [lambda now: f"working … {format_seconds(now - begun)}"]

    @contextmanager
    def stage(
        self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None
    ) -> Iterator[Advance]:
        """A stage in plain lines."""
        start = end = time.monotonic()
        count, share = 0, 0.0

        def advance(steps: int) -> None:
            nonlocal count, end, share
            count += steps
            done, work = _work(count, total, weights)
            if work and done:
                share, end = done / work, start + (time.monotonic() - start) * work / done

        def state(now: float) -> str:
            filled = round(_BAR * share)
            bar = f" {'█' * filled}{'░' * (_BAR - filled)}" if self._rewritten and total else ""
            steps = f"{count}{f' of {total}' if total else ''}, " if count or total else ""
            time_left = f"{format_seconds(end - now)} left" if end > now else f"{format_seconds(now - start)} so far"
            return f"{name}:{bar} {steps}{time_left}"

        if not self._rewritten:
            self._say(f"{name} …")
        self._stages.append(state)
        try:
            yield advance
        finally:
            self._stages.remove(state)
        self._say(f"{name}: done in {format_seconds(time.monotonic() - start)}")

    def note(self, message: str) -> None:
        """A finding on a line of its own."""
        self._say(f"note: {message}")

    def beat(self) -> None:
        """Say how far the innermost stage is: on a terminal always, else if nothing has been said for ten seconds."""
        now = time.monotonic()
        if self._rewritten:
            with self._lock:
                sys.stderr.write(_ERASE + self._stages[-1](now)[: shutil.get_terminal_size().columns - 1])
                sys.stderr.flush()
        elif now - self._said >= _LINE_EVERY_S - _REWRITTEN_EVERY_S:
            self._say(self._stages[-1](now))

    def erase(self) -> None:
        """Leave the terminal's last line empty."""
        if self._rewritten:
            sys.stderr.write(_ERASE)
            sys.stderr.flush()

    def _say(self, line: str) -> None:
        self._said = time.monotonic()
        with self._lock:
            self.erase()
            say(line)


def _work(count: int, total: int | None, weights: Sequence[float] | None) -> tuple[float, float | None]:
    """The work of ``count`` steps and of all; a step is 1 where steps have no weights."""
    if weights is None or len(weights) != total:
        return count, total
    return sum(weights[:count]), sum(weights)
