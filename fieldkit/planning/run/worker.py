"""The inside of a worker process: an objective, prepared once, and evaluations until the parent hangs up."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Literal, NamedTuple

from fieldkit.errors import FieldkitError
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.run.executor import Evaluator, Job, evaluate_job
from fieldkit.runtime.threads import limit_threads, set_thread_environment

_PARENT_POLL_S = 1.0
_ORPHANED = 3


class Answer(NamedTuple):
    """What a worker tells: that it is ready, a job's evaluation, or an exception.

    ``refused`` is an error a person can act on (`FieldkitError`); ``broke`` anything else, in words.
    """

    kind: Literal["ready", "done", "refused", "broke"]
    evaluation: Evaluation | None = None
    error: FieldkitError | None = None
    reason: str = ""


def work(connection: Connection, objective: Evaluator, parent: int) -> None:
    """Prepare, say so, then answer jobs until the connection closes.

    Args:
        connection: receives `Job`, sends `Answer`.
        objective: this process's own copy.
        parent: process id of the pool; when it is gone, so is this process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    with suppress(OSError):
        # Where memory runs out, the kernel shall take this process and not the one with the results.
        Path("/proc/self/oom_score_adj").write_text("1000")
    set_thread_environment(1)
    os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa's software renderer draws on this thread, too; same pixels
    limit_threads(1)
    with suppress(EOFError, OSError):
        answer = _prepared(objective)
        connection.send(answer)
        while answer.kind in ("ready", "done", "broke"):
            job: Job | None = connection.recv()
            if job is None:
                break
            answer = answer_job(objective, job)
            connection.send(answer)


def _prepared(objective: Evaluator) -> Answer:
    try:
        objective.prepare()
    except FieldkitError as error:
        return Answer("refused", error=error)
    return Answer("ready")


def answer_job(objective: Evaluator, job: Job) -> Answer:
    """The answer to one job; whatever is raised on the way becomes part of it."""
    try:
        return Answer("done", evaluate_job(objective, job))
    except FieldkitError as error:
        return Answer("refused", error=error)
    except Exception as error:  # a bug or a MemoryError costs this evaluation, and the reason is kept
        return Answer("broke", reason=f"{type(error).__name__}: {error}")


def _watch(parent: int) -> None:
    """End this process when its parent was killed, in the middle of an evaluation too."""
    while os.getppid() == parent:
        time.sleep(_PARENT_POLL_S)
    os._exit(_ORPHANED)
