"""Kernels where their machine code cannot be kept."""

import errno
import warnings
from typing import Any

import pytest

from fieldkit.cache import CacheWarning
from fieldkit.runtime import kernels

EVERY = pytest.mark.parametrize("make", [kernels.kernel, kernels.fast_kernel, kernels.inline_fast_kernel])


@EVERY
def test_kernels_that_cannot_be_kept_are_compiled_anyway(make, monkeypatch) -> None:
    def nowhere(function: Any) -> None:
        raise RuntimeError("no locator available")

    monkeypatch.setattr(kernels, "_Cache", nowhere)
    with pytest.warns(CacheWarning, match="NUMBA_CACHE_DIR"):
        twice = make(lambda x: 2 * x)
    assert twice(4) == 8


@EVERY
def test_a_full_disk_under_the_kernels_is_a_warning(make, monkeypatch) -> None:
    def full(*arguments: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("numba.core.caching.FunctionCache.save_overload", full)
    thrice = make(_three_times)
    with pytest.warns(CacheWarning, match="No space left"):
        assert thrice(5) == 15
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert thrice(6) == 18


def _three_times(x: Any) -> Any:
    return 3 * x
