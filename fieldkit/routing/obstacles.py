"""What a flight keeps clear of: plants, obstacles, no-fly zones, the outside of a fence, the air above a ceiling.

Local frame: metres east and north of home and above it. All upright sides and tops are flat, so a straight leg is
tested exactly, not at samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.errors import MissionError
from fieldkit.routing.prisms import Prisms
from fieldkit.wording import by_key

TOLERANCE_M = 0.02
"""By how much a leg may come nearer than the clearance: files hold degrees to 1e-7 and heights to a centimetre."""
VIA_MARGIN_M = 0.05
"""By how much places that are flown around an obstacle lie beyond the clearance."""
FARTHEST_M = 100_000.0
"""From home; a local frame is not meant for more."""

Corners = tuple[tuple[float, float], ...]
Kind = Literal["plants", "obstacle", "no-fly zone", "fence", "ceiling"]
_ARC = 8  # sides in a quarter turn; they stand at most 0.5 % of the clearance inside of the arc
_MANY_CORNERS = 12
"""Number of corners beyond which a way round an obstacle goes by its octagon."""


@dataclass(frozen=True)
class Volume:
    """An upright prism from the ground to a height, and the distance that is kept to it."""

    name: str
    """For people."""
    footprint: Corners
    """Three or more corners (east, north), without a repeated last one; in either direction."""
    top_m: float
    """Above home; infinite where nothing may fly above it."""
    clearance_m: float = 0.0
    """Sideways and above."""
    kind: Kind = "obstacle"
    """"no-fly zone" where it is infinitely high."""

    def __post_init__(self) -> None:
        if math.isnan(self.top_m) or self.top_m == -math.inf or not 0.0 <= self.clearance_m <= FARTHEST_M:
            raise MissionError(
                f"{self.name}: its top {self.top_m} m or its clearance {self.clearance_m} m is no height"
            )
        _polygon(self.name, self.footprint)

    @classmethod
    def cylinder(
        cls, name: str, centre: tuple[float, float], radius_m: float, top_m: float, clearance_m: float = 0.0
    ) -> Volume:
        """An upright cylinder, as a polygon of 32 sides around it."""
        angles = 2.0 * np.pi * np.arange(4 * _ARC) / (4 * _ARC)
        reach = radius_m / math.cos(math.pi / (4 * _ARC))
        ring = np.array(centre) + reach * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return cls(name, tuple((float(x), float(y)) for x, y in ring), top_m, clearance_m)

    @classmethod
    def no_fly(cls, name: str, corners: Corners, clearance_m: float = 0.0) -> Volume:
        """A zone that is never flown over."""
        return cls(name, corners, math.inf, clearance_m, "no-fly zone")

    @property
    def solid(self) -> tuple[BaseGeometry, float]:
        """Plan and top of what a leg may not enter: the clearance, less `TOLERANCE_M`, is part of it."""
        grown = max(self.clearance_m - TOLERANCE_M, 0.0)
        plan = shapely.Polygon(self.footprint)
        return plan.buffer(grown, quad_segs=_ARC) if grown > 0.0 else plan, self.top_m + grown


@dataclass(frozen=True)
class LegProblem:
    """What a leg meets."""

    kind: Kind
    """Of it."""
    name: str
    """Of the volume; empty where it is the fence or the ceiling."""
    place: tuple[float, float, float]
    """East, north and height where the leg first meets it."""

    def __str__(self) -> str:
        what = {
            "plants": f"goes through or below the plants of {self.name}",
            "obstacle": f"comes too near to {self.name}",
            "no-fly zone": f"enters the no-fly zone {self.name}",
            "fence": "leaves the fence",
            "ceiling": "rises above the ceiling",
        }[self.kind]
        east, north, up = self.place
        return f"{what} at {east:.2f} m east, {north:.2f} m north, {up:.2f} m above home"


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Everything that legs keep clear of."""

    volumes: tuple[Volume, ...] = ()
    """That they do not enter."""
    fence: tuple[Corners, ...] = ()
    """Polygons of corners (east, north); every leg stays in their union, where there are any."""
    fence_clearance_m: float = 0.0
    """Distance kept to the fence's inside."""
    ceiling_m: float | None = None
    """Above home; legs are nowhere higher, or there is none."""

    def __post_init__(self) -> None:
        if self.ceiling_m is not None and math.isnan(self.ceiling_m):
            raise MissionError("the ceiling is not a number")
        if self.fence and self._inside(self.fence_clearance_m + VIA_MARGIN_M).is_empty:
            raise MissionError(
                f"the fence leaves no room {self.fence_clearance_m:g} m away from it",
                remedy="Draw it wider, or use a vehicle that needs less clearance.",
            )

    @cached_property
    def prisms(self) -> Prisms:
        """All solids: of the volumes in order, then the outside of the fence, where there is one."""
        solids = [volume.solid for volume in self.volumes]
        if self.fence:
            outside = shapely.box(-2 * FARTHEST_M, -2 * FARTHEST_M, 2 * FARTHEST_M, 2 * FARTHEST_M)
            inside = self._inside(max(self.fence_clearance_m - TOLERANCE_M, 0.0))
            solids.append((outside.difference(inside), math.inf))
        return Prisms.of(solids)

    @cached_property
    def highest_m(self) -> float:
        """Of the ceiling, with its tolerance; infinite where there is none."""
        return math.inf if self.ceiling_m is None else self.ceiling_m + TOLERANCE_M

    @property
    def tops(self) -> FloatArray:
        """(count,) of all solids."""
        return self.prisms.tops

    def corners(self, known: BoolArray) -> FloatArray:
        """(n, 2) places around which a way leads past some solids, `VIA_MARGIN_M` beyond the clearance.

        Where a body has many corners, they are those of an octagon about it. ``known`` (count,) are the solids.
        """
        members = by_key((self._body_of[index], index) for index in np.flatnonzero(known).tolist())
        return np.vstack([np.zeros((0, 2)), *(self._around(tuple(body)) for body in members.values())])

    @cached_property
    def body_tops(self) -> FloatArray:
        """(count,) of all solids the top of the body that they are of.

        Volumes of one kind and name that can be flown over are one body; every other solid is one of its own.
        """
        highest: dict[int, float] = {}
        for body, top in zip(self._body_of, self.tops.tolist(), strict=True):
            highest[body] = max(highest.get(body, -math.inf), top)
        return np.array([highest[body] for body in self._body_of])

    @cached_property
    def _body_of(self) -> list[int]:
        """(count,) first solid of the body that each is of."""
        first: dict[tuple[str, str], int] = {}
        bodies = [
            first.setdefault((volume.kind, volume.name), index) if math.isfinite(volume.top_m) else index
            for index, volume in enumerate(self.volumes)
        ]
        return bodies + ([len(bodies)] if self.fence else [])

    def _around(self, members: tuple[int, ...]) -> FloatArray:
        found = self._bodies.get(members)
        if found is None:
            if members[0] == len(self.volumes):
                found = _corners(self._inside(self.fence_clearance_m + VIA_MARGIN_M))
            else:
                found = _past([self.volumes[index] for index in members])
            self._bodies[members] = found
        return found

    def blocked(self, a: ArrayLike, b: ArrayLike) -> BoolArray:
        """(n,) whether straight legs between a and b, (n, 3) each, meet anything."""
        start, stop = _places(a), _places(b)
        return self.prisms.blocked(start, stop) | (np.maximum(start[:, 2], stop[:, 2]) > self.highest_m)

    def leg_problems(self, a: ArrayLike, b: ArrayLike) -> tuple[LegProblem, ...]:
        """Everything that one straight leg from a to b, (3,) each, meets; a place where both are the same."""
        start, stop = _places(a), _places(b)
        problems = []
        for index in np.flatnonzero(self.prisms.met(start, stop)):
            alone = np.zeros(len(self.tops), dtype=np.bool_)
            alone[index] = True
            share = float(self.prisms.entries(start, stop, alone)[0])
            fence = index == len(self.volumes)
            kind: Kind = "fence" if fence else self.volumes[index].kind
            problems.append(LegProblem(kind, "" if fence else self.volumes[index].name, _along(start, stop, share)))
        if max(start[0, 2], stop[0, 2]) > self.highest_m:
            rise = stop[0, 2] - start[0, 2]
            share = 0.0 if start[0, 2] > self.highest_m else (self.highest_m - start[0, 2]) / rise
            problems.append(LegProblem("ceiling", "", _along(start, stop, float(share))))
        return tuple(problems)

    def plants_top_m(self, place: ArrayLike) -> float:
        """Height above home that a place (3,) is clear of the plants from, at its east and north; −∞ beside them."""
        below = _places(place).copy()
        below[:, 2] = -FARTHEST_M
        over = np.flatnonzero(self.prisms.met(below, below)).tolist()
        return max(
            (float(self.tops[k]) for k in over if k < len(self.volumes) and self.volumes[k].kind == "plants"),
            default=-math.inf,
        )

    @cached_property
    def _bodies(self) -> dict[tuple[int, ...], FloatArray]:
        return {}

    def _inside(self, away_m: float) -> BaseGeometry:
        union = shapely.union_all([_polygon("the fence", corners) for corners in self.fence])
        return union.buffer(-away_m, join_style="mitre")


