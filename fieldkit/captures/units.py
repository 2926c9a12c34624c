"""Noticing positions in millimetres (or another unit) where metres were meant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

_UNITS = {"millimetres": 0.001, "centimetres": 0.01, "feet": 0.3048, "kilometres": 1000.0}
_WIDE_SPACING_M = 15.0
_NARROW_EXTENT_M = 0.02


@dataclass(frozen=True)
class UnitSuspicion:
    """A unit the positions may be in."""

    unit: str
    factor: float
    """Metres per that unit."""
    message: str
    """One sentence with the figures."""


def suspicious_unit(
    positions: NDArray[np.float64], *, gps_positions: NDArray[np.float64] | None = None
) -> UnitSuspicion | None:
    """Whether camera positions (n, 3), said to be metres, look like another unit.

    With GPS positions (n, 3) of the same photographs, in metres, their spreads (RMS distance from the mean,
    horizontal and vertical together) are compared; GPS noise of a few metres is allowed for, and closely spaced
    captures decide nothing. Without, two rules of thumb: neighbouring photographs of one plot are not more than 15 m
    apart (median of the nearest-neighbour distances: 24–31 "m" for a rig's circle in millimetres, 1–12 m for drones),
    and a capture is more than 2 cm wide.

    Returns:
        None when nothing is suspicious or there are fewer than 3 positions.
    """
    points = np.asarray(positions, dtype=np.float64)
    if len(points) < 3:
        return None
    if gps_positions is not None:
        return _against_gps(points, np.asarray(gps_positions, dtype=np.float64))
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if 0.0 < extent < _NARROW_EXTENT_M:
        return UnitSuspicion("kilometres", 1000.0, f"all positions lie within {extent * 1000:.1f} mm of one another")
    distances, _ = cKDTree(points).query(points, k=2)
    spacing = float(np.median(distances[:, 1]))
    if spacing <= _WIDE_SPACING_M:
        return None
    message = f"neighbouring photographs would be {spacing:.0f} m apart; are these millimetres instead of metres?"
    return UnitSuspicion("millimetres", 0.001, message)


def _against_gps(points: NDArray[np.float64], gps: NDArray[np.float64]) -> UnitSuspicion | None:
    spread = float(np.sqrt(((points - points.mean(0)) ** 2).sum(1).mean()))
    gps_spread = float(np.sqrt(((gps - gps.mean(0)) ** 2).sum(1).mean()))
    # Below this GPS noise alone makes the spread.
    if spread == 0.0 or gps_spread < 10.0:
        return None
    ratio = spread / gps_spread
    for unit, factor in _UNITS.items():
        tolerance = 1.1 if unit == "feet" else 1.6
        if 1.0 / tolerance < ratio * factor < tolerance:
            message = f"the positions spread over {spread:.3g} m, their GPS over {gps_spread:.3g} m; are these {unit}?"
            return UnitSuspicion(unit, factor, message)
    return None
