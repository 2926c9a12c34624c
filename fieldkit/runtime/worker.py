"""The inside of a worker process: it answers calls until its executor closes the connection. Its limits and errors."""

from __future__ import annotations

import math
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
from typing import Any

from fieldkit.errors import FieldkitError
from fieldkit.runtime.threads import limit_threads

_ORPHANED = 3
"""Exit code of a worker whose parent is gone."""


class WorkerError(FieldkitError):
    """The worker of a call died at every attempt."""


class NoWorkersError(FieldkitError):
    """Workers do not start, or cannot be reached."""


@dataclass(frozen=True)
class Limits:
    """Limits of a worker."""

    seconds: float = math.inf
    """Wall time of one call; then the worker is killed."""
    memory_bytes: float = math.inf
    """Resident memory, polled five times a second; above it the worker is killed. Address space is not limited, since
    graphics drivers and compiled kernels reserve more than they use.
    """
    finish_seconds: float = 0.0
    """Time to finish a call when the executor is left by an error; then the worker is killed."""


@dataclass(frozen=True)
class Answer:
    """The answer to a call: its result, or the error that it raised; and fieldkit's warnings that it gave."""

    result: Any = None
    error: Exception | None = None
    warned: tuple[Warning, ...] = ()


def work(connection: Connection, make: Callable[[], Any] | None) -> None:
    """Make the worker's own state and send an empty answer, then answer calls until the connection closes.

    Args:
        connection: receives (function, arguments, keywords), sends pickled answers.
        make: gives the first argument of every call, if there is one. An exception of it is the last answer.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # held back so far by the executor
    threading.Thread(target=_watch, daemon=True).start()
    with suppress(OSError):
        # If memory runs out, the kernel should kill this process and not the one with the results.
        Path("/proc/self/oom_score_adj").write_bytes(b"1000")
    os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa's software renderer draws on this thread, too; same pixels
    limit_threads(1)
    with suppress(EOFError, OSError):
        try:
            own = () if make is None else (make(),)
        except Exception as error:
            connection.send_bytes(_failed(error))
            return
        connection.send_bytes(pickle.dumps(Answer()))
        while True:
            function, arguments, keywords = connection.recv()
            connection.send_bytes(_answered(function, (*own, *arguments), keywords))


def _answered(function: Callable[..., Any], arguments: tuple[Any, ...], keywords: dict[str, Any]) -> bytes:
    """The pickled answer to a call, whether it returns or raises."""
    try:
        with warnings.catch_warnings(record=True) as given:
            result = function(*arguments, **keywords)
        own = (each.message for each in given if each.category.__module__.startswith("fieldkit."))
        return pickle.dumps(Answer(result, warned=tuple(each for each in own if isinstance(each, Warning))))
    except Exception as error:  # a bug or a MemoryError fails only this call
        return _failed(error)


def _failed(error: Exception) -> bytes:
    """The pickled answer of an error, with the traceback as note; an error that cannot be pickled is sent as text."""
    error.add_note(traceback.format_exc())
    try:
        pickled = pickle.dumps(Answer(error=error))
        pickle.loads(pickled)
    except Exception:
        return pickle.dumps(Answer(error=RuntimeError(f"{type(error).__name__}: {error}")))
    return pickled


def _watch() -> None:
    """End this process when its parent is gone, even in the middle of a call."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(_ORPHANED)
