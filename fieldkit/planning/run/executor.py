"""Many evaluations, one thread each: the interface, and the executors on this machine."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from types import TracebackType
from typing import Protocol, Self

from fieldkit.errors import FieldkitError
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.worker_pool import Limits, WorkerPool
from fieldkit.vocabulary import SearchFidelity

ATTEMPTS = 2
"""Attempts at an evaluation that breaks."""
_LIMITS = Limits(seconds=600.0, memory_bytes=4 << 30)


@dataclass(frozen=True)
class Job:
    """An evaluation to do.

    Attributes:
        cameras: the set to evaluate.
        seed: of the photographs' noise; None takes the objective's seed.
        fidelity: of the evaluation; None takes the objective's.
        plot: number of the photographed plot.
    """

    cameras: Cameras
    seed: int | None = None
    fidelity: SearchFidelity | None = None
    plot: int = 0


class Evaluator(Protocol):
    """An `Objective`, or the objectives of several plots, as executors take it. Picklable."""

    @property
    def settings(self) -> ObjectiveSettings: ...

    def prepare(self) -> None:
        """Do the one-off work of the first evaluation now. Raises errors that prevent any evaluation here."""
        ...

    def on(self, plot: int) -> Objective:
        """The objective of a plot, by number."""
        ...

    def close(self) -> None:
        """Free what `prepare` made."""
        ...


def evaluate_job(evaluator: Evaluator, job: Job) -> Evaluation:
    """The evaluation by the objective of the job's plot. Raises the objective's errors."""
    return evaluator.on(job.plot).evaluate(job.cameras, seed=job.seed, fidelity=job.fidelity)


class Executor(ABC):
    """Evaluates sets of cameras; the results do not depend on which executor does.

    An evaluation that breaks (a crash, the time-out, too much memory) is tried once more and then comes back with
    ``measured`` False and the reason; the others go on.
    """

    @abstractmethod
    def submit(self, job: Job) -> int:
        """Put a job into the queue.

        Returns:
            The job's number, which `collect` returns with the evaluation: 0, 1, 2 … in the order of submission.
        """

    @abstractmethod
    def collect(self, wait_s: float = 0.2) -> list[tuple[int, Evaluation]]:
        """Give queued jobs to idle workers, and return what has finished since the last call, in any order.

        Workers get jobs only in this call, so call it repeatedly while there are any.

        Args:
            wait_s: longest wait if nothing has finished yet, seconds.

        Raises:
            FieldkitError: no evaluation is possible at all (this machine cannot render, say), or a job is wrong.
        """

    @abstractmethod
    def cancel(self) -> None:
        """Stop running jobs and drop queued ones; new jobs can be submitted."""

    @abstractmethod
    def close(self) -> None:
        """Stop for good."""

    def run(self, jobs: Iterable[Job]) -> Iterator[Evaluation]:
        """Evaluations in the jobs' order, each as soon as it and all earlier ones are done.

        The queue must hold no other jobs meanwhile. Leaving the iterator early stops running jobs.

        Raises:
            FieldkitError: as `collect`.
        """
        numbers = [self.submit(job) for job in jobs]
        finished: dict[int, Evaluation] = {}
        due = 0
        try:
            while due < len(numbers):
                finished.update(self.collect())
                while due < len(numbers) and numbers[due] in finished:
                    yield finished.pop(numbers[due])
                    due += 1
        finally:
            if due < len(numbers):  # an exception, Ctrl-C, or the caller stopped early
                self.cancel()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class SerialExecutor(Executor):
    """One evaluation after the other in this process, for tests and debugging. A crash ends the process.

    The caller limits the threads (`fieldkit.runtime.threads`).

    Args:
        objective: closed with the executor.
    """

    def __init__(self, objective: Evaluator) -> None:
        self.objective = objective
        self._waiting: deque[tuple[int, Job]] = deque()
        self._submitted = 0

    def submit(self, job: Job) -> int:
        self._waiting.append((self._submitted, job))
        self._submitted += 1
        return self._submitted - 1

    def collect(self, wait_s: float = 0.2) -> list[tuple[int, Evaluation]]:
        if not self._waiting:
            return []
        number, job = self._waiting.popleft()
        return [(number, evaluate_job(self.objective, job))]

    def cancel(self) -> None:
        self._waiting.clear()

    def close(self) -> None:
        self.cancel()
        self.objective.close()


class ProcessExecutor(Executor):
    """Evaluations side by side in worker processes (`WorkerPool`), each with its own objective, prepared once.

    Args:
        objective: picklable; copied to each worker.
        workers: processes, one thread each.
        limits: of one evaluation.

    Example:
        >>> with ProcessExecutor(objective, workers=2) as executor:
        ...     evaluations = evaluate_all(executor, candidates)
    """

    def __init__(self, objective: Evaluator, *, workers: int = 2, limits: Limits = _LIMITS) -> None:
        self._objective = objective
        self._pool = WorkerPool[Job, Evaluation](
            partial(_prepared, objective), workers=workers, limits=limits, attempts=ATTEMPTS
        )
        self._jobs: dict[int, Job] = {}

    def submit(self, job: Job) -> int:
        number = self._pool.submit(job)
        self._jobs[number] = job
        return number

    def collect(self, wait_s: float = 0.2) -> list[tuple[int, Evaluation]]:
        """See `Executor.collect`.

        Raises:
            FieldkitError: a worker's error, with its own class; `WorkerError` if workers do not start.
        """
        found = []
        for number, outcome in self._pool.collect(wait_s):
            job = self._jobs.pop(number)
            if isinstance(outcome.error, FieldkitError):
                raise outcome.error
            evaluation = broken(self._objective, job, outcome.failure) if outcome.result is None else outcome.result
            found.append((number, evaluation))
        return found

    def cancel(self) -> None:
        """See `Executor.cancel`; busy workers are killed."""
        self._pool.cancel()
        self._jobs.clear()

    def close(self) -> None:
        """End all workers."""
        self._pool.close()


def _prepared(objective: Evaluator) -> Callable[[Job], Evaluation]:
    objective.prepare()
    return partial(evaluate_job, objective)


def broken(objective: Evaluator, job: Job, reason: str) -> Evaluation:
    """The evaluation of a job that broke at every attempt."""
    return Evaluation.broken(len(job.cameras), f"broke at every attempt: {reason}", objective.settings.rule.worst_m)


def evaluate_all(executor: Executor, cameras: Iterable[Cameras], *, seed: int | None = None) -> list[Evaluation]:
    """Evaluations of all sets, in order."""
    return list(executor.run(Job(each, seed) for each in cameras))
