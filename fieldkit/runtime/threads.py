"""Set-up of a process before it computes: thread counts of libraries, and memory."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMBA_NUM_THREADS")
_MEMORY = {"MALLOC_MMAP_THRESHOLD_": 32 << 20, "MALLOC_TRIM_THRESHOLD_": 1 << 30, "MALLOC_TOP_PAD_": 64 << 20}


def set_thread_environment(count: int = 1) -> None:
    """Limit libraries that read their thread count once at import. Call before NumPy is imported.

    Variables that are already set are kept.
    """
    for name in _VARIABLES:
        os.environ.setdefault(name, str(count))


def set_memory_environment() -> None:
    """Make child processes keep freed blocks of up to 32 MB (the C library's limit) for reuse.

    Each layer of a picture's pyramid is such a block; mapping and unmapping it every time makes feature detection a
    third slower. Only the GNU C library reads these variables; variables that are already set are kept.
    """
    for name, size in _MEMORY.items():
        os.environ.setdefault(name, str(size))


def limit_threads(count: int = 1) -> None:
    """Limit the loaded libraries to ``count`` threads in this process (determinism needs 1)."""
    import cv2
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(count)
    threadpool_limits(limits=count)


@contextmanager
def one_torch_thread() -> Iterator[None]:
    """Run PyTorch on one thread within the block: small matrices gain nothing from more, and sums keep their order.

    `limit_threads` affects PyTorch only if it is already loaded.
    """
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
