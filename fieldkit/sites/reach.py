"""What a vehicle can reach of a plan's poses, and the nearest pose where it cannot.

A multicopter turns to any heading and is as level as it flies, so what limits a pose is the mount's pitch, the least
height above the ground, and the air over plants that a vehicle keeps clear of. The nearest pose keeps place and
heading: the pitch is turned to the mount's limit (to its only pitch, where it is fixed), the camera is raised straight
up. What it then sees is not what the plan chose, and two stations that differed in what is taken from them would be
photographed twice: that is an error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from fieldkit.arrays import FloatArray
from fieldkit.results.finding import Finding
from fieldkit.routing.mission import Shot
from fieldkit.routing.obstacles import TOLERANCE_M as CLEAR_TOLERANCE_M
from fieldkit.routing.obstacles import Obstacles
from fieldkit.sites.placement import SiteFrame, grounds_m
from fieldkit.sites.site import Site
from fieldkit.vehicles.vehicle import Vehicle

TOLERANCE_M = 1e-4
"""Rounding, not leeway: files hold heights to 0.1 mm."""

_CENTIMETRES = 100.0
"""Centimetres of a metre."""
_WRITTEN_M = 0.02
"""By which places of one plan may differ, as files of missions hold them."""
RTK_REMEDY = (
    "Fly with RTK and give its gps_accuracy_m in the vehicle's profile, or keep farther away: `fieldkit plan --vehicle "
    "NAME --clearance M`."
)


@dataclass(frozen=True)
class Unreachable:
    """A pose that the vehicle cannot take."""

    shot: Shot
    """As planned."""
    what: str
    """The same for people, without the station's name."""
    nearest: Shot
    """The nearest pose that it can take."""

    def __str__(self) -> str:
        return str(self.finding)

    @property
    def finding(self) -> Finding:
        """What speaks against flying it as planned."""
        return Finding(
            self.shot.plot,
            "out-of-reach",
            self.what,
            severity="error",
            station=self.shot.station,
            remedy="Give --adjust to fly the nearest poses, or plan within this vehicle's limits.",
        )


def unreachable(
    shots: Sequence[Shot], site: Site, vehicle: Vehicle, obstacles: Obstacles | None = None
) -> tuple[Unreachable, ...]:
    """The poses that a vehicle cannot take, in their order.

    Slopes are looked at below each station; plants are kept clear of where there are ``obstacles``.
    """
    points = SiteFrame(site.home).points(shot.place for shot in shots)
    clear = [-math.inf if obstacles is None else obstacles.plants_top_m(point) for point in points]
    known = zip(shots, grounds_m(site, shots).tolist(), clear, strict=True)
    problems = (_problem(shot, ground, top, vehicle) for shot, ground, top in known)
    return tuple(problem for problem in problems if problem is not None)


def nearest(
    shots: Sequence[Shot], site: Site, vehicle: Vehicle, obstacles: Obstacles | None = None
) -> tuple[tuple[Shot, ...], tuple[Unreachable, ...]]:
    """All shots, those out of reach replaced by their nearest poses, and which those are; as `unreachable`."""
    problems = unreachable(shots, site, vehicle, obstacles)
    instead = {id(problem.shot): problem.nearest for problem in problems}
    return tuple(instead.get(id(shot), shot) for shot in shots), problems


def needs_rtk(stations: FloatArray, near_m: float, vehicle: Vehicle) -> list[str]:
    """Why a vehicle's GNSS does not hold stations (n, 3) against each other, or off plants; nothing with RTK.

    The nearest station is ``near_m`` from plants, which stand where a map has them, so a flight's common offset counts
    there. Stations at one place are one.
    """
    if vehicle.rtk:
        return []
    found, places = list[str](), np.unique(stations.round(3), axis=0)
    apart_m = KDTree(places).query(places, k=2)[0][:, 1].min() if len(places) > 1 else math.inf
    if apart_m < vehicle.apart_m - _WRITTEN_M:
        found.append(
            f"two stations are {apart_m:.2f} m apart, and without it {vehicle.title} holds them to {vehicle.held_m:g} "
            f"m, which is enough for {vehicle.apart_m:.2f} m"
        )
    if near_m < vehicle.clearance_m + vehicle.gps_accuracy_m - _WRITTEN_M:
        found.append(
            f"a station is {near_m:.2f} m from plants, and without it {vehicle.title} may be "
            f"{vehicle.gps_accuracy_m:g} m off and keeps {vehicle.clearance_m:g} m clear"
        )
    return [f"needs RTK: {why}" for why in found]


def _problem(shot: Shot, ground_m: float, plants_m: float, vehicle: Vehicle) -> Unreachable | None:
    above = shot.place.height_m - ground_m
    mount = vehicle.mount
    pitch, height, sentences = shot.pitch_deg, shot.place.height_m, list[str]()
    if not mount.reaches(pitch):
        pitch = mount.nearest_deg(pitch)
        reach = f"is fixed at {pitch:g}°" if mount.kind == "fixed" else f"reaches {mount.range_text}"
        sentences.append(f"pitch {shot.pitch_deg:.4g}°, but the mount of {vehicle.title} {reach}")
    if above < vehicle.min_height_m - TOLERANCE_M:
        height = ground_m + vehicle.min_height_m
        sentences.append(
            f"{above:.2f} m above the ground, but {vehicle.title} flies no lower than {vehicle.min_height_m:g} m"
        )
    if shot.place.height_m < plants_m:
        sentences.append(f"{plants_m - shot.place.height_m:.2f} m too low over the plants for {vehicle.title}")
        clear_m = plants_m + CLEAR_TOLERANCE_M
        height = max(height, math.ceil(clear_m * _CENTIMETRES - 0.01) / _CENTIMETRES)  # as files hold heights
    if not sentences:
        return None
    nearest = replace(shot, height_m=height, pitch_deg=pitch)
    pose = f"the nearest pose is {height - ground_m:.2f} m above the ground with pitch {pitch:.4g}°"
    return Unreachable(shot, f"{'; '.join(sentences)}; {pose}", nearest)
