"""The loop of a planning run: propose, evaluate, log; then confirm the best."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.problem import FinalistCosts, FinalistSelector, Gain, Method, Result, Trial, lowest
from fieldkit.planning.run.evaluations import Evaluations, Job
from fieldkit.planning.run.folder import LogEntry, RunFolder, searched
from fieldkit.planning.settings import SearchSettings, unchanging
from fieldkit.planning.space.cameras import Cameras

Stopped = Literal["converged", "evaluations", "time", "exhausted"]
Watch = Callable[[LogEntry], None]
_FRESH_SEEDS = 1_000_000
"""First seed of confirmations; searches use smaller ones."""
_PAIRED = 0.07
"""Standard deviation by which two good sets' values on the same plot differ, as a share of a value."""
_CLEARLY = 2.0
"""Number of standard errors that are clearly more."""


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
    value_m: float | None = None
    """Mean of the confirmations; None without confirmations."""
    spread_m: float | None = None
    """Standard deviation over the confirmations; None without two."""
    kind_m: float | None = None
    """The method's expectation on plots of the kind, after all evaluations; None if the method has none."""


def search(
    method: Method, evaluations: Evaluations, run: RunFolder, *, out_of_time: Callable[[float], bool], watch: Watch
) -> Ending:
    """Evaluate trials until the run has its number of them or converges; logged evaluations are not repeated.

    The method proposes in a thread of its own while evaluations run. When it proposes trial k, it knows trials up to k
    − lag − 1. So proposals depend only on the settings, also in an interrupted run. ``out_of_time`` says from the run's
    seconds so far whether no trial may start any more. Returns why the search ended.
    """
    with ThreadPoolExecutor(1) as thread:
        going = _Search(method, evaluations, run, out_of_time, watch, thread)
        while going.step():
            pass
    return going.ending


class _Search:
    """The state of a search: trials proposed so far, being proposed, and being evaluated."""

    def __init__(
        self,
        method: Method,
        evaluations: Evaluations,
        run: RunFolder,
        out_of_time: Callable[[float], bool],
        watch: Watch,
        thread: ThreadPoolExecutor,
    ) -> None:
        self._method, self._evaluations, self._run = method, evaluations, run
        self._out_of_time, self._watch, self._thread = out_of_time, watch, thread
        self._clock = _Clock(run)
        self._known = {entry.number: entry for entry in searched(run.entries)}
        self._trials: list[Trial] = []
        self._results: dict[int, Result] = {}
        self._thinking: Future[tuple[Trial | None, float]] | None = None
        self._running: dict[Future[Evaluation], tuple[Trial, Job, float]] = {}
        self._open_ended = True
        self.ending = Ending("evaluations")

    def step(self) -> bool:
        """Do the next step: start, collect or wait; False when nothing is left to do."""
        self._think()
        thinking = self._thinking
        busy: list[Future[Any]] = [*self._running, *(() if thinking is None else (thinking,))]
        if not busy:
            return False
        done, _ = wait(busy, return_when=FIRST_COMPLETED)
        for future in [each for each in self._running if each in done]:
            self._gather(future)
        if thinking is not None and thinking in done:
            self._take_up(*thinking.result())
        return True

    def _think(self) -> None:
        """Start proposing the next trial once all results it may know are there, or take it from the log."""
        settings = self._run.settings
        while self._open_ended and self._thinking is None and len(self._trials) < settings.evaluations:
            number = len(self._trials)
            if number in self._known:
                self._trials.append(self._known[number].trial)
                self._results[number] = self._known[number].result
                continue
            if self._out_of_time(self._clock.seconds):
                self._end(Ending("time"))
                return
            allowed = max(0, number - settings.lag)
            if any(k not in self._results for k in range(allowed)):
                return
            seen = [self._results[k] for k in range(allowed)]
            self._thinking = self._thread.submit(_proposed, self._method, number, seen, self._trials[allowed:])

    def _take_up(self, trial: Trial | None, cpu_s: float) -> None:
        self._thinking = None
        if trial is None:
            self._end(Ending("exhausted"))
            return
        if trial.gain is not None and trial.gain.negligible and trial.number >= self._run.settings.at_least:
            self._end(Ending("converged", trial.gain))
            return
        self._trials.append(trial)
        job = Job(trial.cameras, search_seed(self._run.settings, trial.number), plot=trial.plot)
        self._running[self._evaluations.submit(job)] = (trial, job, cpu_s)

    def _end(self, ending: Ending) -> None:
        self._open_ended, self.ending = False, ending

    def _gather(self, future: Future[Evaluation]) -> None:
        trial, job, cpu_s = self._running.pop(future)
        settings = self._run.settings
        entry = LogEntry.of(
            trial,
            self._evaluations.outcome(job, future),
            stage="search",
            seed=search_seed(settings, trial.number),
            fidelity=settings.fidelity,
            proposal_cpu_s=cpu_s,
            finished_s=self._clock.seconds,
            plot=trial.plot,
        )
        self._run.append(entry)
        self._results[trial.number] = entry.result
        self._watch(entry)


