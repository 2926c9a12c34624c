"""The same function over many items, in this process or in several; the results do not depend on how many."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from typing import TypeVar

from fieldkit.runtime.threads import limit_threads, set_thread_environment

Item = TypeVar("Item")
Result = TypeVar("Result")


def map_parallel(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    workers: int,
    advance: Callable[[int], None] = lambda _: None,
) -> list[Result]:
    """``[function(item) for item in items]``, one thread per worker process.

    Args:
        function: picklable (defined at module level, or a partial of such) when ``workers`` > 1.
        items: picklable likewise.
        workers: processes; 1 stays in this one.
        advance: called with 1 after each item.
    """
    workers = min(workers, len(items))
    if workers <= 1:
        return _in_turn(function, items, advance)
    # Forking a process that has threads (progress display, OpenCV) can deadlock the child.
    context = multiprocessing.get_context("spawn")
    return _in_pool(
        ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker), function, items, advance
    )


def map_threads(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    workers: int,
    advance: Callable[[int], None] = lambda _: None,
) -> list[Result]:
    """As `map_parallel`, on threads of this process, for functions that do without the interpreter's lock."""
    workers = min(workers, len(items))
    if workers <= 1:
        return _in_turn(function, items, advance)
    return _in_pool(ThreadPoolExecutor(workers), function, items, advance)


def _in_turn(function: Callable[[Item], Result], items: Sequence[Item], advance: Callable[[int], None]) -> list[Result]:
    results = []
    for item in items:
        results.append(function(item))
        advance(1)
    return results


def _in_pool(
    pool: Executor, function: Callable[[Item], Result], items: Sequence[Item], advance: Callable[[int], None]
) -> list[Result]:
    try:
        futures = [pool.submit(function, item) for item in items]
        for future in as_completed(futures):
            future.result()
            advance(1)
        return [future.result() for future in futures]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _start_worker() -> None:
    set_thread_environment(1)
    limit_threads(1)
