"""The loop of a planning run: propose, evaluate, log; then confirm the best."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from fieldkit.errors import FieldkitError
from fieldkit.planning.objective.evaluation import WORST_M, Evaluation
from fieldkit.planning.objective.objective import Objective, PlotsObjective
from fieldkit.planning.problem import FinalistCosts, FinalistSelector, Gain, Method, Trial, lowest
from fieldkit.planning.run.folder import LogEntry, RunFolder, searched
from fieldkit.planning.settings import SearchSettings, unchanging
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.context import Context
from fieldkit.runtime.worker import Limits, WorkerError
from fieldkit.vocabulary import SearchFidelity

Stopped = Literal["converged", "evaluations", "exhausted"]
Watch = Callable[[LogEntry], None]
Evaluator = Objective | PlotsObjective
_LIMITS = Limits(seconds=600.0, memory_bytes=4 << 30)
_FRESH_SEEDS = 1_000_000
"""First seed of confirmations; searches use smaller ones."""
_PAIRED = 0.07
"""Standard deviation by which two good sets' values on the same plot differ, as a share of a value."""
_CLEARLY = 2.0
"""Number of standard errors that are clearly more."""


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


@dataclass(frozen=True)
class Ending:
    """Why a search ended."""

    stopped: Stopped
    """The limit that was reached, or that the search converged: the possible gain is below an evaluation's noise."""
    gain: Gain | None = None
    """The possible gain, if it converged."""


@dataclass(frozen=True, eq=False)
class Finalist:
    """A set of cameras with its confirmations."""

    trial: Trial
    entries: tuple[LogEntry, ...] = ()
    """The confirmations."""
    kind_m: float | None = None
    """The method's expectation on plots of the kind, after all evaluations; None if the method has none."""

    @property
    def value_m(self) -> float | None:
        """Mean of the confirmations; None without confirmations."""
        return float(np.mean(sorted((e.value_m for e in self.entries), reverse=True))) if self.entries else None

    @property
    def spread_m(self) -> float | None:
        """Standard deviation over the confirmations; None without two."""
        return float(np.std([e.value_m for e in self.entries], ddof=1)) if len(self.entries) > 1 else None


def search(method: Method, evaluations: Evaluations, run: RunFolder, *, watch: Watch) -> Ending:
    """Evaluate trials until the run has its number of them or converges; logged evaluations are not repeated.

    The method proposes in a thread of its own while evaluations run. When it proposes trial k, it knows trials up to k
    − lag − 1. So proposals depend only on the settings, also in an interrupted run. Returns why the search ended.
    """
    with ThreadPoolExecutor(1) as thread:
        going = _Search(method, evaluations, run, watch, thread)
        while going.step():
            pass
    return going.ending


class _Search:
    """The state of a search: trials proposed so far, being proposed, and being evaluated."""

    def __init__(
        self, method: Method, evaluations: Evaluations, run: RunFolder, watch: Watch, thread: ThreadPoolExecutor
    ) -> None:
        self._method, self._evaluations, self._run = method, evaluations, run
        self._watch, self._thread = watch, thread
        self._logged = {entry.number: entry.trial for entry in searched(run.entries)}
        self._trials: list[Trial] = []
        self._results: dict[int, Trial] = {}
        self._proposing: Future[tuple[Trial | None, float]] | None = None
        self._running: dict[Future[Evaluation], tuple[Trial, Job, float]] = {}
        self._open_ended = True
        self.ending = Ending("evaluations")

    def step(self) -> bool:
        """Do the next step: start, collect or wait; False when nothing is left to do."""
        self._propose()
        proposing = self._proposing
        busy: list[Future[Any]] = [*self._running, *(() if proposing is None else (proposing,))]
        if not busy:
            return False
        done, _ = wait(busy, return_when=FIRST_COMPLETED)
        for future in [running for running in self._running if running in done]:
            self._gather(future)
        if proposing is not None and proposing in done:
            self._take_up(*proposing.result())
        return True

    def _propose(self) -> None:
        """Start proposing the next trial once all results it may know are there, or take it from the log."""
        settings = self._run.settings
        while self._open_ended and self._proposing is None and len(self._trials) < settings.evaluations:
            number = len(self._trials)
            if number in self._logged:
                self._trials.append(self._logged[number])
                self._results[number] = self._logged[number]
                continue
            allowed = max(0, number - settings.lag)
            if any(k not in self._results for k in range(allowed)):
                return
            known = [self._results[k] for k in range(allowed)]
            self._proposing = self._thread.submit(_proposed, self._method, number, known, self._trials[allowed:])

    def _take_up(self, trial: Trial | None, cpu_s: float) -> None:
        self._proposing, settings = None, self._run.settings
        if trial is None:
            self._open_ended, self.ending = False, Ending("exhausted")
        elif trial.gain is not None and trial.gain.negligible and trial.number >= settings.at_least:
            self._open_ended, self.ending = False, Ending("converged", trial.gain)
        else:
            self._trials.append(trial)
            job = Job(trial.cameras, search_seed(settings, trial.number), settings.fidelity, trial.plot)
            self._running[self._evaluations.submit(job)] = (trial, job, cpu_s)

    def _gather(self, future: Future[Evaluation]) -> None:
        trial, job, cpu_s = self._running.pop(future)
        evaluation = self._evaluations.outcome(job, future)
        entry = self._run.log(trial, job, evaluation, "search", proposal_cpu_s=cpu_s)
        self._results[trial.number] = entry.trial
        self._watch(entry)


