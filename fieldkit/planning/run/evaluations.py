"""Evaluations of an objective on an executor: processes or a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from fieldkit.errors import FieldkitError
from fieldkit.planning.objective.evaluation import WORST_M, Evaluation
from fieldkit.planning.objective.objective import Objective, PlotsObjective
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.context import Context
from fieldkit.runtime.worker import Limits, WorkerError
from fieldkit.vocabulary import SearchFidelity

_LIMITS = Limits(seconds=600.0, memory_bytes=4 << 30)


@dataclass(frozen=True)
class Job:
    """An evaluation to do."""

    cameras: Cameras
    seed: int | None = None
    """Of the photographs' noise; None takes the objective's."""
    fidelity: SearchFidelity | None = None
    """None takes the objective's."""
    plot: int = 0
    """Number of the photographed plot."""


Evaluator = Objective | PlotsObjective


@dataclass(frozen=True)
class Evaluations:
    """Evaluates sets of cameras; the results do not depend on the executor.

    An evaluation that breaks (its worker dies twice, or a bug) comes back with ``measured`` False and the reason.
    """

    executor: Executor

    def submit(self, job: Job) -> Future[Evaluation]:
        """The evaluation of a job, for `outcome`."""
        submit: Callable[..., Future[Evaluation]] = self.executor.submit  # the worker has the evaluator
        return submit(evaluate_job, job)

    def outcome(self, job: Job, future: Future[Evaluation]) -> Evaluation:
        """A job's evaluation. Raises a FieldkitError if none is possible at all, or the job is wrong."""
        try:
            return future.result()
        except WorkerError as error:
            reason = f"broke at every attempt: {error.message}"
        except FieldkitError:
            raise
        except Exception as error:
            reason = f"broke: {type(error).__name__}: {error}"
        return Evaluation(value_m=WORST_M, failure=reason, measured=False)

    def each(self, jobs: Iterable[Job]) -> Iterator[Evaluation]:
        """Evaluations in the jobs' order, each as soon as it and all earlier ones are done. Raises as `outcome`."""
        submitted = [(job, self.submit(job)) for job in jobs]
        for job, future in submitted:
            yield self.outcome(job, future)


@contextmanager
def evaluating(evaluator: Evaluator, context: Context, limits: Limits = _LIMITS) -> Iterator[Evaluations]:
    """Evaluations of an objective, which every worker gets and prepares once; see `open_executor`."""
    with context.executor(make=partial(_prepared, evaluator), limits=limits) as executor:
        yield Evaluations(executor)


def _prepared(evaluator: Evaluator) -> Evaluator:
    evaluator.prepare()
    return evaluator


def evaluate_job(evaluator: Evaluator, job: Job) -> Evaluation:
    """The evaluation by the objective of the job's plot. Raises the objective's errors."""
    return evaluator.on(job.plot).evaluate(job.cameras, seed=job.seed, fidelity=job.fidelity)
