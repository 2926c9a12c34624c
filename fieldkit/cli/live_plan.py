"""What a planning run shows of its evaluations: progress and the best so far; with --json a line for each."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from fieldkit.cli.boundary import say
from fieldkit.figures.style import format_length

if TYPE_CHECKING:
    from fieldkit.planning.run.folder import LogEntry
    from fieldkit.planning.settings import SearchSettings
    from fieldkit.runtime.progress import Advance, Progress


@contextmanager
def open_watch(
    settings: SearchSettings, before: Sequence[LogEntry], progress: Progress, *, as_json: bool
) -> Iterator[tuple[Callable[[LogEntry], None], Callable[[int], None]]]:
    """What is told of every evaluation of a run, and of the number that its search can have.

    Args:
        before: what its log holds already.
    """
    with ExitStack() as stages:
        watched = _Watched(settings, before, progress, stages, as_json=as_json)
        yield watched.watch, watched.expect


class _Watched:
    """Counts evaluations, and knows the search's best."""

    def __init__(
        self, settings: SearchSettings, before: Sequence[LogEntry], progress: Progress, stages: ExitStack, *,
        as_json: bool,
    ) -> None:  # fmt: skip
        searched = [entry for entry in before if entry.stage == "search"]
        self._progress, self._stages, self._as_json = progress, stages, as_json
        self._plots, self._total, self._done = settings.plots, settings.evaluations, len(searched)
        self._confirmations = settings.finalists * settings.repeats - (len(before) - len(searched))
        self._best_m = min((entry.value_m for entry in searched if entry.measured), default=math.inf)
        self._advance: Advance | None = None
        self._confirming = False

    def expect(self, total: int) -> None:
        """The search has this many evaluations, at most."""
        self._total = total
        if total > self._done:
            self._begin(f"Searching, at most {total} evaluations", total - self._done)

    def watch(self, entry: LogEntry) -> None:
        """An evaluation has finished."""
        if entry.stage == "confirmation" and not self._confirming:
            self._confirming = True
            self._begin("Confirming", max(self._confirmations, 1))
        if self._advance is not None:
            self._advance(1)
        if entry.stage == "search":
            self._done += 1
            if entry.measured and entry.value_m < self._best_m:
                self._best_m = entry.value_m
                on = f" on plot {entry.plot}" if self._plots > 1 else ""
                self._progress.note(f"best so far{on}: {format_length(entry.value_m)} ({entry.origin})")
        if self._as_json:
            told: dict[str, Any] = {
                "stage": entry.stage, "number": entry.number, "origin": entry.origin, "value_m": entry.value_m,
                "best_m": None if math.isinf(self._best_m) else self._best_m, "done": self._done, "of": self._total,
            }  # fmt: skip
            say(json.dumps(told, ensure_ascii=False))

    def _begin(self, name: str, evaluations: int) -> None:
        self._stages.close()  # the search may have ended before its limit
        self._advance = self._stages.enter_context(self._progress.stage(name, evaluations))
