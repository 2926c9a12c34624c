"""The executor on a Dask cluster (the extra `cluster`), behind the interface of concurrent.futures."""

from __future__ import annotations

import math
import os
import threading
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from functools import partial
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

from fieldkit.errors import UsageError
from fieldkit.runtime.threads import limit_threads
from fieldkit.runtime.worker import Limits, NoWorkersError, WorkerError

_TOO_LONG = 4
"""Exit code of a worker whose item took too long."""
TRUSTED = "FIELDKIT_TRUSTED_NETWORK"


@contextmanager
def open_cluster(scheduler: str, make: Callable[[], Any] | None, limits: Limits) -> Iterator[Executor]:
    """See `executor.open_executor`."""
    try:
        from distributed import Client
    except ImportError as error:
        raise UsageError(
            "--scheduler needs Dask", remedy="Install it with `pip install 'fieldkit[cluster]'`."
        ) from error
    check_scheduler(scheduler)
    try:
        client: Any = Client(scheduler, timeout="20s")  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise NoWorkersError(
            f"cannot reach the Dask scheduler {scheduler}: {error}",
            remedy="Start it with `dask scheduler`, and give its address like tcp://host:8786.",
        ) from error
    with client, Cluster(client, make=make, limits=limits) as executor:
        yield executor


def check_scheduler(scheduler: str) -> None:
    """Raise a UsageError for a scheduler beyond this machine that is reached without TLS, unless that is wished.

    Whoever reaches a scheduler's port runs what they like on its workers. Certificates of tls:// addresses are those
    that Dask is configured with (``distributed.comm.tls``, or DASK_DISTRIBUTED__COMM__TLS__CA_FILE and the like).
    """
    scheme, _, place = scheduler.rpartition("://")
    host = urlsplit(f"//{place}").hostname or ""
    try:
        alone = ip_address(host).is_loopback
    except ValueError:
        alone = host == "localhost"
    if scheme not in ("tls", "wss", "inproc") and not alone and not os.environ.get(TRUSTED):
        raise UsageError(
            f"the Dask scheduler {scheduler} is on another machine, and reached without TLS",
            remedy=f"Give tls://{place} with Dask's certificates, or set {TRUSTED}=1 on a network of your own.",
        )


class Cluster(Executor):
    """Calls on the workers of a Dask scheduler, each of one thread (``dask worker tcp://… --nthreads 1``).

    If a worker dies, the scheduler gives its call to another one, at most `distributed.scheduler.allowed-failures`
    times. A call that takes too long ends its worker. Memory is limited by the workers (``--memory-limit``).

    Args:
        client: a connected `distributed.Client`; it stays open.
        make, limits: as `executor.open_executor` has them.
    """

    def __init__(self, client: Any, *, make: Callable[[], Any] | None = None, limits: Limits | None = None) -> None:
        if any(count != 1 for count in client.nthreads().values()):
            raise UsageError(
                "fieldkit needs Dask workers with one thread each",
                remedy="Start them with `dask worker SCHEDULER --nthreads 1 --nworkers N`.",
            )
        self._client, self._seconds = client, math.inf if limits is None else limits.seconds
        self._name = f"fieldkit-{uuid.uuid4().hex}"
        self._running: dict[Future[Any], Any] = {}
        # Every worker keeps it, also later ones; scattered data would be lost with a worker.
        client.register_plugin(_keeper(self._name, make))

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **keywords: Any) -> Future[Any]:
        """The future of a call on the cluster."""
        found: Future[Any] = Future()
        found.set_running_or_notify_cancel()
        call = partial(function, *arguments, **keywords) if keywords else function
        given = () if keywords else arguments
        # Not pure: repeats must be computed, not taken from the scheduler's memory.
        self._running[found] = self._client.submit(_called, self._name, self._seconds, call, *given, pure=False)
        self._running[found].add_done_callback(partial(self._settle, found))
        return found

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End: after all calls, or with ``cancel_futures`` at once. The client and its cluster stay open."""
        if cancel_futures:
            self._client.cancel(list(self._running.values()), force=True)
        elif wait:
            for future in list(self._running):
                future.exception()
        self._client.unregister_worker_plugin(self._name)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.shutdown(cancel_futures=kind is not None)

    def _settle(self, found: Future[Any], answer: Any) -> None:
        self._running.pop(found, None)
        if answer.status == "finished":
            found.set_result(answer.result())
        elif answer.status == "cancelled":
            found.set_exception(WorkerError("the executor was broken off"))
        else:
            error = answer.exception()
            died = type(error).__name__ == "KilledWorker"
            found.set_exception(WorkerError(f"KilledWorker: {error}") if died else error)


def _keeper(name: str, make: Callable[[], Any] | None) -> Any:
    import distributed

    return type("Keeper", (distributed.WorkerPlugin,), {"name": name, "make": (make,), "own": None})()


def _called(name: str, seconds: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """Calls on the worker, on one thread, with the worker's own state if there is one."""
    import distributed

    limit_threads(1)
    worker: Any = distributed.get_worker()
    keeper = worker.plugins[name]
    if keeper.own is None:
        (make,) = keeper.make
        keeper.own = () if make is None else (make(),)
    if math.isinf(seconds):
        return function(*keeper.own, *arguments)
    timer = threading.Timer(seconds, os._exit, (_TOO_LONG,))
    timer.daemon = True
    timer.start()
    try:
        return function(*keeper.own, *arguments)
    finally:
        timer.cancel()
