"""Memory for arrays that a run holds all at once, or files that the system reads back when they are used."""

from __future__ import annotations

import mmap
import tempfile
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from fieldkit.files import storage_errors
from fieldkit.runtime.machine import this_machine

Scalar = TypeVar("Scalar", bound=np.generic)
_SHARE = 0.5
"""Of the memory that is free, beyond which arrays go to files."""
_PIECE_BYTES = 1 << 24
"""Bytes that are written at a time."""


@dataclass(frozen=True)
class MemoryBudget:
    """Where arrays are put. No result depends on it."""

    folder: Path | None = None
    """Of files without a name, which go with the arrays or the process; None: memory."""

    @classmethod
    def for_bytes(cls, wanted: float, folder: Path | None) -> MemoryBudget:
        """Memory where half of what is free suffices, else files in ``folder`` or the temporary folder."""
        if wanted < _SHARE * this_machine().available_bytes:
            return cls()
        return cls(folder if folder is not None and folder.is_dir() else Path(tempfile.gettempdir()))

    def zeros(self, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """As `numpy.zeros`.

        Raises:
            StorageError: the disk is full.
        """
        if self.folder is None or not prod(shape):
            return np.zeros(shape, dtype)
        size = prod(shape) * np.dtype(dtype).itemsize
        with storage_errors(self.folder), tempfile.TemporaryFile(dir=self.folder) as file:
            for start in range(0, size, _PIECE_BYTES):  # written, since a hole on a full disk ends the process later
                file.write(bytes(min(_PIECE_BYTES, size - start)))
            file.flush()
            return np.frombuffer(mmap.mmap(file.fileno(), size), dtype).reshape(shape)

    def kept(self, array: NDArray[Scalar]) -> NDArray[Scalar]:
        """The array, put here.

        Raises:
            StorageError: the disk is full.
        """
        if self.folder is None:
            return array
        moved = self.zeros(array.shape, array.dtype)
        moved[...] = array
        return moved


MEMORY = MemoryBudget()
