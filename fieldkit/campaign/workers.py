"""Jobs in worker processes that are watched: one that dies costs its job only, and none outlives its run."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Generic, TypeVar

from fieldkit.runtime.threads import limit_threads, set_thread_environment

Job = TypeVar("Job")
Result = TypeVar("Result")
_PARENT_POLL_S = 1.0
_END_S = 5.0


@dataclass(frozen=True)
class Done(Generic[Job, Result]):
    """How a job ended.

    Attributes:
        job: as given.
        result: of the function; None where its process died.
        death: how that ended, in words; empty where it did not.
    """

    job: Job
    result: Result | None
    death: str = ""


def each_in_workers(
    function: Callable[[Job], Result], jobs: Sequence[Job], *, workers: int
) -> Generator[Done[Job, Result], None, None]:
    """Run a function on jobs in worker processes, one thread each, and give the results as they come.

    A worker is used for several jobs. One that dies (out of memory, a crash of compiled code) is replaced; its job is
    given as dead and not tried again. All workers are ended when the iteration ends or is left. A worker whose parent
    was killed ends within a second or two.

    Args:
        function: picklable, and does not raise: what it raises ends its worker.
        jobs: picklable.
        workers: processes, at least one: also a single one keeps a crash away from the caller.
    """
    set_thread_environment()  # which the workers inherit: their libraries read it when they are imported
    waiting = deque(jobs)
    pool: list[_Worker[Job, Result]] = []
    try:
        while waiting or any(worker.busy for worker in pool):
            while waiting and sum(worker.busy for worker in pool) < workers:
                idle = next((worker for worker in pool if not worker.busy), None)
                if idle is None:
                    idle = _Worker(function)
                    pool.append(idle)
                idle.give(waiting.popleft())
            for worker in _ready(pool):
                done = worker.take()
                if not worker.alive:
                    pool.remove(worker)
                yield done
    finally:
        for worker in pool:
            worker.end()


class _Worker(Generic[Job, Result]):
    def __init__(self, function: Callable[[Job], Result]) -> None:
        # Forking a process that has threads (progress display, OpenCV) can deadlock the child.
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(
            target=_work, args=(function, theirs, os.getpid()), daemon=True, name="fieldkit-visit"
        )
        self.process.start()
        theirs.close()
        self.job: Job | None = None
        self.busy, self.alive = False, True

    def give(self, job: Job) -> None:
        self.job, self.busy = job, True
        with suppress(OSError):  # one that died just now shows when it is looked at
            self.connection.send(job)

    def take(self) -> Done[Job, Result]:
        """The result that is ready, or how the process ended."""
        assert self.job is not None
        job, self.job, self.busy = self.job, None, False
        try:
            return Done(job, self.connection.recv())
        except (EOFError, OSError):
            self.alive = False
            self.process.join(_END_S)
            self.end()
            return Done(job, None, _death(self.process.exitcode))

    def end(self) -> None:
        self.alive = False
        self.connection.close()
        if not self.busy:
            self.process.join(_END_S)
        if self.process.is_alive():
            self.process.kill()  # SIGTERM is taken by pycolmap's logging
        self.process.join()


def _ready(pool: Sequence[_Worker[Job, Result]]) -> list[_Worker[Job, Result]]:
    busy = {worker.connection: worker for worker in pool if worker.busy}
    return [busy[found] for found in wait(list(busy)) if isinstance(found, Connection)]


def _death(code: int | None) -> str:
    if code is not None and code < 0:
        with suppress(ValueError):
            name = signal.Signals(-code).name
            hint = " (out of memory?)" if name == "SIGKILL" else ""
            return f"its process was ended by {name}{hint}"
    return f"its process ended with exit code {code}"


def _work(function: Callable[[Job], Result], connection: Connection, parent: int) -> None:
    """The life of a worker: jobs in, results out, until the other end closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    limit_threads()
    while True:
        try:
            job = connection.recv()
        except (EOFError, OSError):
            return
        result = function(job)
        try:
            connection.send(result)
        except OSError:
            return


def _watch(parent: int) -> None:
    """End this process when its parent is gone, however that ended."""
    while os.getppid() == parent:
        time.sleep(_PARENT_POLL_S)
    os._exit(1)
