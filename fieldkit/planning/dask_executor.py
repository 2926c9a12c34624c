"""Evaluations on a Dask cluster, behind the same interface as worker processes (the `cluster` extra)."""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any, Self

from fieldkit.errors import FieldkitError, UsageError
from fieldkit.planning.evaluation import Evaluation
from fieldkit.planning.executor import Job
from fieldkit.planning.objective import Objective
from fieldkit.planning.worker import Answer, evaluate_job
from fieldkit.threads import limit_threads

_ATTEMPTS = 2
_POLL_S = 0.5
_TRIED_BY_SCHEDULER = "KilledWorker"


class DaskExecutor:
    """Evaluations on a Dask scheduler's workers; see `Executor`.

    The objective is sent to every worker once and keeps its renderer there. The scheduler gives the evaluation of a
    worker that dies to another one, as often as `distributed.scheduler.allowed-failures` says; set it to 1 for one
    retry, as the other executors have. After that, or a second time-out or exception, it is recorded as failed. Start
    the workers with one thread each (``dask worker tcp://… --nthreads 1``), for evaluations are deterministic on one
    thread only; the memory limit is the worker's own (``--memory-limit``).

    Args:
        objective: picklable.
        client: a connected `distributed.Client`; it stays open.
        seconds: wall time of an evaluation from when it starts to run; then its worker is restarted.

    Raises:
        UsageError: the workers have more than one thread each.
    """

    def __init__(self, objective: Objective, client: Any, *, seconds: float = 600.0) -> None:
        threads = client.nthreads()
        if any(count != 1 for count in threads.values()):
            raise UsageError(
                "evaluations need Dask workers with one thread each",
                remedy="Start them with `dask worker SCHEDULER --nthreads 1 --nworkers N`.",
            )
        self._objective, self._client, self._seconds = objective, client, seconds
        self._name = f"fieldkit-{uuid.uuid4().hex}"
        self._futures: dict[int, Any] = {}
        client.register_plugin(_keeper(objective, self._name))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
        self._client.unregister_worker_plugin(self._name)

    def run(self, jobs: Iterable[Job]) -> Iterator[Evaluation]:
        """See `Executor.run`.

        Raises:
            FieldkitError: what a worker refused to do, with its own class.
        """
        listed = list(jobs)
        attempts = dict.fromkeys(range(len(listed)), 0)
        finished: dict[int, Evaluation] = {}
        since: dict[int, float] = {}
        due = 0
        try:
            for number, job in enumerate(listed):
                self._submit(number, job, attempts)
            while due < len(listed):
                self._watch_clock(since)
                for number in [n for n, future in self._futures.items() if future.done()]:
                    since.pop(number, None)
                    found, reason = _outcome(self._futures.pop(number))
                    if found is not None:
                        finished[number] = found
                    elif attempts[number] < _ATTEMPTS and not reason.startswith(_TRIED_BY_SCHEDULER):
                        self._submit(number, listed[number], attempts)
                    else:
                        worst = self._objective.settings.rule.worst_m
                        count = len(listed[number].cameras)
                        finished[number] = Evaluation.broken(count, f"broke again and again: {reason}", worst)
                while due in finished:
                    yield finished.pop(due)
                    due += 1
                if due < len(listed):
                    time.sleep(_POLL_S)
        finally:
            self.close()

    def close(self) -> None:
        """Cancel what still runs; the client and its cluster stay."""
        if self._futures:
            self._client.cancel(list(self._futures.values()), force=True)
            self._futures = {}

    def _submit(self, number: int, job: Job, attempts: dict[int, int]) -> None:
        attempts[number] += 1
        # Not pure: a repeat is asked for on purpose and must not come from the scheduler's memory.
        self._futures[number] = self._client.submit(_evaluated, self._name, job, pure=False)

    def _watch_clock(self, since: dict[int, float]) -> None:
        """Restart the workers of evaluations that have run too long; their futures then fail or run again."""
        keys = {future.key: number for number, future in self._futures.items()}
        running = {keys[k]: worker for worker, all_keys in self._client.processing().items()
                   for k in all_keys if k in keys}  # fmt: skip
        now = time.monotonic()
        first_of: dict[str, int] = {}
        for number, worker in sorted(running.items()):
            first_of.setdefault(worker, number)  # a worker's others are queued, not running
        for number in [n for n in since if first_of.get(running.get(n, "")) != n]:
            del since[number]
        for worker, number in first_of.items():
            if now - since.setdefault(number, now) > self._seconds:
                del since[number]
                self._futures[number].cancel(force=True)
                self._client.restart_workers([worker])


def _keeper(objective: Objective, plugin_name: str) -> Any:
    """Holds the objective on every worker, also on those that start later: scattered data die with their workers."""
    import distributed

    members = {"name": plugin_name, "objective": objective}
    return type("Keeper", (distributed.WorkerPlugin,), members)()


def _evaluated(plugin_name: str, job: Job) -> Answer:
    """Runs on the worker, whose libraries may be set to more threads than one."""
    import distributed

    limit_threads(1)
    worker: Any = distributed.get_worker()
    return evaluate_job(worker.plugins[plugin_name].objective, job)


def _outcome(future: Any) -> tuple[Evaluation | None, str]:
    """The evaluation, or why there is none.

    Raises:
        FieldkitError: the worker refused.
    """
    if future.status == "finished":
        answer = future.result()
        if answer.kind == "refused":
            raise answer.error
        return answer.evaluation, answer.reason
    if future.status == "cancelled":
        return None, "it took too long"
    error = future.exception()
    if isinstance(error, FieldkitError):
        raise error
    return None, f"{type(error).__name__}: {error}"
