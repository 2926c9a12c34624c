"""Progress that also keeps what every stage took."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from fieldkit.results.evaluation import StageTime
from fieldkit.runtime.machine import processor_seconds
from fieldkit.runtime.progress import Advance, Progress


class StageTimer:
    """Passes stages on to ``progress`` and measures them; a stage entered again adds up.

    CPU time includes finished worker processes. ``before`` are stages of earlier work on the same.
    """

    def __init__(self, progress: Progress, before: Sequence[StageTime] = ()) -> None:
        self._progress = progress
        self._times = {time.name: time for time in before}

    @contextmanager
    def stage(
        self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None
    ) -> Iterator[Advance]:
        """See `Progress`."""
        wall, cpu = time.perf_counter(), processor_seconds()
        with self._progress.stage(name, total, weights=weights) as advance:
            yield advance
        before = self._times.get(name, StageTime(name=name, wall_s=0.0, cpu_s=0.0, items=0, cached=0))
        self._times[name] = StageTime(
            name=name,
            wall_s=before.wall_s + time.perf_counter() - wall,
            cpu_s=max(before.cpu_s + processor_seconds() - cpu, 0.0),
            items=before.items + (total or 0),
            cached=before.cached,
        )

    def note(self, message: str) -> None:
        """See `Progress`."""
        self._progress.note(message)

    def times(self, cached: dict[str, int]) -> tuple[StageTime, ...]:
        """The stages in the order they were entered; ``cached`` items by stage name."""
        return tuple(
            t.model_copy(update={"cached": min(cached.get(t.name, t.cached), t.items)}) for t in self._times.values()
        )
