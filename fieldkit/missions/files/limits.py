"""Limits of mission files: of what is read from anywhere, and of what the apps that fly them take."""

from __future__ import annotations

import math
import re
from pathlib import Path

from fieldkit.documents.file_bytes import decoded, file_bytes
from fieldkit.errors import MetadataError

MAX_BYTES = 16 << 20
"""Largest mission that is read, bytes."""
MAX_ITEMS = 10_000
"""Most items of a mission."""
MAX_POINTS = 5_000
"""Most corners of fences and the like."""

MOST_WAYPOINTS = {"litchi": 99, "wpml": 200}
"""By format, where the apps that fly it have a limit. Litchi's: its forum's list, "DJI SDK limits". WPML's: not in the
documentation, whose index goes to 65535, but what DJI's apps are said to take."""
APPS = {"litchi": "Litchi", "wpml": "DJI WPML"}
"""What these formats are called for people."""
LEAST_WAYPOINTS = {"litchi": 2, "wpml": 2}
"""DJI's waypoint missions have at least two."""
LONGEST_STAY_S = {"litchi": 32.0}
"""Of one action; from the same list."""

_NUMBER = re.compile(r"[+-]?([0-9]{1,24}(\.[0-9]{0,40})?|\.[0-9]{1,40})([eE][+-]?[0-9]{1,3})?")
REMEDY = "Give a .plan, .waypoints, .kmz (DJI WPML) or Litchi .csv file."


def read_bytes(path: Path) -> bytes:
    """The content of a mission file."""
    return file_bytes(path, MAX_BYTES, noun="mission")


def read_text(path: Path) -> str:
    """The same as text, in UTF-8 with or without a byte order mark."""
    text = decoded(read_bytes(path))
    if "\0" in text:
        raise MetadataError("is not text")
    return text


def number(text: str) -> float | None:
    """A finite decimal number, or None."""
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if math.isfinite(value) and abs(value) < 1e12 else None
