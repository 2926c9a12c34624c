"""The feasible set Z: where cameras may be, where they may look, and how far apart they stay."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.clouds.cells import voxel_thin
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.neighbors import PointIndex
from fieldkit.clouds.volume import Volume
from fieldkit.errors import UsageError
from fieldkit.geometry import Intrinsics
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.plan import PlanEnvelope, PlanPlants
from fieldkit.routing.prisms import Prisms
from fieldkit.sites.plot_plants import no_fly_bands

TOLERANCE = 1e-9
"""Tolerance of constraints, metres or degrees, for rounding in files and changes of units."""
_THINNED_M = 0.02
"""Edge of the voxels that plants are thinned to for clearance, metres."""
_PLAN_CELL_M = 0.05
"""Edge of the voxels of plants in a plan, metres."""
_BESIDE_M = 0.5
"""Width about the envelope within which plants are kept in a plan, metres."""
_OFF_BANDS_M = 0.001
"""Distance kept from the vehicle's no-fly bands; files are more exact."""
_SAMPLE_STREAM = 21
"""Seed's part for random cameras."""
_BATCH = 64
"""Number of places that are drawn at a time."""
_BATCHES = 500
"""Most batches that are drawn for one camera."""
_DIRECTIONS = 192
"""Number of directions in which a free place is looked for."""
_RADII = 40
"""Number of distances at which it is looked for."""
_FIRST_RADIUS_M = 0.004
"""Least of these distances, metres."""
_HALVINGS = 30
"""Number of halvings of the way back from a free place."""
_LATTICE = 20
"""Number of places along each axis of the lattice that is tried last."""


