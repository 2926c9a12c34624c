"""Any mission file, read back: also ones written by others, and hostile ones."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from fieldkit.documents.mistaken import refuse_other
from fieldkit.errors import MetadataError
from fieldkit.missions.files.limits import REMEDY
from fieldkit.missions.files.litchi import read_litchi
from fieldkit.missions.files.qgc_plan import read_plan
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.files.waypoints import read_waypoints
from fieldkit.missions.files.wpml_reading import read_wpml

READERS: dict[str, Callable[[Path], ReadMission]] = {
    ".plan": read_plan,
    ".waypoints": read_waypoints,
    ".txt": read_waypoints,
    ".kmz": read_wpml,
    ".csv": read_litchi,
}
"""By the suffix of files."""


def read_mission_bytes(content: bytes, suffix: str) -> ReadMission:
    """The same of the content of a file whose name has a suffix, such as ".plan"."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"mission{suffix}")
        path.write_bytes(content)
        return read_mission(path)


def read_mission(path: Path) -> ReadMission:
    """Read a .plan, .waypoints, .kmz (DJI WPML) or Litchi .csv file.

    The file's name says its format. Nothing of an archive is unpacked to disk, XML with a document type is refused,
    and sizes, counts and numbers have limits.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        refuse_other(path, "mission", REMEDY)
        raise MetadataError(f"is of no known mission format ({path.suffix or 'no suffix'})", path=path, remedy=REMEDY)
    try:
        return reader(path)
    except RecursionError as error:
        raise MetadataError("is nested far too deeply for a mission", path=path, remedy=REMEDY) from error
