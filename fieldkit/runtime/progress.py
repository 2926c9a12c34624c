"""Progress of long work. Light: the bars themselves are drawn in fieldkit.cli."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

Advance = Callable[[int], None]


class Progress(Protocol):
    """Receives the stages of a run as they happen."""

    def stage(
        self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None
    ) -> AbstractContextManager[Advance]:
        """A stage of ``total`` steps (None: unknown); the callable it yields advances by n steps.

        Where steps are not alike, ``weights`` (total,) tell the work of each in the order they are done.
        """
        ...

    def note(self, message: str) -> None:
        """A remark for people, such as a photograph that was left out."""
        ...


class Silent:
    """Progress that says nothing."""

    @contextmanager
    def stage(
        self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None
    ) -> Iterator[Advance]:
        """A stage that is not shown."""
        yield ignore

    def note(self, message: str) -> None:
        """Drop the message."""


def ignore(steps: int) -> None:
    """Steps that nobody is told of."""
