"""A function over many items, in this process or several; the results do not depend on the number."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing
from functools import partial
from typing import TypeVar

from fieldkit.runtime.worker import Outcome
from fieldkit.runtime.worker_pool import Limits, WorkerPool

Item = TypeVar("Item")
Result = TypeVar("Result")
_FINISH_S = 10.0
"""Seconds that workers have to finish writing when a map is interrupted."""


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
        items: picklable when ``workers`` > 1.
        workers: number of processes; 1 stays in this one.
        advance: called with 1 after each item.

    Raises:
        Exception: the first one raised by an item. Items in progress may finish first; no others are started.
        WorkerError: a worker died.
    """
    workers = min(workers, len(items))
    if workers <= 1:
        return _in_turn(function, items, advance)
    results: dict[int, Result] = {}
    with closing(each_in_workers(function, items, workers=workers, finish_seconds=_FINISH_S)) as finished:
        for number, outcome in finished:
            results[number] = outcome.get()
            advance(1)
    return [results[number] for number in range(len(items))]


def each_in_workers(
    function: Callable[[Item], Result], items: Sequence[Item], *, workers: int, finish_seconds: float = 0.0
) -> Generator[tuple[int, Outcome[Result]], None, None]:
    """Numbers and outcomes of items in order of completion, from watched worker processes (`WorkerPool`).

    A worker that dies loses only its item, which is not tried again. All workers have ended when the iteration ends or
    is left.

    Args:
        function: picklable.
        items: picklable.
        workers: number of processes, at least one; even one keeps a crash away from the caller.
        finish_seconds: time for items in progress to finish when the iteration is left.
    """
    limits = Limits(finish_seconds=finish_seconds)
    with WorkerPool[Item, Result](partial(_given, function), workers=workers, limits=limits) as pool:
        left = {pool.submit(item) for item in items}
        while left:
            for number, outcome in pool.collect():
                left.remove(number)
                yield number, outcome


def _given(function: Callable[[Item], Result]) -> Callable[[Item], Result]:
    return function


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
        futures = [pool.submit(function, item) for item in items]
        for future in as_completed(futures):
            future.result()
            advance(1)
        return [future.result() for future in futures]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _in_turn(function: Callable[[Item], Result], items: Sequence[Item], advance: Callable[[int], None]) -> list[Result]:
    results = []
    for item in items:
        results.append(function(item))
        advance(1)
    return results
