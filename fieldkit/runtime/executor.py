"""One executor with the interface of concurrent.futures: watched worker processes, or a Dask cluster."""

from __future__ import annotations

import ast
import math
import multiprocessing
import pickle
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import psutil

from fieldkit.errors import UsageError
from fieldkit.runtime.threads import set_memory_environment, set_thread_environment
from fieldkit.runtime.worker import Answer, Limits, NoWorkersError, WorkerError, work

Item = TypeVar("Item")
Result = TypeVar("Result")
_ATTEMPTS = 2
"""Number of workers that an item may end before it fails."""
_FAILED_STARTS = 2
"""Number of failed starts for each worker before none can be had."""
_POLL_S = 0.2
"""Time between two looks at limits, seconds."""
_STOP_S = 2.0
"""Time for a worker to end by itself, seconds."""
_START_S = 300.0
"""Time for a worker to start: importing libraries, making its state."""
_FINISH_S = 10.0
"""Seconds that workers have to finish writing when a map is interrupted."""


def lacks_main_guard() -> bool:
    """Whether the call comes from a script's top level, which a spawned process would run again.

    What is typed in, given by ``-c`` or in a notebook, and what ``python -m PACKAGE`` starts, is not run again.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):  # it is being run again
        return True
    main = sys.modules["__main__"]
    file, spec = getattr(main, "__file__", None), getattr(main, "__spec__", None)
    if file is None or (spec is not None and spec.name.endswith("__main__")):
        return False
    frame, top = sys._getframe(), ("<module>", Path(file).name)
    while frame.f_globals is not main.__dict__ or (frame.f_code.co_name, Path(frame.f_code.co_filename).name) != top:
        if frame.f_back is None:
            return False
        frame = frame.f_back
    try:
        blocks = [node for node in ast.walk(ast.parse(Path(file).read_bytes())) if isinstance(node, ast.If)]
    except (OSError, SyntaxError, ValueError):  # from standard input
        return True
    return not any(
        node.lineno <= frame.f_lineno <= (node.end_lineno or 0) and "__name__" in ast.dump(node.test) for node in blocks
    )


def check_main_guard() -> None:
    """Raise UsageError where `lacks_main_guard`, before any work is done."""
    if lacks_main_guard():
        raise UsageError(
            "worker processes run a script's top level again, and this call stands there",
            path=getattr(sys.modules["__main__"], "__file__", None),
            remedy='Put it below `if __name__ == "__main__":`, or give workers=1.',
        )


@contextmanager
def open_executor(
    workers: int, scheduler: str = "", *, make: Callable[[], Any] | None = None, limits: Limits | None = None
) -> Iterator[Executor]:
    """An executor of worker processes on this machine, or of a Dask cluster's workers. One thread computes in each.

    Both have the interface of `concurrent.futures`. A call whose worker dies (killed, out of memory, too long) is
    repeated once, and then ends with an error; the others go on. An error that leaves the block, such as Ctrl-C, stops
    all calls.

    Args:
        scheduler: address of a Dask scheduler; empty for processes.
        make: called once in each worker; what it gives is the first argument of every call. Picklable, as are
            functions, arguments and results.
        limits: of each worker. A cluster's memory is limited by its own workers.
    """
    if scheduler:
        from fieldkit.runtime.cluster import open_cluster

        with open_cluster(scheduler, make, limits or Limits()) as cluster:
            yield cluster
    else:
        with Processes(workers, make=make, limits=limits) as processes:
            yield processes


def map_parallel(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    workers: int,
    scheduler: str = "",
    advance: Callable[[int], None] = lambda _: None,
) -> list[Result]:
    """``[function(item) for item in items]`` on an executor; with one worker in this process.

    ``advance`` is called with 1 after each item. The first error of an item is raised: items in progress may finish
    first, no others are started.
    """
    if not items or (not scheduler and min(workers, len(items)) == 1):
        return _in_turn(function, items, advance)
    with open_executor(min(workers, len(items)), scheduler, limits=Limits(finish_seconds=_FINISH_S)) as executor:
        return _gathered([executor.submit(function, item) for item in items], advance)


def map_threads(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    workers: int,
    advance: Callable[[int], None] = lambda _: None,
) -> list[Result]:
    """As `map_parallel`, on threads of this process, for functions that release the interpreter's lock."""
    workers = min(workers, len(items))
    if workers <= 1:
        return _in_turn(function, items, advance)
    pool = ThreadPoolExecutor(workers)
    try:
        return _gathered([pool.submit(function, item) for item in items], advance)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _in_turn(function: Callable[[Item], Result], items: Sequence[Item], advance: Callable[[int], None]) -> list[Result]:
    results = []
    for item in items:
        results.append(function(item))
        advance(1)
    return results


