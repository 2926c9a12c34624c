"""Mission files: writers are pure functions from a mission to bytes."""

from __future__ import annotations

from collections.abc import Callable

from fieldkit.errors import MissionError, UsageError
from fieldkit.missions.autopilots.writing import render
from fieldkit.missions.files.litchi import litchi_bytes
from fieldkit.missions.files.qgc_plan import plan_bytes
from fieldkit.missions.files.waypoints import waypoints_bytes
from fieldkit.missions.files.wpml import wpml_bytes
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
    if format not in FORMATS:
        raise UsageError(f"no such format: {format}", remedy=f"Choose one of {', '.join(FORMATS)}.")
    return FORMATS[format][1](mission, vehicle)
