"""Mission files: writers are pure functions from a mission to bytes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from fieldkit.documents.mistaken import refuse_other
from fieldkit.errors import MetadataError, MissionError, about
from fieldkit.missions.autopilots.writing import render
from fieldkit.missions.files.limits import REMEDY
from fieldkit.missions.files.litchi import litchi_bytes, read_litchi
from fieldkit.missions.files.qgc_plan import plan_bytes, read_plan
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.files.waypoints import read_waypoints, waypoints_bytes
from fieldkit.missions.files.wpml import wpml_bytes
from fieldkit.missions.files.wpml_reading import read_wpml
from fieldkit.routing.mission import Mission
from fieldkit.vehicles.vehicle import Vehicle


def _plan(mission: Mission, vehicle: Vehicle) -> bytes:
    items = render(mission, vehicle)
    return plan_bytes(
        items[1:] if vehicle.dialect == "ardupilot" else items,
        home=mission.home,
        dialect=vehicle.dialect,
        cruise_mps=mission.speed_mps,
        fence=mission.fence,
        rally=mission.rally,
    )


def _waypoints(mission: Mission, vehicle: Vehicle) -> bytes:
    items = render(mission, vehicle)
    return waypoints_bytes(items[1:] if vehicle.dialect == "ardupilot" else items, home=mission.home)


def _for_dji(writer: Callable[[Mission, Vehicle], bytes], name: str) -> Callable[[Mission, Vehicle], bytes]:
    def write(mission: Mission, vehicle: Vehicle) -> bytes:
        if vehicle.dialect != "dji":
            raise MissionError(f"{vehicle.title} does not fly {name}", remedy="Export with --format plan.")
        return writer(mission, vehicle)

    return write


FORMATS: dict[str, tuple[str, Callable[[Mission, Vehicle], bytes]]] = {
    "plan": (".plan", _plan),
    "waypoints": (".waypoints", _waypoints),
    "wpml": (".kmz", _for_dji(wpml_bytes, "DJI WPML")),
    "litchi": (".csv", _for_dji(litchi_bytes, "Litchi missions")),
}
"""By the name of --format: the suffix of its files, and the writer."""


def mission_bytes(format: str, mission: Mission, vehicle: Vehicle) -> bytes:  # noqa: A002
    """The file of a mission, the same bytes for the same mission."""
    return FORMATS[format][1](mission, vehicle)


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
    with about(path := Path(path), REMEDY):
        reader = READERS.get(path.suffix.lower())
        if reader is None:
            refuse_other(path, "mission")
            raise MetadataError(f"is of no known mission format ({path.suffix or 'no suffix'})")
        try:
            return reader(path)
        except RecursionError as error:
            raise MetadataError("is nested far too deeply for a mission") from error
