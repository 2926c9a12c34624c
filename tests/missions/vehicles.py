"""Vehicles, missions and recordings that several tests use."""

import json
import math
from pathlib import Path
from typing import Any

from fieldkit.geometry import Intrinsics
from fieldkit.missions.items import MissionItem
from fieldkit.routing.mission import GeoPoint, Home, Mission, Shot, Via
from fieldkit.vehicles.vehicle import Battery, Dialect, Mount, Speeds, Trigger, Vehicle

SITL = Path(__file__).parents[2] / "sim" / "sitl"

HOME = Home(50.8649, 6.4473, 92.0)
_PLACES = frozenset({16, 17, 18, 19, 21, 22, 31, 80, 82, 84, 85, 94, 179, 189, 195, 201, 5000, 4501})


def vehicle(dialect: Dialect = "ardupilot", **changes: Any) -> Vehicle:
    """The vehicle of the recordings: 2 m/s, a gimbal from −90 to 30°, 60°/s about the vertical axis."""
    values: dict[str, Any] = {
        "format": 1,
        "title": {"ardupilot": "Copter", "px4": "PX4 copter", "dji": "DJI Mavic 3 Enterprise"}[dialect],
        "dialect": dialect,
        "autopilot": "ArduCopter 4.5.6",
        "checked": "measured",
        "mount": Mount(kind="pitch", pitch_deg=(-90.0, 30.0)),
        "trigger": Trigger(command="dji" if dialect == "dji" else "image_start_capture", settle_s=4.0, exposure_s=1.0),
        "camera": Intrinsics("PINHOLE", 2000, 1500, (1700.0, 1700.0, 1000.0, 750.0)),
        "speeds": Speeds(cruise_mps=2.0, climb_mps=2.5, descent_mps=1.5, acceleration_mps2=1.0, yaw_dps=60.0),
        "battery": Battery(endurance_s=1200.0, reserve=0.25),
        "min_height_m": 1.0,
        "acceptance_m": 0.2,
        "gps_accuracy_m": 0.02,
        "clearance_m": 0.5,
        "max_items": 650 if dialect == "ardupilot" else None,
    }
    return Vehicle(**(values | changes))


def recording(name: str) -> dict[str, Any]:
    """A recording's JSON."""
    document: dict[str, Any] = json.loads((SITL / f"{name}.json").read_text())
    return document


def item_of(entry: dict[str, Any]) -> MissionItem:
    """An item as the recordings' JSON has it: degrees × 1e7 of positional commands."""
    scale = 1e-7 if entry["cmd"] in _PLACES else 1.0
    x, y = (round(entry[key] * scale, 7) for key in ("x", "y"))
    p1, p2, p3, p4 = (float(v) for v in entry["p"])
    return MissionItem(entry["cmd"], entry["frame"], (p1, p2, p3, p4, x, y, float(entry["z"])))


def recorded_items(name: str) -> list[MissionItem]:
    """The items a recording sent, home first."""
    return [item_of(entry) for entry in recording(name)["items"]]


def recorded_mission(name: str = "mount_then_yaw", settle_s: float = 4.0) -> Mission:
    """The neutral mission of a recording's stations."""
    document = recording(name)
    shots = tuple(
        Shot.at(GeoPoint(s["lat"] * 1e-7, s["lon"] * 1e-7, s["h"]), s["yaw"], s["pitch"], "plot", s["i"])
        for s in document["stations"]
    )
    latitude, longitude, amsl, _ = document["home"]
    return Mission(
        "recorded",
        Home(latitude, longitude, amsl),
        3.0,
        shots,
        GeoPoint(latitude, longitude, 3.0),
        speed_mps=2.0,
        settle_s=settle_s,
        exposure_s=1.0,
    )


def small_mission(vias: bool = True) -> Mission:
    """Three photographs about a plot, with a place on the way."""
    shots = [
        Shot.at(GeoPoint(50.8650225, 6.4473, 1.5), 180.0, -21.801, "plot-1", 0),
        Shot.at(GeoPoint(50.8650128, 6.4473293, 3.5), 235.385, -50.194, "plot-1", 1),
        Shot.at(GeoPoint(50.8649832, 6.4472764, 3.5), 41.538, -50.194, "plot-1", 2),
    ]
    stops: list[Shot | Via] = [*shots]
    if vias:
        stops.insert(2, Via(50.8649982, 6.4473, 6.0))
    return Mission(
        "small", HOME, 5.0, tuple(stops), GeoPoint(50.8649, 6.44731, 5.0), speed_mps=2.0, settle_s=4.0, exposure_s=1.0
    )


def metres(a: GeoPoint, b: GeoPoint) -> float:
    """Horizontal distance, good to a millimetre over metres."""
    north = math.radians(b.latitude_deg - a.latitude_deg) * 6.3781e6
    east = math.radians(b.longitude_deg - a.longitude_deg) * 6.39e6 * math.cos(math.radians(a.latitude_deg))
    return math.hypot(north, east)
