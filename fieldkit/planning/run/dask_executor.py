"""Evaluations on a Dask cluster, behind the same interface as worker processes (the `cluster` extra)."""

from __future__ import annotations

import time
import uuid
from typing import Any

from fieldkit.errors import FieldkitError, UsageError
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.run.executor import ATTEMPTS, Evaluator, Executor, Job, broken, evaluate_job
from fieldkit.runtime.threads import limit_threads

_POLL_S = 0.5
_TRIED_BY_SCHEDULER = "KilledWorker"


class DaskExecutor(Executor):
    """Evaluations on a Dask scheduler's workers; see `Executor`.

    The objective is sent to every worker once and keeps its renderer there. If a worker dies, the scheduler gives its
    evaluation to another one, at most `distributed.scheduler.allowed-failures` times; set it to 1 for one retry, as in
    the other executors. After that, or after a second time-out or exception, the evaluation is recorded as failed.
    Start the workers with one thread each (``dask worker tcp://… --nthreads 1``), since evaluations are deterministic
    only on one thread. The memory limit is the worker's own (``--memory-limit``).

    Args:
        objective: picklable.
        client: a connected `distributed.Client`; it stays open.
        seconds: longest wall time of a running evaluation; then its worker is restarted.

    Raises:
        UsageError: the workers have more than one thread each.
    """

    def __init__(self, objective: Evaluator, client: Any, *, seconds: float = 600.0) -> None:
        threads = client.nthreads()
        if any(count != 1 for count in threads.values()):
            raise UsageError(
                "evaluations need Dask workers with one thread each",
                remedy="Start them with `dask worker SCHEDULER --nthreads 1 --nworkers N`.",
            )
        self._objective, self._client, self._seconds = objective, client, seconds
        self._name = f"fieldkit-{uuid.uuid4().hex}"
        self._futures: dict[int, tuple[Any, Job]] = {}
        self._attempts: dict[int, int] = {}
        self._since: dict[int, float] = {}
        client.register_plugin(_keeper(objective, self._name))

    def submit(self, job: Job) -> int:
        number = len(self._attempts)
        self._attempts[number] = 0
        self._send(number, job)
        return number

    def collect(self, wait_s: float = _POLL_S) -> list[tuple[int, Evaluation]]:
        """See `Executor.collect`.

        Raises:
            FieldkitError: a worker's error, with its own class.
        """
        until = time.monotonic() + wait_s
        found: list[tuple[int, Evaluation]] = []
        while True:
            self._watch_clock()
            for number in [n for n, (future, _) in self._futures.items() if future.done()]:
                self._since.pop(number, None)
                future, job = self._futures.pop(number)
                evaluation, reason = _outcome(future)
                if evaluation is not None:
                    found.append((number, evaluation))
                elif self._attempts[number] < ATTEMPTS and not reason.startswith(_TRIED_BY_SCHEDULER):
                    self._send(number, job)
                else:
                    found.append((number, broken(self._objective, job, reason)))
            left = until - time.monotonic()
            if found or not self._futures or left <= 0:
                return found
            time.sleep(min(_POLL_S, left))

    def cancel(self) -> None:
        """See `Executor.cancel`."""
        if self._futures:
            self._client.cancel([future for future, _ in self._futures.values()], force=True)
            self._futures = {}

    def close(self) -> None:
        """Cancel running evaluations; the client and its cluster stay open."""
        self.cancel()
        self._client.unregister_worker_plugin(self._name)

    def _send(self, number: int, job: Job) -> None:
        self._attempts[number] += 1
        # Not pure: repeats must be computed, not taken from the scheduler's memory.
        self._futures[number] = (self._client.submit(_evaluated, self._name, job, pure=False), job)

    def _watch_clock(self) -> None:
        """Restart the workers of evaluations that have run too long; their futures then fail or run again."""
        keys = {future.key: number for number, (future, _) in self._futures.items()}
        running = {keys[k]: worker for worker, all_keys in self._client.processing().items()
                   for k in all_keys if k in keys}  # fmt: skip
        now, since = time.monotonic(), self._since
        first_of: dict[str, int] = {}
        for number, worker in sorted(running.items()):
            first_of.setdefault(worker, number)  # a worker's others are queued, not running
        for number in [n for n in since if first_of.get(running.get(n, "")) != n]:
            del since[number]
        for worker, number in first_of.items():
            if now - since.setdefault(number, now) > self._seconds:
                del since[number]
                self._futures[number][0].cancel(force=True)
                self._client.restart_workers([worker])


def _keeper(objective: Evaluator, plugin_name: str) -> Any:
    """Keeps the objective on every worker, including later ones; scattered data would be lost with a worker."""
    import distributed

    members = {"name": plugin_name, "objective": objective}
    return type("Keeper", (distributed.WorkerPlugin,), members)()


def _evaluated(plugin_name: str, job: Job) -> Evaluation:
    """Evaluates on the worker, limiting its libraries to one thread."""
    import distributed

    limit_threads(1)
    worker: Any = distributed.get_worker()
    return evaluate_job(worker.plugins[plugin_name].objective, job)


def _outcome(future: Any) -> tuple[Evaluation | None, str]:
    """The evaluation, or the reason why there is none.

    Raises:
        FieldkitError: the worker's error.
    """
    if future.status == "finished":
        return future.result(), ""
    if future.status == "cancelled":
        return None, "it took too long"
    error = future.exception()
    if isinstance(error, FieldkitError):
        raise error
    return None, f"{type(error).__name__}: {error}"
