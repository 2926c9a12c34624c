"""How long a stage still takes, from the pace at which its work is done."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate


class Pace:
    """The steps of a stage as they are done.

    The pace is that of the later half of the time so far: what a cache gives passes at once, and says nothing of the
    rest. Steps that several workers have begun together end together, more or less.

    Args:
        start: seconds on any clock.
        total: steps.
        weights: (total,) work of each step in the order they are done; alike where None.
        workers: steps in work side by side.
    """

    def __init__(self, start: float, total: int, weights: Sequence[float] | None = None, workers: int = 1) -> None:
        self._total, self._workers = total, max(1, workers)
        work = [1.0] * total if weights is None or len(weights) != total else list(weights)
        self._work = [0.0, *accumulate(work)]
        self._start = start
        self._events = [(start, 0.0)]

    def done(self, count: int, now: float) -> None:
        """``count`` steps are done in all."""
        self._events.append((now, self._reached(count)))

    def left_s(self, now: float) -> float | None:
        """Seconds from now on; None as long as nothing tells."""
        end, reached = self._events[-1]
        left = self._work[-1] - reached
        half = self._start + 0.5 * (end - self._start)
        since, before = next(event for event in reversed(self._events[:-1] or self._events) if event[0] <= half)
        if left <= 0 or reached <= before or end <= since:
            return None
        return max(0.0, left * (end - since) / (reached - before) - (now - end))

    def _reached(self, count: int) -> float:
        """Work done after ``count`` steps, with what must be as good as done beside the last one."""
        together = -(-count // self._workers) * self._workers
        return self._work[min(together if together < self._total else count, self._total)]
