"""Check for implausible numbers before they reach a drawing."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fieldkit.errors import MetadataError

LARGEST = 1e9
"""Largest number that is not a count: metres, pixels, seconds, degrees."""

LARGEST_COUNT = 2**64


def check_plausible(values: Any, file: Path) -> None:
    """Refuse numbers that would cause overflows.

    Args:
        values: mappings, sequences and plain values, as pydantic and dataclasses dump them.
        file: source of the values.

    Raises:
        MetadataError: a number beyond `LARGEST` or `LARGEST_COUNT`, or not finite; the message names it.
    """
    waiting: list[tuple[str, Any]] = [("", values)]
    while waiting:
        key, value = waiting.pop()
        if isinstance(value, Mapping):
            waiting += [(f"{key}.{name}" if key else str(name), inner) for name, inner in value.items()]
        elif isinstance(value, list | tuple):
            waiting += [(f"{key}.{place}", inner) for place, inner in enumerate(value)]
        elif isinstance(value, float):
            if not abs(value) <= LARGEST:  # also for NaN
                raise _implausible(key, file)
        elif isinstance(value, int) and abs(value) > LARGEST_COUNT:
            raise _implausible(key, file)


def _implausible(key: str, file: Path) -> MetadataError:
    return MetadataError(
        f"{key[:200]}: is a number that no measurement gives", path=file, remedy="Make the result again."
    )
