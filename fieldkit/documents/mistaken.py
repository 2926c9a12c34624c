"""What a file or folder is that was given in the place of another."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

from fieldkit.documents import safe_toml
from fieldkit.errors import InputError, MetadataError
from fieldkit.regular_files import read_regular

_PICTURES = frozenset({".jpg", ".jpeg", ".png", ".tif", ".tiff", ".dng", ".arw", ".cr2", ".nef"})
_SUFFIXES = {
    ".plan": "mission", ".waypoints": "mission", ".kmz": "mission", ".geojson": "file of plots or zones",
    ".shp": "file of plots or zones", ".gpkg": "file of plots or zones", ".kml": "file of plots or zones",
    ".tlog": "flight log", ".bin": "flight log", ".ulg": "flight log", ".ply": "point cloud", ".las": "point cloud",
    ".laz": "point cloud",
} | dict.fromkeys(_PICTURES, "picture")  # fmt: skip
_MARKERS = {
    "campaign.toml": "campaign", "demo.json": "demo", "reference.json": "reference", "evaluation.json": "evaluation",
    "plan.json": "plan", "search.json": "run of fieldkit plan without a plan yet",
}  # fmt: skip
"""By the file that a result's folder holds; campaigns and demos hold others' files, too."""
_KEYS = {"home": "site file", "dialect": "vehicle profile", "mount": "vehicle profile", "plot": "scene file"}
_MOST_BYTES, _MOST_ENTRIES = 1 << 20, 200


def refuse_other(path: Path, noun: str, remedy: str, *, error: type[InputError] = MetadataError) -> None:
    """Say what was given instead, where that can be told; nothing is said of what may be the right thing.

    Args:
        path: a file or folder, or a missing file of a result's folder.
        noun: what is wanted: "plan", "reference", "evaluation", "campaign", "site file", "scene file", "vehicle
            profile" or "mission".
        remedy: of the error.
        error: what is raised.

    Raises:
        InputError: of the kind ``error``: it is something else.
    """
    given = path.parent if path.name in _MARKERS and not path.exists() and path.name != path.as_posix() else path
    found = next(_kinds(given), None)
    if found is not None and found != noun:
        raise error(f"is {_with_article(found)}, not {_with_article(noun)}", path=given, remedy=remedy)


def _with_article(noun: str) -> str:
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def _kinds(path: Path) -> Iterator[str]:
    """What it is, if that can be told."""
    with suppress(OSError, ValueError, RecursionError):
        if path.is_dir():
            held = {entry.name for entry in islice(path.iterdir(), _MOST_ENTRIES)}
            yield from (kind for name, kind in _MARKERS.items() if name in held)
            inside = (entry for part in sorted(held) for entry in _first(path / part))
            result = any(name.endswith((".json", ".ply")) for name in held)  # with its own pictures
            if not result and any(entry.suffix.lower() in _PICTURES for entry in inside):
                yield "folder of photographs"
        elif path.suffix.lower() == ".toml":
            document = safe_toml.loads(read_regular(path, _MOST_BYTES).decode("utf-8-sig"))
            yield from (kind for key, kind in _KEYS.items() if key in document)
        elif path.is_file() and path.suffix.lower() in _SUFFIXES:
            yield _SUFFIXES[path.suffix.lower()]


def _first(path: Path) -> list[Path]:
    """A file, or the first entries of a folder: a card has a folder for each plot."""
    return list(islice(path.iterdir(), _MOST_ENTRIES)) if path.is_dir() else [path]
