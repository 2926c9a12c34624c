"""What a run carries through its functions: cache, progress, workers and seed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, TypeVar

from fieldkit.cache import StageCache, default_cache_root
from fieldkit.runtime.executor import check_main_guard, map_parallel, open_executor
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.runtime.worker import Limits

Item = TypeVar("Item")
Result = TypeVar("Result")


def _no_cache() -> StageCache:
    return StageCache(None)


@dataclass(frozen=True, eq=False)
class Context:
    """How a run computes. No result depends on it but for the seed.

    Raises UsageError: workers are wanted where none can be started (`check_main_guard`).
    """

    cache: StageCache = field(default_factory=_no_cache)
    progress: Progress = field(default_factory=Silent)
    """Told of stages and remarks."""
    workers: int = 1
    seed: int = 0
    scheduler: str = ""
    """Address of a Dask cluster that computes instead of processes; its workers see the same files."""

    def __post_init__(self) -> None:
        if self.workers > 1 and not self.scheduler:
            check_main_guard()

    @classmethod
    def usual(
        cls,
        cache: StageCache | None = None,
        progress: Progress | None = None,
        workers: int = 1,
        seed: int = 0,
        scheduler: str = "",
    ) -> Context:
        """A context with the cache in the usual place, and silence, where there is None."""
        return cls(cache or StageCache(default_cache_root()), progress or Silent(), workers, seed, scheduler)

    def executor(
        self, *, make: Callable[[], Any] | None = None, limits: Limits | None = None
    ) -> AbstractContextManager[Executor]:
        """See `open_executor`."""
        return open_executor(self.workers, self.scheduler, make=make, limits=limits)

    def map(
        self, function: Callable[[Item], Result], items: Sequence[Item], advance: Callable[[int], None] = lambda _: None
    ) -> list[Result]:
        """See `map_parallel`."""
        return map_parallel(function, items, workers=self.workers, scheduler=self.scheduler, advance=advance)
