"""The inside of a worker process: a function, made once, that answers tasks until its pool closes the connection."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Generic, TypeVar

from fieldkit.errors import FieldkitError
from fieldkit.runtime.threads import limit_threads

Task = TypeVar("Task")
Result = TypeVar("Result")
_ORPHANED = 3


class WorkerError(FieldkitError):
    """A worker process died."""


@dataclass(frozen=True)
class Outcome(Generic[Result]):
    """The outcome of a task.

    Attributes:
        result: of the function.
        error: that it raised instead.
        death: how the process ended without either, in words.
        warned: fieldkit's warnings that the function gave; the pool gives them in the caller's process.
    """

    result: Result | None = None
    error: Exception | None = None
    death: str = ""
    warned: tuple[Warning, ...] = ()

    @property
    def failure(self) -> str:
        """Why there is no result, in words; empty if there is one."""
        return self.death if self.error is None else f"{type(self.error).__name__}: {self.error}"

    def get(self) -> Result:
        """The result.

        Raises:
            Exception: what the function raised.
            WorkerError: its process died.
        """
        if self.error is not None:
            raise self.error
        if self.death:
            raise WorkerError(
                f"a worker process died: {self.death}", remedy="Give it more memory, or take fewer --workers."
            )
        return self.result  # type: ignore[return-value]


def work(connection: Connection, make: Callable[[], Callable[[Task], Result]]) -> None:
    """Make the function and send an empty outcome, then answer tasks until the connection closes.

    Args:
        connection: receives tasks, sends outcomes.
        make: gives the function. An exception of it is sent as the last outcome.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # held back so far by `worker_pool`
    threading.Thread(target=_watch, daemon=True).start()
    with suppress(OSError):
        # If memory runs out, the kernel should kill this process and not the one with the results.
        Path("/proc/self/oom_score_adj").write_bytes(b"1000")
    os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa's software renderer draws on this thread, too; same pixels
    limit_threads(1)
    with suppress(EOFError, OSError):
        try:
            function = make()
        except Exception as error:
            connection.send_bytes(_failed(error))
            return
        connection.send(Outcome())
        while True:
            connection.send_bytes(_answered(function, connection.recv()))


def _answered(function: Callable[[Task], Result], task: Task) -> bytes:
    """The pickled outcome of a task, whether it returns or raises."""
    try:
        with warnings.catch_warnings(record=True) as given:
            result = function(task)
        own = (each.message for each in given if each.category.__module__.startswith("fieldkit."))
        return pickle.dumps(Outcome(result, warned=tuple(each for each in own if isinstance(each, Warning))))
    except Exception as error:  # a bug or a MemoryError fails only this task
        return _failed(error)


def _failed(error: Exception) -> bytes:
    """The pickled outcome of an error, with the traceback as note; an error that cannot be pickled is sent as text."""
    error.add_note(traceback.format_exc())
    try:
        pickled = pickle.dumps(Outcome[object](error=error))
        pickle.loads(pickled)
    except Exception:
        words = RuntimeError(f"{type(error).__name__}: {error}")
        return pickle.dumps(Outcome[object](error=words))
    return pickled


def _watch() -> None:
    """End this process when its parent is gone, even in the middle of a task."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(_ORPHANED)