def finalists(method: Method, run: RunFolder, even: Sequence[Trial] = ()) -> tuple[list[Trial], Trial | None]:
    """The sets of a search to evaluate again, and the best of the even subsets of a recorded set, which is one of them.

    A `FinalistSelector` chooses the sets; else they are those of the lowest values. None if no trial was measured.
    """
    results = [entry.trial for entry in searched(run.entries)]
    choose = method.favourites if isinstance(method, FinalistSelector) else lowest
    chosen = choose(results, run.settings.finalists)
    if not chosen or not even:
        return chosen, None
    subsets = {trial.cameras for trial in even}
    standard = (lowest([result for result in results if result.cameras in subsets], 1) or even)[0]
    if standard.cameras not in [trial.cameras for trial in chosen]:
        chosen = [*chosen, standard]
    return chosen, standard


def confirm(
    method: object,
    evaluations: Evaluations,
    run: RunFolder,
    chosen: Sequence[Trial],
    *,
    watch: Watch,
    standard: Trial | None = None,
) -> list[Finalist]:
    """Evaluate trials again at the fresh seeds of a run's settings and log them; the finalists, the best first.

    The lowest of many noisy values is partly luck, so the winner is chosen by values that had no part in finding it.
    If the plan is for plots of a kind, each repeat is on its own plot, one that no trial has met. The first is the
    given plot, the only real one of its kind, if the search took no photographs. Finalists come by value; for plots of
    a kind by a `FinalistCosts`'s expectation: plots differ by more than good sets do, so the mean of few confirmations
    says less than all results together. They keep the given order if the settings ask for no repeats. ``standard`` is
    one of the trials; it comes first unless the best is ahead of it beyond noise.
    """
    settings = run.settings
    if not settings.repeats:
        return [Finalist(trial) for trial in chosen]
    plots = [0] * settings.repeats
    if settings.plots > 1:
        unseen = list(range(settings.plots, settings.plots + settings.repeats))
        plots = unseen if searched(run.entries) else [0, *unseen[:-1]]
    fidelity = settings.confirm_fidelity
    # By cameras, not by number: numbers of carried plans may change between runs.
    logged = {
        (e.trial.cameras, e.seed, e.plot): e
        for e in run.entries
        if e.stage == "confirmation" and e.fidelity == fidelity
    }
    found = [Finalist(trial) for trial in chosen]
    for seed, plot in enumerate(plots, start=_FRESH_SEEDS + settings.seed * settings.repeats):
        new = [trial for trial in chosen if (trial.cameras, seed, plot) not in logged]
        jobs = [Job(trial.cameras, seed, fidelity, plot) for trial in new]
        for trial, job, evaluation in zip(new, jobs, evaluations.each(jobs), strict=True):
            entry = run.log(trial, job, evaluation, "confirmation")
            logged[trial.cameras, seed, plot] = entry
            watch(entry)
        found = [replace(f, entries=(*f.entries, logged[f.trial.cameras, seed, plot])) for f in found]
    ordered = sorted(found, key=lambda finalist: (finalist.value_m, finalist.trial.number))
    if settings.plots > 1 and isinstance(method, FinalistCosts):
        costs = method.expect_m([f.trial.cameras for f in ordered], [entry.trial for entry in run.entries])
        known = [replace(finalist, kind_m=cost) for finalist, cost in zip(ordered, costs, strict=True)]
        ordered = sorted(known, key=lambda finalist: (finalist.kind_m, finalist.trial.number))
    if standard is None:
        return ordered
    own = next(finalist for finalist in ordered if finalist.trial.cameras == standard.cameras)
    exact = settings.plots == 1 and unchanging(settings.source, settings.noise)
    if ordered[0] is own or _ahead(ordered[0], own, 0.0 if exact else _PAIRED):
        return ordered
    return [own, *(finalist for finalist in ordered if finalist is not own)]


def _ahead(finalist: Finalist, other: Finalist, noise: float) -> bool:
    """Whether a finalist is better than another one by more than the noise of their values at the same seeds.

    ``noise`` is of a difference, as a share of a value, where there are too few to tell.
    """
    pairs = [(a.value_m, b.value_m) for a, b in zip(finalist.entries, other.entries, strict=False)]
    if not pairs:
        return True
    gains = [b - a for a, b in pairs]
    noise_m = float(np.std(gains, ddof=1)) if len(gains) > 2 else noise * pairs[0][1]
    return bool(np.mean(gains) > _CLEARLY * noise_m / np.sqrt(len(gains)))


def search_seed(settings: SearchSettings, number: int) -> int:
    """Seed of a trial's photographs: its own, or the run's if recorded photographs are used without noise.

    With one seed for all, a search prefers sets that this seed's noise happens to favour.
    """
    if unchanging(settings.source, settings.noise):
        return settings.seed
    return settings.seed * 10_000 + number


def no_watch(entry: LogEntry) -> None:
    """A `Watch` that does nothing."""


def _proposed(
    method: Method, number: int, results: Sequence[Trial], pending: Sequence[Trial]
) -> tuple[Trial | None, float]:
    start = time.thread_time()
    trial = method.propose(number, results, pending)
    return trial, time.thread_time() - start
