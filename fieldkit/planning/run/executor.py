"""Many evaluations, one thread each: the interface, and the ways that stay on this machine."""

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
from fieldkit.planning.objective.fidelity import FidelityName
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.worker_pool import Limits, WorkerPool

ATTEMPTS = 2
"""At an evaluation that breaks."""
_LIMITS = Limits(seconds=600.0, memory_bytes=4 << 30)


@dataclass(frozen=True)
class Job:
    """One evaluation to do.

    Attributes:
        cameras: what to evaluate.
        seed: of the photographs' noise; None takes the objective's.
        fidelity: other than the objective's.
        plot: number of the plot that is photographed.
    """

    cameras: Cameras
    seed: int | None = None
    fidelity: FidelityName | None = None
    plot: int = 0


class Evaluator(Protocol):
    """What executors are given: an `Objective`, or those of several plots. It can be pickled."""

    @property
    def settings(self) -> ObjectiveSettings: ...

    def prepare(self) -> None:
        """Do now what the first evaluation would do once. Raises what cannot be done here at all."""
        ...

    def on(self, plot: int) -> Objective:
        """The objective of the plot of that number."""
        ...

    def close(self) -> None:
        """Free what was prepared."""
        ...


def evaluate_job(evaluator: Evaluator, job: Job) -> Evaluation:
    """What the objective of the job's plot says of it. Raises what it raises."""
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
            Its number, by which `collect` names its evaluation: 0, 1, 2 … in the order of submission.
        """

    @abstractmethod
    def collect(self, wait_s: float = 0.2) -> list[tuple[int, Evaluation]]:
        """Keep the workers busy and hand out what has finished since the last call, in any order.

        Idle workers are given queued jobs in here only, so call it again and again while there are any.

        Args:
            wait_s: at most this long, where nothing has finished yet.

        Raises:
            FieldkitError: no evaluation is possible at all (this machine cannot render, say), or a job is wrong.
        """

    @abstractmethod
    def cancel(self) -> None:
        """Stop what still runs and forget what waits; jobs can be submitted again."""

    @abstractmethod
    def close(self) -> None:
        """Stop for good."""

    def run(self, jobs: Iterable[Job]) -> Iterator[Evaluation]:
        """Evaluations in the jobs' order, each as soon as it and those before it are there.

        Nothing else may be in the queue meanwhile. Leaving the iterator early stops what still runs.

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
            if due < len(numbers):  # an exception, Ctrl-C or a caller that has seen enough
                self.cancel()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class SerialExecutor(Executor):
    """One evaluation after the other in this process, which a crash would end: for tests and for debugging.

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
            FieldkitError: what a worker refused to do, with its own class; `WorkerError` where workers do not start.
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
        """See `Executor.cancel`; workers that are busy are killed."""
        self._pool.cancel()
        self._jobs.clear()

    def close(self) -> None:
        """End all workers."""
        self._pool.close()


def _prepared(objective: Evaluator) -> Callable[[Job], Evaluation]:
    objective.prepare()
    return partial(evaluate_job, objective)


def broken(objective: Evaluator, job: Job, reason: str) -> Evaluation:
    """Of a job that broke at every attempt."""
    return Evaluation.broken(len(job.cameras), f"broke at every attempt: {reason}", objective.settings.rule.worst_m)


def evaluate_all(executor: Executor, cameras: Iterable[Cameras], *, seed: int | None = None) -> list[Evaluation]:
    """Evaluations of all sets, in order."""
    return list(executor.run(Job(each, seed) for each in cameras))