def confirm(
    method: Method, evaluations: Evaluations, run: RunFolder, *, watch: Watch, even: Sequence[Trial] = ()
) -> list[Finalist]:
    """Evaluate the search's best sets again at fresh seeds.

    A `FinalistSelector` chooses the sets; else they are those of the lowest values. The lowest of many noisy values is
    partly luck, so the winner is chosen by values that had no part in finding it. The finalists are in the order of
    `ranked`; none if no trial was measured.

    Args:
        even: the even subsets of a recorded set. The best of them is always a finalist, and the plan unless another one
            is ahead of it beyond noise.
    """
    results = [entry.result for entry in searched(run.entries)]
    judge = method.favourites if isinstance(method, FinalistSelector) else lowest
    chosen = judge(results, run.settings.finalists)
    if not chosen or not even:
        return ranked(method, run, evaluate_again(evaluations, run, chosen, watch=watch))
    evens = {trial.cameras for trial in even}
    standard = lowest([result for result in results if result.trial.cameras in evens], 1) or list(even[:1])
    cameras = standard[0].cameras
    chosen += [trial for trial in standard if cameras not in [each.cameras for each in chosen]]
    return unless_ahead(ranked(method, run, evaluate_again(evaluations, run, chosen, watch=watch)), cameras, run)


def unless_ahead(confirmed: list[Finalist], standard: Cameras, run: RunFolder, nearer: float = 0.0) -> list[Finalist]:
    """The finalists with the standard one in front, unless the first is ahead of it beyond noise, and by that share."""
    known = next(finalist for finalist in confirmed if finalist.trial.cameras == standard)
    exact = run.settings.plots == 1 and unchanging(run.settings.source, run.settings.noise)
    if confirmed[0] is known or _ahead(confirmed[0], known, 0.0 if exact else _PAIRED, nearer):
        return confirmed
    return [known, *(finalist for finalist in confirmed if finalist is not known)]


def _ahead(finalist: Finalist, other: Finalist, noise: float, nearer: float = 0.0) -> bool:
    """Whether a finalist is better than another one by more than the noise of their values at the same seeds, and by a
    share ``nearer`` of the other's value.

    ``noise`` is of a difference, as a share of a value, where there are too few to tell.
    """
    pairs = list(zip(finalist.entries, other.entries, strict=False))
    if not pairs:
        return True
    gains = [b.value_m - a.value_m for a, b in pairs]
    noise_m = float(np.std(gains, ddof=1)) if len(gains) > 2 else noise * pairs[0][1].value_m
    least_m = nearer * float(np.mean([b.value_m for _, b in pairs]))
    return bool(np.mean(gains) > max(_CLEARLY * noise_m / np.sqrt(len(gains)), least_m))


def ranked(method: object, run: RunFolder, confirmed: Sequence[Finalist]) -> list[Finalist]:
    """Finalists, the best first: by their confirmations, or for plots of a kind by an `FinalistCosts`'s expectation.

    Plots differ by more than good sets do, so the mean of few confirmations says less than all results together.
    """
    settings = run.settings
    if settings.plots == 1 or not settings.repeats or not isinstance(method, FinalistCosts):
        return list(confirmed)
    costs = method.expect_m([f.trial.cameras for f in confirmed], [entry.result for entry in run.entries])
    known = [replace(finalist, kind_m=cost) for finalist, cost in zip(confirmed, costs, strict=True)]
    return sorted(known, key=lambda finalist: (-len(finalist.entries), finalist.kind_m, finalist.trial.number))


