"""``markers.toml``: printed ArUco or AprilTag markers on the plot, and what is known of their size and distances.

    dictionary = "DICT_4X4_50"      # OpenCV's name; DICT_APRILTAG_36h11 and so on are AprilTags
    side_m = 0.12                   # of the black square as printed; the same for all markers

    [[distance]]                    # measured between the centres of two markers
    a = 3
    b = 7
    distance_m = 1.25

Either ``side_m`` or at least one distance is needed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from fieldkit.captures.tables import read_text
from fieldkit.documents.toml_file import toml_document
from fieldkit.errors import MetadataError

_REMEDY = "Expected dictionary, then side_m or [[distance]] tables with a, b and distance_m, or both."
_KEYS = {"dictionary", "side_m", "distance"}
_DISTANCE_KEYS = {"a", "b", "distance_m"}
_LONGEST_SIDE_M, _LONGEST_DISTANCE_M = 10.0, 10_000.0


@dataclass(frozen=True)
class MarkerDistance:
    """A measured distance between the centres of markers ``a`` and ``b``, metres; ``a`` < ``b``."""

    a: int
    b: int
    distance_m: float


@dataclass(frozen=True)
class MarkersFile:
    """What is known of the markers."""

    dictionary: str
    """Name of one of OpenCV's predefined dictionaries."""
    side_m: float | None = None
    """Length of the black square's side as printed, metres; None where not given."""
    distances: tuple[MarkerDistance, ...] = ()
    """Measured between centres."""


def dictionary_name(name: str) -> str:
    """OpenCV's spelling of a dictionary's name: "4x4_50" and "dict_4X4_50" are "DICT_4X4_50"."""
    wanted = name.strip().upper().removeprefix("DICT_")
    for known in _dictionary_names():
        if known.upper() == f"DICT_{wanted}":
            return known
    raise ValueError(f"there is no dictionary {name!r}; known are {', '.join(_dictionary_names())}")


def marker_dictionary(name: str) -> cv2.aruco.Dictionary:
    """OpenCV's predefined dictionary of that name. Raises ValueError as `dictionary_name` does."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary_name(name)))


def _dictionary_names() -> list[str]:
    """As OpenCV's documentation writes them: its Python module has each AprilTag dictionary twice (36h11, 36H11)."""
    unique: dict[str, str] = {}
    for name in sorted(dir(cv2.aruco), reverse=True):
        if name.startswith("DICT_"):
            unique.setdefault(name.upper(), name)
    return sorted(unique.values())


def read_markers_file(path: Path) -> MarkersFile:
    """The content of a markers.toml."""
    return parse_markers_file(read_text(path), path)


def parse_markers_file(text: str, path: Path | None = None) -> MarkersFile:
    """As `read_markers_file`, from text; ``path`` is for messages."""

    def fail(message: str, remedy: str = _REMEDY) -> MetadataError:
        return MetadataError(message, path=path, remedy=remedy)

    data = toml_document(text, path, _REMEDY)
    for key in sorted(data):
        if key not in _KEYS:
            raise fail(f"unknown key {key[:80]!r}")
    name = data.get("dictionary")
    if not isinstance(name, str) or not name.strip():
        raise fail("no dictionary is given", 'Write, for example, dictionary = "DICT_4X4_50".')
    try:
        dictionary = marker_dictionary(name[:80])
    except ValueError as error:
        raise fail(str(error), "Give the dictionary the markers were printed from.") from error
    side = data.get("side_m")
    if side is not None and _length(side, _LONGEST_SIDE_M) is None:
        raise fail(
            f"side_m must be a length in metres, above 0 and at most {_LONGEST_SIDE_M:g}, not {side!r}",
            "Measure the printed black square and give metres: 12 cm are 0.12.",
        )
    entries = data.get("distance", [])
    if not isinstance(entries, list):
        raise fail("distance must be a list of tables", "Write [[distance]] with two brackets.")
    ids = len(dictionary.bytesList)
    distances = [_distance(entry, f"distance {i}: ", ids, path) for i, entry in enumerate(entries, 1)]
    if side is None and not distances:
        raise fail("neither side_m nor a distance is given, so the markers give no scale")
    seen: dict[tuple[int, int], int] = {}
    for i, entry in enumerate(distances, 1):
        first = seen.setdefault((entry.a, entry.b), i)
        if first != i:
            raise fail(f"distances {first} and {i} are between the same markers {entry.a} and {entry.b}", "Keep one.")
    return MarkersFile(dictionary_name(name), None if side is None else float(side), tuple(distances))


def _length(value: Any, longest: float) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if 0.0 < value <= longest and math.isfinite(value) else None


def _distance(entry: Any, where: str, ids: int, path: Path | None) -> MarkerDistance:
    def fail(message: str) -> MetadataError:
        return MetadataError(where + message, path=path, remedy=_REMEDY)

    if not isinstance(entry, dict):
        raise fail("not a table of values")
    for key in sorted(entry):
        if key not in _DISTANCE_KEYS:
            raise fail(f"unknown key {key[:80]!r}")
    for key in ("a", "b", "distance_m"):
        if key not in entry:
            raise fail(f"{key!r} is missing")
    for key in ("a", "b"):
        value = entry[key]
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < ids:
            raise fail(f"{key} must be a marker's number from 0 to {ids - 1}, not {value!r}")
    if entry["a"] == entry["b"]:
        raise fail(f"a and b are the same marker {entry['a']}")
    length = _length(entry["distance_m"], _LONGEST_DISTANCE_M)
    if length is None:
        raise fail(f"distance_m must be a length in metres above 0, not {entry['distance_m']!r}")
    return MarkerDistance(min(entry["a"], entry["b"]), max(entry["a"], entry["b"]), length)
