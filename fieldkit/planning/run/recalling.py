"""An executor that reuses the evaluations of other runs of the same objective."""

from __future__ import annotations

from collections.abc import Iterable

from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.run.executor import Executor, Job
from fieldkit.planning.run.folder import LogEntry
from fieldkit.planning.space.cameras import Cameras
from fieldkit.vocabulary import SearchFidelity


class Recalling(Executor):
    """Answers known jobs at once and passes on the others; answers keep their original times.

    Args:
        executor: evaluates unknown jobs; closed with this one.
        known: log entries of the same objective, from any run.
        fidelity: of jobs without one.
    """

    def __init__(self, executor: Executor, known: Iterable[LogEntry], fidelity: SearchFidelity) -> None:
        self._executor, self._fidelity = executor, fidelity
        self._known: dict[tuple[Cameras, int | None, SearchFidelity, int], Evaluation] = {
            (entry.trial.cameras, entry.seed, entry.fidelity, entry.plot): entry.evaluation
            for entry in known
            if entry.measured
        }
        self._ready: list[tuple[int, Evaluation]] = []
        self._tickets: dict[int, int] = {}
        self._submitted = 0

    def submit(self, job: Job) -> int:
        ticket, self._submitted = self._submitted, self._submitted + 1
        found = self._known.get((job.cameras, job.seed, job.fidelity or self._fidelity, job.plot))
        if found is None:
            self._tickets[self._executor.submit(job)] = ticket
        else:
            self._ready.append((ticket, found))
        return ticket

    def collect(self, wait_s: float = 0.2) -> list[tuple[int, Evaluation]]:
        ready, self._ready = self._ready, []
        others = self._executor.collect(0.0 if ready else wait_s) if self._tickets else []
        return ready + [(self._tickets.pop(inner), found) for inner, found in others]

    def cancel(self) -> None:
        self._ready.clear()
        self._tickets.clear()
        self._executor.cancel()

    def close(self) -> None:
        self._executor.close()
