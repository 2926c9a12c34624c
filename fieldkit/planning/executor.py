"""Many evaluations, one thread each: the interface, and the way that stays in this process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from fieldkit.planning.cameras import Cameras
from fieldkit.planning.evaluation import Evaluation
from fieldkit.planning.objective import Objective


@dataclass(frozen=True)
class Job:
    """One evaluation to do.

    Attributes:
        cameras: what to evaluate.
        seed: of the photographs' noise; None takes the objective's.
    """

    cameras: Cameras
    seed: int | None = None


class Executor(Protocol):
    """Evaluates sets of cameras; the results do not depend on which executor does.

    An evaluation that breaks (a crash, the time-out, too much memory) is tried once more and then comes back with
    ``measured`` False and the reason; the others go on.
    """

    def run(self, jobs: Iterable[Job]) -> Iterator[Evaluation]:
        """Evaluations in the jobs' order, each as soon as it and those before it are there.

        Raises:
            FieldkitError: no evaluation is possible at all (this machine cannot render, say), or a job is wrong.
        """
        ...

    def close(self) -> None:
        """Stop whatever still runs."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Serial:
    """One evaluation after the other in this process, which a crash would end: for tests and for debugging.

    The caller limits the threads (`fieldkit.threads`).

    Args:
        objective: closed with the executor.
    """

    def __init__(self, objective: Objective) -> None:
        self.objective = objective

    def run(self, jobs: Iterable[Job]) -> Iterator[Evaluation]:
        for job in jobs:
            yield self.objective.evaluate(job.cameras, seed=job.seed)

    def close(self) -> None:
        self.objective.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def evaluate_all(executor: Executor, cameras: Iterable[Cameras], *, seed: int | None = None) -> list[Evaluation]:
    """Evaluations of all sets, in order."""
    return list(executor.run(Job(each, seed) for each in cameras))
