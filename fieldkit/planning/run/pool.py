"""Worker processes on one machine, each with its own objective, kept alive and watched."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess

import psutil

from fieldkit.errors import FieldkitError
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.run.executor import Evaluator, Executor, Job
from fieldkit.planning.run.worker import Answer, work
from fieldkit.runtime.threads import set_memory_environment

_ATTEMPTS = 2
_POLL_S = 0.2
_STOP_S = 2.0


@dataclass(frozen=True)
class Limits:
    """What one evaluation may take.

    Attributes:
        seconds: of wall time, then the worker is killed.
        start_seconds: for a worker to come up (the libraries, the scene's upload).
        memory_bytes: resident memory of the worker, polled five times a second, then it is killed. Not an address
            space limit, since graphics drivers and compiled kernels reserve more than they use.
    """

    seconds: float = 600.0
    start_seconds: float = 300.0
    memory_bytes: int = 4 << 30


class WorkerError(FieldkitError):
    """Worker processes do not start."""


@dataclass
class _Task:
    number: int
    job: Job
    attempts: int = 0


class _Worker:
    """One process and what it is doing."""

    def __init__(self, objective: Evaluator, limits: Limits) -> None:
        # Forking a process that has threads (progress display, OpenCV) can deadlock the child.
        set_memory_environment()
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(
            target=work, args=(theirs, objective, os.getpid()), daemon=True, name="fieldkit-worker"
        )
        self.process.start()
        theirs.close()
        self.limits = limits
        self.ready = False
        self.task: _Task | None = None
        self.deadline = time.monotonic() + limits.start_seconds

    def give(self, task: _Task) -> None:
        task.attempts += 1
        self.task = task
        self.deadline = time.monotonic() + self.limits.seconds
        with suppress(OSError):  # a worker that died just now shows at the next look
            self.connection.send(task.job)

    def excess(self) -> str:
        """Why it has to be killed, or nothing."""
        if (self.task is not None or not self.ready) and time.monotonic() > self.deadline:
            allowed = self.limits.seconds if self.ready else self.limits.start_seconds
            return f"it took longer than {allowed:g} s"
        with suppress(psutil.Error):
            used = psutil.Process(self.process.pid).memory_info().rss
            if used > self.limits.memory_bytes:
                return f"it used {used / 2**30:.1f} GiB of memory, more than {self.limits.memory_bytes / 2**30:.1f} GiB"
        return ""

    def end(self) -> None:
        """Kill the process and wait for its end."""
        self.connection.close()
        if self.process.is_alive():
            self.process.kill()
        self.process.join()

    def dismiss(self) -> None:
        """Ask an idle process to stop."""
        with suppress(OSError):
            self.connection.send(None)

    def last_words(self) -> str:
        self.process.join(_STOP_S)
        code = self.process.exitcode
        if code is not None and code < 0:
            with suppress(ValueError):
                return f"its process was ended by {signal.Signals(-code).name}"
        return f"its process ended with exit code {code}"


class WorkerPool(Executor):
    """Evaluations side by side in worker processes; see `Executor`.

    Workers are spawned, prepare the objective once and are used again; one that dies or is killed is replaced. The
    objective must be picklable. As with every use of `multiprocessing`, a script that opens a pool needs
    ``if __name__ == "__main__":``.

    Args:
        objective: copied to each worker.
        workers: processes, one thread each.
        limits: of one evaluation.

    Example:
        >>> with WorkerPool(objective, workers=2) as pool:
        ...     evaluations = evaluate_all(pool, candidates)
    """

    def __init__(self, objective: Evaluator, *, workers: int = 2, limits: Limits | None = None) -> None:
        if workers < 1:
            raise ValueError("a pool needs at least one worker")
        self._objective, self._count, self._limits = objective, workers, limits or Limits()
        self._workers: list[_Worker] = []
        self._failed_starts = 0
        self._waiting: deque[_Task] = deque()
        self._finished: list[tuple[int, Evaluation]] = []
        self._submitted = 0

    @property
    def processes(self) -> tuple[int, ...]:
        """Ids of the living workers."""
        return tuple(w.process.pid for w in self._workers if w.process.pid is not None and w.process.is_alive())

    def submit(self, job: Job) -> int:
        self._waiting.append(_Task(self._submitted, job))
        self._submitted += 1
        return self._submitted - 1

    def collect(self, wait_s: float = _POLL_S) -> list[tuple[int, Evaluation]]:
        """See `Executor.collect`.

        Raises:
            FieldkitError: what a worker refused to do, with its own class.
            WorkerError: workers die before they are ready.
        """
        wanted = len(self._waiting) + sum(w.task is not None for w in self._workers)
        while len(self._workers) < min(self._count, wanted):
            self._workers.append(_Worker(self._objective, self._limits))
        for worker in self._workers:
            if worker.ready and worker.task is None and self._waiting:
                worker.give(self._waiting.popleft())
        if wanted:
            self._look(wait_s)
        found, self._finished = self._finished, []
        return found

    def cancel(self) -> None:
        """See `Executor.cancel`; workers that are busy are killed."""
        self._waiting.clear()
        self._finished = []
        self._stop([w for w in self._workers if w.task is not None])

    def close(self) -> None:
        """End all workers: idle ones are asked, the others killed after two seconds."""
        for worker in self._workers:
            worker.dismiss()
        until = time.monotonic() + _STOP_S
        for worker in self._workers:
            if worker.task is None:
                worker.process.join(max(0.0, until - time.monotonic()))
        self._stop(list(self._workers))

    def _stop(self, workers: list[_Worker]) -> None:
        for worker in workers:
            worker.end()
            self._workers.remove(worker)

    def _look(self, wait_s: float) -> None:
        """Take in answers, deaths and excesses, the first of them at most ``wait_s`` later."""
        by_connection: dict[Connection, _Worker] = {w.connection: w for w in self._workers}
        heard = wait([*by_connection, *(w.process.sentinel for w in self._workers)], timeout=min(wait_s, _POLL_S))
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

    def _take(self, worker: _Worker, answer: Answer) -> None:
        if answer.kind == "refused":
            assert answer.error is not None
            raise answer.error
        if answer.kind == "ready":
            worker.ready, self._failed_starts = True, 0
            return
        task, worker.task = worker.task, None
        assert task is not None
        if answer.evaluation is not None:
            self._finished.append((task.number, answer.evaluation))
        else:
            self._again(task, answer.reason)

    def _lost(self, worker: _Worker, reason: str) -> None:
        task = worker.task
        self._stop([worker])
        if task is not None:
            self._again(task, reason)
        elif not worker.ready:
            self._failed_starts += 1
            if self._failed_starts > _ATTEMPTS * self._count:
                raise WorkerError(
                    f"worker processes do not start: {reason}",
                    remedy='Run `fieldkit doctor`; a script that opens a pool needs `if __name__ == "__main__":`.',
                )

    def _again(self, task: _Task, reason: str) -> None:
        if task.attempts < _ATTEMPTS:
            self._waiting.appendleft(task)
            return
        worst = self._objective.settings.rule.worst_m
        broken = Evaluation.broken(len(task.job.cameras), f"broke twice: {reason}", worst)
        self._finished.append((task.number, broken))
