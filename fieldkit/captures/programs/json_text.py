"""JSON of other programs: read with limits, and its numbers taken out with plain errors."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.documents.file_bytes import file_bytes
from fieldkit.errors import MetadataError

REMEDY = "Copy the file again from the program's results."
_LARGEST = 1e12
_MAX_BYTES = 512 << 20


def read_json(path: Path) -> Any:
    """A file's JSON.

    Raises:
        MetadataError: it is unreadable, larger than 512 MiB, or not JSON.
    """
    data = file_bytes(path, REMEDY, _MAX_BYTES, noun="result of OpenDroneMap")
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise MetadataError(f"is not JSON ({error})", path=path, remedy=REMEDY) from error


def number(values: Mapping[str, Any], key: str, otherwise: float | None = None) -> float:
    """A finite number of an object. Raises ValueError: it is missing (without ``otherwise``), or none."""
    value = values.get(key, otherwise)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < _LARGEST:
        raise ValueError(f"{key} is not a number")
    return float(value)


def vector(value: Any, what: str) -> NDArray[np.float64]:
    """(3,) of a list of three finite numbers. Raises ValueError: it is none."""
    if not isinstance(value, list) or len(value) < 3:
        raise ValueError(f"{what} is not three numbers")
    return np.array([number({what: each}, what) for each in value[:3]])
