"""The loop of a planning run: propose, evaluate, log; then confirm the best."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fieldkit.planning.executor import Executor, Job
from fieldkit.planning.run_folder import LogEntry, RunFolder
from fieldkit.planning.run_settings import SearchSettings
from fieldkit.planning.search import Judge, Method, Result, Trial, lowest

Stopped = Literal["evaluations", "time", "exhausted"]
Watch = Callable[[LogEntry], None]
_POLL_S, _QUICK_POLL_S = 0.2, 0.02
_FRESH_SEEDS = 1_000_000
"""Seeds of confirmations begin here, so that no search has seen them."""


@dataclass(frozen=True, eq=False)
class Finalist:
    """A set of cameras that was evaluated again.

    Attributes:
        trial: of the search.
        entries: its confirmations.
        value_m: their mean, or the mean of the worst share that the settings' risk names.
        spread_m: standard deviation over the confirmations; 0 for one.
    """

    trial: Trial
    entries: tuple[LogEntry, ...]
    value_m: float
    spread_m: float


def search(
    method: Method, executor: Executor, run: RunFolder, *, out_of_time: Callable[[float], bool], watch: Watch
) -> Stopped:
    """Evaluate trials until the run has its number of them; what the log has already is not done again.

    A method proposes in a thread of its own while evaluations run, and knows of trial k − lag − 1 and those before it
    when it proposes trial k. So what is proposed depends on the settings only, also in a run that was interrupted.

    Args:
        method: of the search.
        executor: of the objective; left with nothing to do.
        run: where results go.
        out_of_time: whether no trial may start any more, given the seconds of the run so far.
        watch: told of every new entry.

    Returns:
        Why the search ended.

    Raises:
        FieldkitError: no evaluation is possible at all.
        StorageError: the disk is full; everything logged so far can be gone on from.
    """
    settings = run.settings
    known = {entry.number: entry for entry in run.entries if entry.stage == "search"}
    trials: list[Trial] = []
    results: dict[int, Result] = {}
    clock = _Clock(run)
    running: dict[int, tuple[Trial, float]] = {}
    stopped: Stopped = "evaluations"
    thinking: Future[tuple[Trial | None, float]] | None = None
    with ThreadPoolExecutor(1) as thread:
        try:
            open_ended = True
            while True:
                while open_ended and thinking is None and len(trials) < settings.evaluations:
                    number = len(trials)
                    if number in known:
                        trials.append(known[number].trial)
                        results[number] = known[number].result
                        continue
                    if out_of_time(clock.seconds):
                        open_ended, stopped = False, "time"
                        break
                    allowed = max(0, number - settings.lag)
                    if any(k not in results for k in range(allowed)):
                        break
                    seen = [results[k] for k in range(allowed)]
                    thinking = thread.submit(_proposed, method, number, seen, trials[allowed:])
                if thinking is not None and thinking.done():
                    trial, cpu_s = thinking.result()
                    thinking = None
                    if trial is None:
                        open_ended, stopped = False, "exhausted"
                    else:
                        trials.append(trial)
                        job = Job(trial.cameras, search_seed(settings, trial.number))
                        running[executor.submit(job)] = (trial, cpu_s)
                    continue
                if not running:
                    if thinking is None:
                        return stopped
                    wait([thinking])
                    continue
                # The sooner a proposal that may be ready is queued, the less a worker idles.
                for ticket, found in executor.collect(_POLL_S if thinking is None else _QUICK_POLL_S):
                    trial, cpu_s = running.pop(ticket)
                    entry = LogEntry.of(
                        trial, found, stage="search", seed=search_seed(settings, trial.number),
                        fidelity=settings.fidelity, proposal_cpu_s=cpu_s, finished_s=clock.seconds,
                    )  # fmt: skip
                    run.append(entry)
                    results[trial.number] = entry.result
                    watch(entry)
        except BaseException:
            executor.cancel()
            raise


def confirm(method: Method, executor: Executor, run: RunFolder, *, watch: Watch) -> list[Finalist]:
    """Evaluate the search's best sets again at fresh seeds; the best of them first.

    Which these are the method says where it is a `Judge`; else they are those of the lowest values. The lowest value of
    many noisy ones is partly luck: the winner is chosen by values that had no part in finding it.

    Returns:
        The finalists by value; none where no trial was measured.

    Raises:
        FieldkitError, StorageError: as `search`.
    """
    results = sorted((e.result for e in run.entries if e.stage == "search"), key=lambda r: r.trial.number)
    judge = method.favourites if isinstance(method, Judge) else lowest
    chosen = judge(results, run.settings.finalists)
    return evaluate_again(executor, run, chosen, watch=watch)


def evaluate_again(executor: Executor, run: RunFolder, chosen: Sequence[Trial], *, watch: Watch) -> list[Finalist]:
    """Evaluate trials at the fresh seeds of a run's settings, and log them as confirmations.

    Returns:
        The trials by value, the best first.

    Raises:
        FieldkitError, StorageError: as `search`.
    """
    settings = run.settings
    seeds = [_FRESH_SEEDS + settings.seed * settings.repeats + k for k in range(settings.repeats)]
    there = {(e.number, e.seed, e.fidelity): e for e in run.entries if e.stage == "confirmation"}
    wanted = [(t, s) for s in seeds for t in chosen if (t.number, s, settings.confirm_fidelity) not in there]
    jobs = [Job(trial.cameras, seed, settings.confirm_fidelity) for trial, seed in wanted]
    clock = _Clock(run)
    for (trial, seed), found in zip(wanted, executor.run(jobs), strict=True):
        entry = LogEntry.of(
            trial, found, stage="confirmation", seed=seed, fidelity=settings.confirm_fidelity, proposal_cpu_s=0.0,
            finished_s=clock.seconds,
        )  # fmt: skip
        run.append(entry)
        there[trial.number, seed, settings.confirm_fidelity] = entry
        watch(entry)
    confirmed = []
    for trial in chosen:
        entries = tuple(there[trial.number, seed, settings.confirm_fidelity] for seed in seeds)
        values = [entry.value_m for entry in entries]
        spread = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
        confirmed.append(Finalist(trial, entries, worst_mean(values, settings.noise.risk), spread))
    return sorted(confirmed, key=lambda finalist: (finalist.value_m, finalist.trial.number))


def worst_mean(values: Sequence[float], share: float) -> float:
    """The mean of the worst ``share`` of values, at least of one: conditional value at risk, a cost's upper tail.

    Rockafellar and Uryasev (2000), of the sample; ``share`` 1 gives the mean.
    """
    count = max(1, round(share * len(values)))
    return float(np.mean(sorted(values, reverse=True)[:count]))


def search_seed(settings: SearchSettings, number: int) -> int:
    """Of a trial's photographs: the run's own, or where there is noise to survive one of its own for each trial."""
    return settings.seed if not settings.noise.any else settings.seed * 10_000 + number


class _Clock:
    """Seconds of a run, the time between its parts left out."""

    def __init__(self, run: RunFolder) -> None:
        self._before = max((entry.finished_s for entry in run.entries), default=0.0)
        self._start = time.monotonic()

    @property
    def seconds(self) -> float:
        return self._before + time.monotonic() - self._start


def _proposed(
    method: Method, number: int, results: Sequence[Result], pending: Sequence[Trial]
) -> tuple[Trial | None, float]:
    start = time.thread_time()
    trial = method.propose(number, results, pending)
    return trial, time.thread_time() - start