def _polygon(name: str, corners: Corners) -> BaseGeometry:
    ring = np.asarray(corners, dtype=np.float64)
    if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3:
        raise MissionError(f"{name} has fewer than three corners")
    if not (np.abs(ring) <= FARTHEST_M).all():
        raise MissionError(
            f"{name} lies farther than {FARTHEST_M / 1000:.0f} km from home",
            remedy="Check its coordinates: latitude comes first in a site file, longitude in GeoJSON.",
        )
    polygon = shapely.Polygon(ring)
    if not polygon.is_valid or polygon.area <= 0.0:
        raise MissionError(
            f"{name} is no simple polygon: {shapely.is_valid_reason(polygon)}",
            remedy="List its corners in order along its edge.",
        )
    return polygon


def _places(places: ArrayLike) -> FloatArray:
    points = np.atleast_2d(np.asarray(places, dtype=np.float64))
    if not (np.abs(points) <= FARTHEST_M).all():
        raise MissionError(f"a place lies farther than {FARTHEST_M / 1000:.0f} km from home")
    return np.ascontiguousarray(points)


def _along(a: FloatArray, b: FloatArray, share: float) -> tuple[float, float, float]:
    east, north, up = (float(v) for v in a[0] + share * (b[0] - a[0]))
    return east, north, up


