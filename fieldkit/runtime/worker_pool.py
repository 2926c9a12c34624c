"""Watched worker processes on one machine: one that dies loses only its task, and none outlives its pool."""

from __future__ import annotations

import math
import multiprocessing
import signal
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from types import TracebackType
from typing import Generic, Self

import psutil

from fieldkit.errors import FieldkitError
from fieldkit.runtime.threads import set_memory_environment, set_thread_environment
from fieldkit.runtime.worker import Outcome, Result, Task, WorkerError, work

_FAILED_STARTS = 2
_POLL_S = 0.2
_STOP_S = 2.0


@dataclass(frozen=True)
class Limits:
    """Limits of a worker.

    Attributes:
        seconds: wall time for one task; then the worker is killed.
        start_seconds: time to start (importing libraries, making the function).
        memory_bytes: resident memory, polled five times a second; above it the worker is killed. Address space is not
            limited, since graphics drivers and compiled kernels reserve more than they use.
        finish_seconds: time to finish a task when the pool is closed; then the worker is killed.
    """

    seconds: float = math.inf
    start_seconds: float = 300.0
    memory_bytes: float = math.inf
    finish_seconds: float = 0.0


@dataclass
class _Submitted(Generic[Task]):
    number: int
    task: Task
    attempts: int = 0


