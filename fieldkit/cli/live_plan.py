"""What a planning run shows of its evaluations: progress and the best so far; with --json a line for each."""

from __future__ import annotations

import json
import math
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from fieldkit.cli.boundary import say
from fieldkit.figures.style import format_length

if TYPE_CHECKING:
    from fieldkit.planning.run.folder import LogEntry, RunFolder
    from fieldkit.runtime.progress import Advance, Progress


class Watched(ExitStack):
    """Counts a run's evaluations, and knows its search's best."""

    def __init__(self, progress: Progress, *, as_json: bool) -> None:
        super().__init__()
        self._progress, self._as_json = progress, as_json
        self._advance: Advance | None = None
        self._confirming = False

    def expect(self, run: RunFolder, total: int) -> None:
        """The search of a run has this many evaluations, at most, with those that its log holds already."""
        settings = run.settings
        searched = [entry for entry in run.entries if entry.stage == "search"]
        self._plots, self._total, self._done = settings.plots, total, len(searched)
        self._confirmations = settings.finalists * settings.repeats - (len(run.entries) - len(searched))
        self._best_m = min((entry.value_m for entry in searched if entry.measured), default=math.inf)
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
            line: dict[str, Any] = {
                "stage": entry.stage,
                "number": entry.number,
                "origin": entry.origin,
                "value_m": entry.value_m,
                "best_m": None if math.isinf(self._best_m) else self._best_m,
                "done": self._done,
                "of": self._total,
            }
            say(json.dumps(line, ensure_ascii=False))

    def _begin(self, name: str, evaluations: int) -> None:
        self.close()  # the search may have ended before its limit
        self._advance = self.enter_context(self._progress.stage(name, evaluations))
