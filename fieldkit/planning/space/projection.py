"""Projection of any set of cameras into the feasible set."""

from __future__ import annotations

import numpy as np

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope, distance_to, no_room

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
    limits = np.array([envelope.x_m, envelope.y_m, envelope.height_m])
    clipped: FloatArray = np.clip(positions, limits[:, 0], limits[:, 1])
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
