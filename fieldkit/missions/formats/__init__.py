"""Mission files: writers are pure functions of a mission, and one function writes what they give."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fieldkit.errors import MissionError, UsageError
from fieldkit.files import write_atomic
from fieldkit.missions.dialects import render
from fieldkit.missions.formats.geojson_route import geojson_bytes
from fieldkit.missions.formats.kml import kml_bytes
from fieldkit.missions.formats.litchi import litchi_bytes
from fieldkit.missions.formats.qgc_plan import plan_bytes
from fieldkit.missions.formats.waypoints import waypoints_bytes
from fieldkit.missions.formats.wpml import wpml_bytes
from fieldkit.missions.mission import Mission
from fieldkit.missions.vehicle import Vehicle


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
    "kml": (".kml", lambda mission, _: kml_bytes(mission)),
    "geojson": (".geojson", lambda mission, _: geojson_bytes(mission)),
}
"""By the name of --format: the suffix of its files, and the writer."""


def mission_bytes(format: str, mission: Mission, vehicle: Vehicle) -> bytes:  # noqa: A002
    """The file of a mission, the same bytes for the same mission.

    Raises:
        UsageError: there is no such format.
        MissionError: the vehicle, its dialect or the format does not take the mission.
    """
    if format not in FORMATS:
        raise UsageError(f"no such format: {format}", remedy=f"Choose one of {', '.join(FORMATS)}.")
    return FORMATS[format][1](mission, vehicle)


def write_mission(
    path: Path,
    format: str,  # noqa: A002
    mission: Mission,
    vehicle: Vehicle,
    *,
    overwrite: bool = False,
) -> None:
    """Write a mission file in one step: it is whole, or what was there before is untouched.

    Raises:
        UsageError: there is no such format, or the file exists and ``overwrite`` is off.
        MissionError: the vehicle, its dialect or the format does not take the mission.
        StorageError: the place is full or not writable.
    """
    path = Path(path)
    if path.exists() and not overwrite:
        raise UsageError("exists already", path=path, remedy="Give --overwrite to replace it, or choose another name.")
    write_atomic(path, mission_bytes(format, mission, vehicle))