def _gathered(futures: Sequence[Future[Result]], advance: Callable[[int], None]) -> list[Result]:
    for future in as_completed(futures):
        future.result()
        advance(1)
    return [future.result() for future in futures]


class _Reply(Future[Any]):
    """The future of a call; fieldkit's warnings in the worker are given to the first who asks for the result."""

    warned: tuple[Warning, ...] = ()

    def result(self, timeout: float | None = None) -> Any:
        found = super().result(timeout)
        given, self.warned = self.warned, ()
        for warning in given:
            warnings.warn(warning, stacklevel=2)
        return found


@dataclass(eq=False)
class _Call:
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    keywords: dict[str, Any]
    future: _Reply
    attempts: int = 0


class _Worker:
    """A process and its call."""

    def __init__(self, make: Callable[[], Any] | None, limits: Limits) -> None:
        # Libraries read these when they are imported, which is before the worker's first line runs.
        set_thread_environment()
        set_memory_environment()
        # Forking a process that has threads (progress display, OpenCV) can deadlock the child.
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(
            target=work, args=(theirs, make), daemon=True, name="fieldkit-worker"
        )
        self.process.start()
        theirs.close()
        self.limits = limits
        self.ready = False
        self.doing: _Call | None = None
        self.deadline = time.monotonic() + _START_S

    def give(self, call: _Call) -> None:
        """Send a call; one that cannot be sent ends with the error."""
        try:
            with suppress(OSError):  # a worker that just died is noticed later
                self.connection.send((call.function, call.arguments, call.keywords))
        except Exception as error:
            call.future.set_exception(error)
            return
        call.attempts += 1
        self.doing = call
        self.deadline = time.monotonic() + self.limits.seconds

    def excess(self) -> str:
        """Why it has to be killed; empty if it does not."""
        if (self.doing is not None or not self.ready) and time.monotonic() > self.deadline:
            allowed = self.limits.seconds if self.ready else _START_S
            return f"it took longer than {allowed:g} s"
        if math.isfinite(self.limits.memory_bytes):
            with suppress(psutil.Error):
                used, most = psutil.Process(self.process.pid).memory_info().rss, self.limits.memory_bytes
                if used > most:
                    return f"it used {used / 2**30:.1f} GiB of memory, more than {most / 2**30:.1f} GiB"
        return ""

    def last_words(self) -> str:
        self.process.join(_STOP_S)
        code = self.process.exitcode
        if code is not None and code < 0:
            with suppress(ValueError):
                name = signal.Signals(-code).name
                return f"its process was ended by {name}" + (" (out of memory?)" if name == "SIGKILL" else "")
        return f"its process ended with exit code {code}"