def evaluate_again(
    evaluations: Evaluations,
    run: RunFolder,
    chosen: Sequence[Trial],
    *,
    watch: Watch,
    standard: Cameras | None = None,
    nearer: float = 0.0,
) -> list[Finalist]:
    """Evaluate trials at the fresh seeds of a run's settings, and log them as confirmations.

    If the plan is for plots of a kind, each repeat is on its own plot, one that no trial has met. The first is the
    given plot if the search took no photographs. It is a race: a trial that is clearly behind after a repeat takes part
    in no more, and where one is left the race is over. The trials come by repeats, then value, the best first; in the
    given order if the settings ask for no repeats. ``standard`` are cameras that others have to beat by a share
    ``nearer``; their values race with so much taken off.
    """
    settings = run.settings
    if not settings.repeats:
        return [Finalist(trial) for trial in chosen]
    seeds = [_FRESH_SEEDS + settings.seed * settings.repeats + k for k in range(settings.repeats)]
    fresh = list(zip(seeds, _plots_of_repeats(settings, bool(searched(run.entries))), strict=True))
    # By cameras, not by number: numbers of carried plans may change between runs.
    fidelity = settings.confirm_fidelity
    there = {
        (e.trial.cameras, e.seed, e.plot): e
        for e in run.entries
        if e.stage == "confirmation" and e.fidelity == fidelity
    }
    clock = _Clock(run)
    racing, finalists = list(chosen), {}
    for done, (seed, plot) in enumerate(fresh, start=1):
        wanted = [trial for trial in racing if (trial.cameras, seed, plot) not in there]
        jobs = [Job(trial.cameras, seed, fidelity, plot) for trial in wanted]
        for trial, found in zip(wanted, evaluations.each(jobs), strict=True):
            entry = LogEntry.of(
                trial,
                found,
                stage="confirmation",
                seed=seed,
                fidelity=fidelity,
                proposal_cpu_s=0.0,
                finished_s=clock.seconds,
                plot=plot,
            )
            run.append(entry)
            there[trial.cameras, seed, plot] = entry
            watch(entry)
        for trial in racing:
            entries = tuple(there[trial.cameras, s, p] for s, p in fresh[:done])
            finalists[trial.number] = _finalist(trial, entries)
        if settings.plots > 1:
            racing = _not_behind(racing, finalists, standard, nearer)
            if len(racing) == 1:
                break
    # Those that raced on are ahead of those that were given up.
    return sorted(finalists.values(), key=lambda f: (-len(f.entries), f.value_m, f.trial.number))


def _finalist(trial: Trial, entries: tuple[LogEntry, ...]) -> Finalist:
    values = [entry.value_m for entry in entries]
    spread = float(np.std(values, ddof=1)) if len(values) > 1 else None
    return Finalist(trial, entries, float(np.mean(sorted(values, reverse=True))), spread)


def _not_behind(
    racing: Sequence[Trial], finalists: Mapping[int, Finalist], standard: Cameras | None, nearer: float
) -> list[Trial]:
    """The trials that noise could still put before the leader; all were evaluated on the same plots."""
    values = {
        trial.number: (finalists[trial.number].value_m or 0.0) * (1.0 - nearer * (trial.cameras == standard))
        for trial in racing
    }
    lead = min(values.values())
    rounds = len(finalists[racing[0].number].entries)
    behind_m = _CLEARLY * _PAIRED * lead / np.sqrt(rounds)
    return [trial for trial in racing if values[trial.number] <= lead + behind_m]


def _plots_of_repeats(settings: SearchSettings, evaluated: bool) -> list[int]:
    """The plot of each repeat; ``evaluated`` says whether the search has evaluated trials."""
    if settings.plots == 1:
        return [0] * settings.repeats
    unseen = list(range(settings.plots, settings.plots + settings.repeats))
    # The given plot is the only real one of its kind.
    return unseen if evaluated else [0, *unseen[:-1]]


def search_seed(settings: SearchSettings, number: int) -> int:
    """Seed of a trial's photographs: its own, or the run's if recorded photographs are used without noise.

    With one seed for all, a search prefers sets that this seed's noise happens to favour.
    """
    if unchanging(settings.source, settings.noise):
        return settings.seed
    return settings.seed * 10_000 + number


class _Clock:
    """Seconds of a run, without the time between its parts."""

    def __init__(self, run: RunFolder) -> None:
        self._before = max((entry.finished_s for entry in run.entries), default=0.0)
        self._start = time.monotonic()

    @property
    def seconds(self) -> float:
        return self._before + time.monotonic() - self._start


def no_watch(entry: LogEntry) -> None:
    """A `Watch` that does nothing."""


def _proposed(
    method: Method, number: int, results: Sequence[Result], pending: Sequence[Trial]
) -> tuple[Trial | None, float]:
    start = time.thread_time()
    trial = method.propose(number, results, pending)
    return trial, time.thread_time() - start