def _corners(plan: BaseGeometry) -> FloatArray:
    rings = [ring for polygon in shapely.get_parts(plan) for ring in (polygon.exterior, *polygon.interiors)]
    return np.vstack([np.zeros((0, 2)), *(shapely.get_coordinates(ring)[:-1] for ring in rings)])


def _past(volumes: list[Volume]) -> FloatArray:
    """Corners of volumes that belong together, each grown by its clearance and the margin."""
    if sum(len(volume.footprint) for volume in volumes) <= _MANY_CORNERS or math.isinf(volumes[0].top_m):
        plans = [(shapely.Polygon(volume.footprint), volume.clearance_m + VIA_MARGIN_M) for volume in volumes]
        return np.vstack([_corners(plan.buffer(away, join_style="mitre", mitre_limit=2.0)) for plan, away in plans])
    points = np.vstack([volume.footprint for volume in volumes])
    return _octagon(points, max(volume.clearance_m for volume in volumes) + VIA_MARGIN_M)


def _octagon(points: FloatArray, away_m: float) -> FloatArray:
    """(8, 2) corners of the octagon along the least rectangle about points (n, 2) that is this far away from them."""
    rectangle = shapely.MultiPoint(points).minimum_rotated_rectangle
    side = np.diff(shapely.get_coordinates(rectangle)[:2], axis=0)[0]
    angles = math.atan2(side[1], side[0]) + np.pi / 4 * np.arange(8)
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    reach = (points @ normals.T).max(axis=0) + away_m
    pairs = np.stack([normals, np.roll(normals, -1, axis=0)], axis=1)
    solved: FloatArray = np.linalg.solve(pairs, np.stack([reach, np.roll(reach, -1)], axis=1)[:, :, None])[:, :, 0]
    return solved