class Processes(Executor):
    """Calls side by side in worker processes of one thread each; see `open_executor`.

    Workers are spawned when there are calls and reused; dead ones are replaced. They end within a second or two if
    their parent is killed. A call whose worker died is repeated when no other one waits or runs, since several at once
    may have been too much for the memory. Raises as `check_main_guard`.
    """

    def __init__(self, workers: int, *, make: Callable[[], Any] | None = None, limits: Limits | None = None) -> None:
        if workers < 1:
            raise ValueError("an executor needs at least one worker")
        check_main_guard()
        self._make, self._count, self._limits = make, workers, limits or Limits()
        self._waiting: deque[_Call] = deque()
        self._again: deque[_Call] = deque()
        self._workers: list[_Worker] = []
        self._failed_starts = 0
        self._closing = self._broken_off = False
        self._woken, self._waker = multiprocessing.get_context("spawn").Pipe(duplex=False)
        resource_tracker.ensure_running()  # else the thread would start it, with Ctrl-C held back
        self._thread = threading.Thread(target=self._manage, daemon=True, name="fieldkit-executor")
        self._thread.start()

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **keywords: Any) -> Future[Any]:
        """The future of a call in a worker."""
        if self._closing:
            raise RuntimeError("this executor has ended")
        call = _Call(function, arguments, keywords, _Reply())
        self._waiting.append(call)
        self._waker.send_bytes(b".")
        return call.future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all workers: after all calls, or with ``cancel_futures`` once running ones had their time to finish."""
        if not self._closing or cancel_futures:
            self._closing, self._broken_off = True, self._broken_off or cancel_futures
            with suppress(OSError):
                self._waker.send_bytes(b".")
        if wait:
            self._thread.join()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.shutdown(cancel_futures=kind is not None)

    def _manage(self) -> None:
        """The executor's thread: alone it starts, feeds, watches and ends the workers."""
        if hasattr(signal, "pthread_sigmask"):
            # Ctrl-C in a terminal reaches all processes, and would end a worker that is importing with a traceback.
            # Processes that are started here hold it back, too, until they ignore it.
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            while not self._broken_off and (self._open or not self._closing):
                self._hand_out()
                self._look()
        except Exception as error:  # what `make` is cannot be sent, or no process can be started
            self._fail_waiting(error)
        finally:
            self._closing = True
            self._end()

    @property
    def _busy(self) -> int:
        return sum(worker.doing is not None for worker in self._workers)

    @property
    def _open(self) -> int:
        """Number of calls without an answer."""
        return self._busy + len(self._waiting) + len(self._again)

    def _hand_out(self) -> None:
        """Give calls to idle workers, and start those that are missing."""
        while len(self._workers) < min(self._count, self._open):
            self._workers.append(_Worker(self._make, self._limits))
        for worker in self._workers:
            while worker.ready and worker.doing is None and (call := self._next()):
                if call.attempts or call.future.set_running_or_notify_cancel():
                    worker.give(call)

    def _next(self) -> _Call | None:
        if self._waiting:
            return self._waiting.popleft()
        return self._again.popleft() if self._again and not self._busy else None

    def _look(self) -> None:
        """Handle answers, deaths and exceeded limits; wait for the first of them, or for a new call."""
        connections: list[Connection] = [worker.connection for worker in self._workers]
        sentinels = [worker.process.sentinel for worker in self._workers]
        heard = wait([self._woken, *connections, *sentinels], timeout=_POLL_S if self._workers else None)
        while self._woken.poll():
            self._woken.recv_bytes()
        for worker in list(self._workers):
            reason = ""
            if worker.connection in heard:
                try:
                    self._take(worker, pickle.loads(worker.connection.recv_bytes()))
                    continue
                except (EOFError, OSError):
                    reason = worker.last_words()
            elif worker.process.sentinel in heard:
                reason = worker.last_words()
            reason = reason or worker.excess()
            if reason:
                self._lost(worker, reason)

    def _take(self, worker: _Worker, answer: Answer) -> None:
        call, worker.doing = worker.doing, None
        if call is not None:
            if isinstance(answer.error, MemoryError):
                self._settle(call, answer.error)
            elif answer.error is not None:
                call.future.set_exception(answer.error)
            else:
                call.future.warned = answer.warned
                call.future.set_result(answer.result)
        elif answer.error is None:
            worker.ready, self._failed_starts = True, 0
        else:
            self._stop(worker)
            self._fail_waiting(answer.error)

    def _lost(self, worker: _Worker, reason: str) -> None:
        self._stop(worker)
        if worker.doing is not None:
            remedy = "Give it more memory, or take fewer --workers."
            self._settle(worker.doing, WorkerError(f"a worker process died: {reason}", remedy=remedy))
        elif not worker.ready:
            self._failed_starts += 1
            if self._failed_starts > _FAILED_STARTS * self._count:
                self._failed_starts = 0
                error = NoWorkersError(f"worker processes do not start: {reason}", remedy="Run `fieldkit doctor`.")
                self._fail_waiting(error)

    def _settle(self, call: _Call, error: Exception) -> None:
        """Repeat a call whose worker died, or end it."""
        if call.attempts < _ATTEMPTS:
            self._again.append(call)
        else:
            call.future.set_exception(error)

    def _fail_waiting(self, error: Exception) -> None:
        for call in (*self._waiting, *self._again):
            if call.attempts or call.future.set_running_or_notify_cancel():
                call.future.set_exception(error)
        self._waiting.clear()
        self._again.clear()

    def _stop(self, worker: _Worker) -> None:
        """Kill a worker and wait for its end."""
        worker.connection.close()
        if worker.process.is_alive():
            worker.process.kill()
        worker.process.join()
        self._workers.remove(worker)

    def _end(self) -> None:
        """End all workers; calls without an answer are cancelled."""
        until = time.monotonic() + self._limits.finish_seconds
        for worker in self._workers:
            worker.connection.close()
        for worker in list(self._workers):
            worker.process.join(_STOP_S if worker.doing is None else max(0.0, until - time.monotonic()))
            self._stop(worker)
            if worker.doing is not None:
                self._again.append(worker.doing)
        for call in (*self._waiting, *self._again):
            if not call.future.cancel():
                call.future.set_exception(WorkerError("the executor was broken off"))
        self._woken.close()
