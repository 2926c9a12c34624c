"""Compilation of the numeric kernels, and the cache of their machine code."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.caching import FunctionCache

from fieldkit.cache import CacheWarning

# Reordered sums allow vector instructions. The cached machine code keeps the order the same in every process on a
# machine; other processors may differ in the last bits.
_FAST = {"reassoc", "contract", "arcp", "nsz", "nnan", "ninf"}


class _Cache(FunctionCache):
    """Numba's cache of machine code, except that a full disk is no error."""

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        except OSError as error:
            _warn(error.strerror or str(error))


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function on its first call, for one thread and without the interpreter's lock.

    The machine code is cached beside the package or, if that is read-only, in the user's cache folder (NUMBA_CACHE_DIR
    chooses another). If neither is writable, every process compiles, with a `CacheWarning`. A kernel may only use
    kernels and constants of its own file: changes elsewhere would go unnoticed.
    """
    return _kept(function, njit(nogil=True)(function))


def inline_kernel(function: Callable[..., Any]) -> Any:
    """As `kernel`, compiled into every kernel that calls it."""
    return _kept(function, njit(nogil=True, inline="always")(function))


def fast_kernel(function: Callable[..., Any]) -> Any:
    """As `kernel`, with sums that may be reordered and without checks for division by zero."""
    return _kept(function, njit(fastmath=_FAST, error_model="numpy", nogil=True)(function))


def inline_fast_kernel(function: Callable[..., Any]) -> Any:
    """As `fast_kernel`, compiled into every kernel that calls it; for one that takes tuples of arrays in a loop."""
    return _kept(function, njit(fastmath=_FAST, error_model="numpy", nogil=True, forceinline=True)(function))


def _kept(function: Callable[..., Any], compiled: Any) -> Any:
    try:
        compiled._cache = _Cache(function)  # type: ignore[no-untyped-call]
    except RuntimeError as error:
        _warn(str(error))
    return compiled


def _warn(why: str) -> None:
    warnings.warn(
        f"the compiled kernels cannot be kept ({why}), so every run compiles them (some ten seconds); "
        "set NUMBA_CACHE_DIR to a folder that can be written to",
        CacheWarning,
        stacklevel=4,
    )
