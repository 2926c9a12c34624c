"""Reading files that may come from anywhere: sizes, counts and numbers have limits, and errors are for people."""

from __future__ import annotations

import math
import re
from pathlib import Path

from fieldkit.documents.file_bytes import decoded, file_bytes
from fieldkit.errors import MetadataError

MAX_BYTES = 16 << 20
MAX_ITEMS = 10_000
MAX_POINTS = 5_000
"""Corners of fences and the like."""

_NUMBER = re.compile(r"[+-]?([0-9]{1,24}(\.[0-9]{0,40})?|\.[0-9]{1,40})([eE][+-]?[0-9]{1,3})?")
REMEDY = "Give a .plan, .waypoints, .kmz (DJI WPML) or Litchi .csv file."


def read_bytes(path: Path) -> bytes:
    """The content of a mission file.

    Raises:
        MetadataError: it is missing, unreadable or far too large.
    """
    return file_bytes(path, REMEDY, MAX_BYTES, noun="mission")


def read_text(path: Path) -> str:
    """The same as text, in UTF-8 with or without a byte order mark.

    Raises:
        MetadataError: as `read_bytes`, or it is not text.
    """
    text = decoded(read_bytes(path), path)
    if "\0" in text:
        raise MetadataError("is not text", path=path, remedy=REMEDY)
    return text


def number(text: str) -> float | None:
    """A finite decimal number, or None."""
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if math.isfinite(value) and abs(value) < 1e12 else None


def json_number(value: object) -> float | None:
    """A finite number of a JSON document, or None; also for true, false and integers beyond a double."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        result = float(value)
    except OverflowError:
        return None
    return result if math.isfinite(result) and abs(result) < 1e12 else None
