"""The cores and memory that this process may use, within limits of a container or job, and the time that work takes."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

_WORKER_BYTES = 1_600_000_000
"""Memory of a process that reconstructs or evaluates: at most 1.5 GB were measured."""

_UNLIMITED = 1 << 60  # cgroup v1 writes a huge number where v2 writes "max"


@dataclass(frozen=True)
class Machine:
    """The resources of this process."""

    cores: int
    """Whole cores, at least 1."""
    memory_bytes: int
    """Total."""
    available_bytes: int
    """Memory that can be taken now without swapping."""


def this_machine() -> Machine:
    """Cores by CPU affinity and quota, memory as installed and allowed."""
    import psutil

    most_cores, most_bytes = cgroup_limits()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if most_cores is not None:
        cores = min(cores, max(1, round(most_cores)))
    memory = psutil.virtual_memory()
    total, available = int(memory.total), int(memory.available)
    if most_bytes is not None and most_bytes < total:
        total = most_bytes
        available = min(available, max(0, total - int(psutil.Process().memory_info().rss)))
    return Machine(cores, total, available)


def usual_workers() -> int:
    """Number of processes where nobody gives one: as many as there are cores, and memory for."""
    machine = this_machine()
    return max(1, min(machine.cores, machine.available_bytes // _WORKER_BYTES))


def cgroup_limits(
    proc: Path = Path("/proc/self/cgroup"), root: Path = Path("/sys/fs/cgroup")
) -> tuple[float | None, int | None]:
    """The least cores and bytes of memory on the way from this process's control groups up to the root; None: no limit.

    Linux alone has them, cgroup v1 and v2.
    ``proc`` names the process's groups, as in cgroups(7); ``root`` is where the hierarchies are mounted.
    """
    try:
        lines = proc.read_text("utf-8", "replace").splitlines()
    except OSError:
        return None, None
    cores: list[float] = []
    memory: list[int] = []
    for line in lines:
        _, _, rest = line.partition(":")
        controllers, _, group = rest.partition(":")
        for folder in _folders(root, controllers, group):
            cores += [value for value in (_cores(folder),) if value is not None]
            memory += [value for value in (_memory(folder),) if value is not None]
    return min(cores, default=None), min(memory, default=None)


def _folders(root: Path, controllers: str, group: str) -> Iterator[Path]:
    # Inside a container the group's path may not exist below the mount; the root is then the container's group.
    path = PurePosixPath(group)
    places = [path, *path.parents]
    for name in controllers.split(",") if controllers else [""]:
        for place in places:
            yield root / name / str(place).lstrip("/")


def _cores(folder: Path) -> float | None:
    v2 = _words(folder / "cpu.max")
    if len(v2) == 2 and v2[0] != "max":
        return int(v2[0]) / int(v2[1])
    quota, period = _words(folder / "cpu.cfs_quota_us"), _words(folder / "cpu.cfs_period_us")
    if quota and period and int(quota[0]) > 0:
        return int(quota[0]) / int(period[0])
    return None


def _memory(folder: Path) -> int | None:
    for name in ("memory.max", "memory.limit_in_bytes"):
        words = _words(folder / name)
        if words and words[0] != "max" and int(words[0]) < _UNLIMITED:
            return int(words[0])
    return None


def _words(path: Path) -> list[str]:
    try:
        return path.read_text("ascii", "replace").split()
    except OSError:
        return []


def processor_seconds() -> float:
    """CPU time (user + system) of this process and, where the system keeps it, of its finished children, seconds."""
    spent = os.times()
    return time.process_time() + spent.children_user + spent.children_system


@dataclass(frozen=True)
class Spent:
    """When work began: wall and CPU clock, seconds."""

    wall: float
    cpu: float

    @classmethod
    def now(cls) -> Spent:
        return cls(time.perf_counter(), processor_seconds())

    @property
    def seconds(self) -> float:
        """Wall time since then."""
        return time.perf_counter() - self.wall

    @property
    def cpu_seconds(self) -> float:
        """CPU time since then, finished child processes included."""
        return processor_seconds() - self.cpu