class _Worker(Generic[Task, Result]):
    """A process and its task."""

    def __init__(self, make: Callable[[], Callable[[Task], Result]], limits: Limits) -> None:
        # Libraries read these when they are imported, which is before the worker's first line runs.
        set_thread_environment()
        set_memory_environment()
        # Forking a process that has threads (progress display, OpenCV) can deadlock the child.
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(
            target=work, args=(theirs, make), daemon=True, name="fieldkit-worker"
        )
        with _interrupts_held():
            self.process.start()
        theirs.close()
        self.limits = limits
        self.ready = False
        self.doing: _Submitted[Task] | None = None
        self.deadline = time.monotonic() + limits.start_seconds

    def give(self, submitted: _Submitted[Task]) -> None:
        submitted.attempts += 1
        self.doing = submitted
        self.deadline = time.monotonic() + self.limits.seconds
        with suppress(OSError):  # a worker that just died is noticed later
            self.connection.send(submitted.task)

    def excess(self) -> str:
        """Why it has to be killed; empty if it does not."""
        if (self.doing is not None or not self.ready) and time.monotonic() > self.deadline:
            allowed = self.limits.seconds if self.ready else self.limits.start_seconds
            return f"it took longer than {allowed:g} s"
        if math.isfinite(self.limits.memory_bytes):
            with suppress(psutil.Error):
                used, most = psutil.Process(self.process.pid).memory_info().rss, self.limits.memory_bytes
                if used > most:
                    return f"it used {used / 2**30:.1f} GiB of memory, more than {most / 2**30:.1f} GiB"
        return ""

    def end(self) -> None:
        """Kill the process and wait for its end."""
        self.connection.close()
        if self.process.is_alive():
            self.process.kill()
        self.process.join()

    def last_words(self) -> str:
        self.process.join(_STOP_S)
        code = self.process.exitcode
        if code is not None and code < 0:
            with suppress(ValueError):
                name = signal.Signals(-code).name
                return f"its process was ended by {name}" + (" (out of memory?)" if name == "SIGKILL" else "")
        return f"its process ended with exit code {code}"


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back: a process that is started here holds it back, too, until it ignores it (`worker.work`).

    Else Ctrl-C in a terminal, which reaches all processes, ends a worker that is importing with a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # starting it would let go of the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class WorkerPool(Generic[Task, Result]):
    """Tasks side by side in worker processes of one thread each.

    Workers are spawned when there are tasks, make the function once and are reused; dead ones are replaced. Workers end
    within a second or two if their parent is killed. As with every use of `multiprocessing`, a script that opens a pool
    needs ``if __name__ == "__main__":``.

    Args:
        make: gives the function that answers tasks; called once in each worker. Picklable, as are tasks and results.
        workers: processes.
        limits: of each.
        attempts: at a task whose worker dies or whose function raises. A `FieldkitError` is not tried again.

    Raises:
        ValueError: no worker.
    """

    def __init__(
        self, make: Callable[[], Callable[[Task], Result]], *, workers: int, limits: Limits | None = None,
        attempts: int = 1,
    ) -> None:  # fmt: skip
        if workers < 1:
            raise ValueError("a pool needs at least one worker")
        self._make, self._count, self._limits, self._attempts = make, workers, limits or Limits(), attempts
        self._workers: list[_Worker[Task, Result]] = []
        self._failed_starts = 0
        self._waiting: deque[_Submitted[Task]] = deque()
        self._finished: list[tuple[int, Outcome[Result]]] = []
        self._submitted = 0

    def submit(self, task: Task) -> int:
        """Queue a task. Returns its number: 0, 1, 2 … in the order of submission."""
        self._waiting.append(_Submitted(self._submitted, task))
        self._submitted += 1
        return self._submitted - 1

    def collect(self, wait_s: float = _POLL_S) -> list[tuple[int, Outcome[Result]]]:
        """Give tasks to idle workers, and return what has finished since the last call, by number, in any order.

        Args:
            wait_s: longest wait if nothing has finished yet, seconds.

        Raises:
            Exception: raised by making the function.
            WorkerError: workers die before they are ready.
        """
        wanted = len(self._waiting) + sum(w.doing is not None for w in self._workers)
        while len(self._workers) < min(self._count, wanted):
            self._workers.append(_Worker(self._make, self._limits))
        self._hand_out()
        if wanted:
            self._look(wait_s)
        self._hand_out()  # so that no worker idles while the caller handles results
        found, self._finished = self._finished, []
        return found

    def cancel(self) -> None:
        """Drop queued tasks and kill busy workers; new tasks can be submitted."""
        self._waiting.clear()
        self._finished = []
        self._stop([w for w in self._workers if w.doing is not None])

    def close(self) -> None:
        """End all workers; those that do not finish within the limits' time are killed."""
        now = time.monotonic()
        for worker in self._workers:
            worker.connection.close()
        for worker in self._workers:
            allowed_s = _STOP_S if worker.doing is None else self._limits.finish_seconds
            worker.process.join(max(0.0, now + allowed_s - time.monotonic()))
        self._stop(list(self._workers))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _hand_out(self) -> None:
        for worker in self._workers:
            if worker.ready and worker.doing is None and self._waiting:
                worker.give(self._waiting.popleft())

    def _stop(self, workers: list[_Worker[Task, Result]]) -> None:
        for worker in workers:
            worker.end()
            self._workers.remove(worker)

    def _look(self, wait_s: float) -> None:
        """Handle outcomes, deaths and exceeded limits, waiting at most ``wait_s`` for the first."""
        connections: list[Connection] = [w.connection for w in self._workers]
        heard = wait([*connections, *(w.process.sentinel for w in self._workers)], timeout=min(wait_s, _POLL_S))
        for worker in list(self._workers):
            reason = ""
            if worker.connection in heard:
                try:
                    self._take(worker, worker.connection.recv())
                    continue
                except (EOFError, OSError):
                    reason = worker.last_words()
            elif worker.process.sentinel in heard:
                reason = worker.last_words()
            reason = reason or worker.excess()
            if reason:
                self._lost(worker, reason)

    def _take(self, worker: _Worker[Task, Result], outcome: Outcome[Result]) -> None:
        for warning in outcome.warned:
            warnings.warn(warning, stacklevel=2)
        if worker.doing is not None:
            submitted, worker.doing = worker.doing, None
            self._settle(submitted, outcome)
        elif outcome.error is None:
            worker.ready, self._failed_starts = True, 0
        else:
            self._stop([worker])
            raise outcome.error

    def _lost(self, worker: _Worker[Task, Result], reason: str) -> None:
        self._stop([worker])
        if worker.doing is not None:
            self._settle(worker.doing, Outcome(death=reason))
        elif not worker.ready:
            self._failed_starts += 1
            if self._failed_starts > _FAILED_STARTS * self._count:
                raise WorkerError(
                    f"worker processes do not start: {reason}",
                    remedy='Run `fieldkit doctor`; a script that opens a pool needs `if __name__ == "__main__":`.',
                )

    def _settle(self, submitted: _Submitted[Task], outcome: Outcome[Result]) -> None:
        final = not outcome.failure or isinstance(outcome.error, FieldkitError)
        if final or submitted.attempts >= self._attempts:
            self._finished.append((submitted.number, outcome))
        else:
            self._waiting.appendleft(submitted)
