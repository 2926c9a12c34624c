"""A neutral mission in the words of an autopilot."""

from __future__ import annotations

from collections.abc import Callable

from fieldkit.errors import MissionError
from fieldkit.missions.autopilots.ardupilot import writing as ardupilot
from fieldkit.missions.autopilots.item_checks import check_items
from fieldkit.missions.autopilots.px4 import writing as px4
from fieldkit.missions.items import MissionItem
from fieldkit.routing.mission import Mission
from fieldkit.vehicles.vehicle import Vehicle

Renderer = Callable[[Mission, Vehicle], tuple[MissionItem, ...]]

DIALECTS: dict[str, Renderer] = {"ardupilot": ardupilot.render, "px4": px4.render}


def render(mission: Mission, vehicle: Vehicle) -> tuple[MissionItem, ...]:
    """The mission's items in the vehicle's dialect, in the order they are uploaded, every one range-checked.

    Raises:
        MissionError: the dialect has no mission items, or one of the mission's stops is none that it takes; or there
            are more items than the vehicle stores.
    """
    renderer = DIALECTS.get(vehicle.dialect)
    if renderer is None:
        raise MissionError(
            f"{vehicle.title} takes no mission items", remedy="Export with --format wpml or --format litchi."
        )
    items = renderer(mission, vehicle)
    check_items(items, vehicle.dialect, [shot.name for shot in mission.shots])
    if vehicle.max_items is not None and len(items) > vehicle.max_items:
        raise MissionError(
            f"the mission has {len(items)} items; {vehicle.title} stores {vehicle.max_items}",
            remedy="Fly fewer plots at once.",
        )
    return items