@dataclass(frozen=True, eq=False)
class Envelope:
    """The feasible set Z for level cameras on a copter's gimbal, in the plot frame. All methods plan within one."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]
    """Bounds of the camera centres: the plot with its margin."""
    height_m: tuple[float, float]
    """Least and greatest height above the ground, which is z = 0."""
    target: Volume
    """Volume that sampled cameras look at."""
    plants: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    """(m, 3) points of the plants; no camera may be within ``clearance_m`` of one."""
    clearance_m: float = 0.5
    """Least distance between a camera and a plant."""
    pitch_deg: tuple[float, float] = (-90.0, 0.0)
    """The gimbal's range; there is no roll."""
    separation_m: float = 0.10
    """Least distance between two stations."""
    vehicle_clearance_m: float | None = None
    """A vehicle's clearance to the plants. Cameras then also stay out of its no-fly bands (`no_fly_bands`, which
    missions are routed around): not below leaves, not in gaps that plants surround. None without a vehicle."""

    def __post_init__(self) -> None:
        plants = np.array(self.plants, dtype=np.float64).reshape(-1, 3)
        plants.setflags(write=False)
        object.__setattr__(self, "plants", plants)

    @classmethod
    def around(
        cls,
        plants: Cloud,
        target: Volume,
        *,
        margin_m: float = 1.5,
        height_m: tuple[float, float] = (0.5, 2.5),
        **limits: Any,
    ) -> Envelope:
        """An envelope about a plot's plants.

        Args:
            plants: the proxy's obstacles or the reference, (m, 3); thinned to one point per 2 cm.
            margin_m: how far beyond it cameras may stand, horizontally.
            height_m: band above the ground.
            limits: further attributes, such as ``clearance_m``.
        """
        low, high = np.array(target.lower) - margin_m, np.array(target.upper) + margin_m
        thinned = voxel_thin(plants, _THINNED_M).points
        x_m, y_m = (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))
        return cls(x_m, y_m, height_m, target, plants=thinned, **limits)

    @cached_property
    def _index(self) -> PointIndex | None:
        return PointIndex(self.plants) if len(self.plants) else None

    @cached_property
    def _bands(self) -> Prisms | None:
        if self.vehicle_clearance_m is None or not len(self.plants):
            return None
        bands = no_fly_bands(self.plan_plants(self.plants), self.vehicle_clearance_m)
        return Prisms.of([(shapely.Polygon(b.corners).buffer(_OFF_BANDS_M), b.top_m + _OFF_BANDS_M) for b in bands])

    def plan_plants(self, points: FloatArray) -> PlanPlants:
        """The points (m, 3) within the flight box and half a metre about it, as in plan.json, rounded to millimetres.

        They are thinned to one per 5 cm.
        """
        low = np.array([self.x_m[0], self.y_m[0]]) - _BESIDE_M
        high = np.array([self.x_m[1], self.y_m[1]]) + _BESIDE_M
        near = ((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1)
        thinned = voxel_thin(Cloud(points[near]), _PLAN_CELL_M).points.round(3)
        return PlanPlants(points_m=tuple((x, y, z) for x, y, z in thinned.tolist()), cell_m=_PLAN_CELL_M)

    def in_plan(self) -> PlanEnvelope:
        """The same in the form of plan.json."""
        (x, y, z) = (self.x_m, self.y_m, self.height_m)
        return PlanEnvelope(
            lower_m=(x[0], y[0], z[0]),
            upper_m=(x[1], y[1], z[1]),
            plant_distance_m=self.clearance_m,
            station_distance_m=self.separation_m,
            pitch_deg=self.pitch_deg,
        )

    def position_violation(self, positions: FloatArray) -> FloatArray:
        """(n,) signed violation of bounds, height band and clearance by single positions (n, 3), metres."""
        low, high = self._box
        parts = [*(low - positions).T, *(positions - high).T, self._plants(positions)]
        worst: FloatArray = np.max(parts, axis=0)
        return worst

    @property
    def _box(self) -> FloatArray:
        """(2, 3) lowest and highest corner of the camera centres' bounds and height band."""
        return np.array([self.x_m, self.y_m, self.height_m]).T

    def contains(self, cameras: Cameras) -> bool:
        """Whether every camera keeps every constraint; a degree of pitch counts as a centimetre."""
        (low, high), pitch = self.pitch_deg, cameras.pitch_deg
        too_near = self.separation_m - _nearest_other(cameras.positions)
        turned = 0.01 * np.maximum(low - pitch, pitch - high)
        worst = np.max([self.position_violation(cameras.positions), too_near, turned], axis=0)
        return bool((worst <= 0.01 * TOLERANCE).all())

    def sample(
        self,
        count: int,
        seed: int,
        *,
        radius_m: tuple[float, float] | None = None,
        aim_m: tuple[float, float] | None = None,
    ) -> Cameras:
        """``count`` cameras, each uniform over the feasible positions, looking at the target.

        The pitch is cut to the gimbal's range. The same seed gives the same cameras.

        Args:
            radius_m: range of horizontal distances from the target's middle; ignored if it has no room.
            aim_m: range of heights z above the target's middle to look at; None takes uniform points of the target.
        """
        rng = np.random.default_rng([seed, _SAMPLE_STREAM])
        positions = np.zeros((0, 3))
        for number in range(1, count + 1):
            drawn = None if radius_m is None else self._draw(rng, positions, radius_m)
            drawn = self._draw(rng, positions, (0.0, np.inf)) if drawn is None else drawn
            if drawn is None:
                raise no_room(number)
            positions = np.vstack([positions, drawn])
        targets = rng.uniform(self.target.lower, self.target.upper, (count, 3))
        if aim_m is not None:
            targets[:, :2], targets[:, 2] = self.target.center[:2], rng.uniform(*aim_m, count)
        aimed = Cameras.aimed(positions, targets)
        return Cameras(positions, aimed.yaw_deg, np.clip(aimed.pitch_deg, *self.pitch_deg))

    def _draw(self, rng: np.random.Generator, others: FloatArray, radius_m: tuple[float, float]) -> FloatArray | None:
        low, high = self._box
        for _ in range(_BATCHES):
            drawn = rng.uniform(low, high, (_BATCH, 3))
            away = np.linalg.norm(drawn[:, :2] - self.target.center[:2], axis=1)
            free = (away >= radius_m[0]) & (away <= radius_m[1]) & (distance_to(drawn, others) >= self.separation_m)
            free[free] = self.position_violation(drawn[free]) <= 0.0
            if free.any():
                return np.asarray(drawn[int(np.argmax(free))])[None]
        return None

    def _plants(self, positions: FloatArray) -> FloatArray:
        if self._index is None:
            return np.full(len(positions), -np.inf)
        distances, _ = self._index.nearest(positions)
        lacking: FloatArray = self.clearance_m - distances
        if self._bands is not None:
            lacking = np.maximum(
                lacking, self._bands.tops_below(positions, positions, positions[:, 2]) - positions[:, 2]
            )
        return lacking


def distance_to(positions: FloatArray, others: FloatArray) -> FloatArray:
    """(n,) distance of positions (n, 3) to the nearest of others (m, 3); infinite without any."""
    nearest: FloatArray = np.linalg.norm(positions[:, None] - others[None], axis=2).min(axis=1, initial=np.inf)
    return nearest


def no_room(count: int) -> UsageError:
    """The error for an envelope that is too small."""
    return UsageError(
        f"no feasible position was found for camera {count} in the flight envelope",
        remedy="Widen the bounds or the height band, or lower the clearance or the separation.",
    )


def _nearest_other(positions: FloatArray) -> FloatArray:
    distances = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    np.fill_diagonal(distances, np.inf)
    nearest: FloatArray = distances.min(axis=1, initial=np.inf)
    return nearest


def project(cameras: Cameras, envelope: Envelope) -> Cameras:
    """A feasible set near the given one; a set inside the envelope is returned unchanged.

    Pitches are cut to the gimbal's range. Feasible positions stay; of two that are too close, the first one. Each other
    position moves to the nearest feasible of 7,680 points on spheres about it (192 directions, radii in equal ratios),
    and from there back as far as is feasible. This is near the nearest feasible position, not exactly it. Yaw and pitch
    are kept.
    """
    if envelope.contains(cameras):
        return cameras
    pitch = np.clip(cameras.pitch_deg, *envelope.pitch_deg)
    positions = cameras.positions.copy()
    alone = envelope.position_violation(positions) <= 0.0
    placed: list[int] = []
    for i in range(len(positions)):
        if alone[i] and distance_to(positions[i : i + 1], positions[placed])[0] >= envelope.separation_m:
            placed.append(i)
    for i in range(len(positions)):
        if i not in placed:
            positions[i] = _nearest_free(positions[i], positions[placed], envelope, len(placed) + 1)
            placed.append(i)
    return Cameras(positions, cameras.yaw_deg, pitch)


def _nearest_free(wanted: FloatArray, others: FloatArray, envelope: Envelope, number: int) -> FloatArray:
    start: FloatArray = _clipped(wanted[None], envelope)[0]
    if _free(start[None], others, envelope)[0]:
        return start
    reach = float(np.linalg.norm([np.ptp(envelope.x_m), np.ptp(envelope.y_m), np.ptp(envelope.height_m)])) + 0.1
    radii = np.geomspace(_FIRST_RADIUS_M, reach, _RADII)
    shells = start + (radii[:, None, None] * _sphere(_DIRECTIONS)[None]).reshape(-1, 3)
    for candidates in (_clipped(shells, envelope), _lattice(envelope)):
        free = candidates[_free(candidates, others, envelope)]
        if len(free):
            nearest = free[np.argmin(np.linalg.norm(free - start, axis=1))]
            return _back(start, nearest, others, envelope)
    raise no_room(number)


def _back(blocked: FloatArray, free: FloatArray, others: FloatArray, envelope: Envelope) -> FloatArray:
    """The last free point on the way from a free point to a blocked one."""
    low, high = 0.0, 1.0  # of the way, from the blocked end
    best = free
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        point = _clipped((blocked + middle * (free - blocked))[None], envelope)
        if _free(point, others, envelope)[0]:
            high, best = middle, point[0]
        else:
            low = middle
    return best


def _free(positions: FloatArray, others: FloatArray, envelope: Envelope) -> BoolArray:
    return (envelope.position_violation(positions) <= 0.0) & (distance_to(positions, others) >= envelope.separation_m)


def _clipped(positions: FloatArray, envelope: Envelope) -> FloatArray:
    """Positions (n, 3) cut to the bounds and the height band."""
    clipped: FloatArray = np.clip(positions, *envelope._box)
    return clipped


def _lattice(envelope: Envelope) -> FloatArray:
    axes = [np.linspace(*limits, _LATTICE) for limits in (envelope.x_m, envelope.y_m, envelope.height_m)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return _clipped(points, envelope)


def _sphere(count: int) -> FloatArray:
    """(count, 3) unit vectors, evenly spread (a Fibonacci lattice)."""
    i = np.arange(count) + 0.5
    height = 1.0 - 2.0 * i / count
    turn = i * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height * height)
    points: FloatArray = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    return points


NARROWEST = 0.3
"""Least radius of a structured set, as a share of the envelope's reach."""
_AIM = (0.1, 0.9)
"""Heights that structured sets look at, as shares of the plants' height."""


class Ranges(NamedTuple):
    """Search ranges of circles, two rings and hemispheres; random sets are drawn from them too. Metres."""

    radius_m: tuple[float, float]
    """Horizontal distance from the plot's middle: from 1/3 to 5/4 of the distance at which the plants fill the picture,
    within the envelope's reach.
    """
    altitude_m: tuple[float, float]
    """Above the ground: the envelope's height band."""
    aim_m: tuple[float, float]
    """Z of the aim point above the plot's middle: the inner 80 % of the volume of interest."""

    @classmethod
    def of(cls, envelope: Envelope, camera: Intrinsics) -> Ranges:
        """The ranges for an envelope and the photographs' camera."""
        reach, fill = reach_m(envelope), fill_distance_m(envelope, camera)
        widest = min(reach, 1.25 * fill)
        low, high = envelope.target.lower[2], envelope.target.upper[2]
        return cls(
            (min(max(fill / 3.0, NARROWEST * reach), 0.7 * widest), widest),
            envelope.height_m,
            (low + _AIM[0] * (high - low), low + _AIM[1] * (high - low)),
        )


def fill_distance_m(envelope: Envelope, camera: Intrinsics) -> float:
    """The distance at which the sphere about the volume of interest fills the picture's shorter side, metres."""
    half_angle = np.arctan(0.5 * min(camera.width / camera.fx, camera.height / camera.fy))
    return float(0.5 * envelope.target.diagonal / np.sin(half_angle))


def reach_m(envelope: Envelope) -> float:
    """The largest circle about the plot's middle within the envelope's bounds, metres."""
    (x0, x1), (y0, y1), (x, y, _) = envelope.x_m, envelope.y_m, envelope.target.center
    return float(max(min(x - x0, x1 - x, y - y0, y1 - y), 0.1))
