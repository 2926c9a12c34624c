"""The cores and memory that this process may use, within limits of a container or job, and the time that work takes."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

_WORKER_BYTES = 1_600_000_000
"""Memory of a process that reconstructs or evaluates: at most 1.5 GB were measured."""


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

    Linux alone has them; those of version 1 are not read. ``proc`` names the process's groups, as in cgroups(7);
    ``root`` is where the hierarchy is mounted.
    """
    group = next((line[3:] for line in _text(proc).splitlines() if line.startswith("0::")), None)
    if group is None:
        return None, None
    # Inside a container the group's path may not exist below the mount; the root is then the container's group.
    folders = [root / str(place).lstrip("/") for place in (PurePosixPath(group), *PurePosixPath(group).parents)]
    quotas = [_text(folder / "cpu.max").split() for folder in folders]
    memory = [_text(folder / "memory.max").strip() for folder in folders]
    cores = [int(quota[0]) / int(quota[1]) for quota in quotas if len(quota) == 2 and quota[0] != "max"]
    return min(cores, default=None), min((int(most) for most in memory if most.isdecimal()), default=None)


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8", "replace")
    except OSError:
        return ""


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
