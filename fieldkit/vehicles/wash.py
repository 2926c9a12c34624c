"""Air that a hovering multirotor moves, and how far moving air moves leaves. Used by the simulator and by planning.

The figures are estimates from momentum theory and published jets, of a vehicle that hovers in still air; none was
measured under a vehicle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray

_OUTWASH = 3.6
"""m/s at 1 m beside 1 kg. A radial wall jet has C · √(thrust / density of air) / r, whatever the rotors; C is 1.26."""
_DOWNWASH = 20.0
"""m/s at 1 m below 1 kg, of a round jet: 6.9 · √(thrust / density) / z (Pope, Turbulent Flows, 2000, 5.1)."""
_FASTEST_MPS = 9.0
"""Of a wake: √(2 · thrust / (density · area of the rotors)) at 5 kg per square metre of rotors."""
_WAKE_M = 0.25
"""Half width of the downwash of 1 kg at the rotors, metres (Pope)."""
_SPREAD = 0.10
"""Growth of that half width with depth (Pope)."""

WINDY_M = 0.010
"""Leaves that move so far half a metre out: planned views miss 9 to 13 cm of height, more than traits claim
(docs/traits.md)."""
_SWAY_M = 0.53e-3
"""Motion of leaves at 1 m/s, metres: 4 mm at 2 to 2.5 m/s and 10 mm at 3 to 3.5 m/s, from leaf anemometry (arXiv
2504.10584)."""
_POWER = 2.5
"""Power of the air's speed with which leaves' motion grows (the same)."""


def air_speed_mps(distance_m: ArrayLike, mass_kg: float, below_m: ArrayLike = 0.0) -> FloatArray:
    """Speed of the air at a distance from a hovering multirotor, the greater of outwash and downwash.

    Speeds grow with the square root of the mass, as the thrust's momentum does, up to a wake's own speed.

    Args:
        distance_m: from the vehicle; any shape.
        mass_kg: at take-off.
        below_m: how far below the vehicle, broadcast with the distances; 0 or less has no downwash.
    """
    distance, below = np.broadcast_arrays(np.asarray(distance_m, np.float64), np.asarray(below_m, np.float64))
    size = np.sqrt(mass_kg)
    outwash = _OUTWASH * size / np.maximum(distance, 1e-3)
    depth = np.maximum(below, 1e-3)
    core = np.minimum(_FASTEST_MPS, _DOWNWASH * size / depth)
    off_axis2 = np.maximum(distance**2 - depth**2, 0.0) / (_WAKE_M * size + _SPREAD * depth) ** 2
    downwash = np.where(below > 0, core * 0.5**off_axis2, 0.0)
    return np.asarray(np.minimum(np.maximum(outwash, downwash), _FASTEST_MPS))


def sway_m(speed_mps: ArrayLike) -> FloatArray:
    """Root mean square of a leaf's sideways motion per axis, half a metre out, in air of a speed at the leaf."""
    return np.asarray(_SWAY_M * np.asarray(speed_mps, np.float64) ** _POWER)


def swayed_m(wind_m: ArrayLike, distance_m: ArrayLike, mass_kg: float, below_m: ArrayLike = 0.0) -> FloatArray:
    """`sway_m` of wind and a vehicle's wash together, which add in quadrature; arguments as of `air_speed_mps`.

    Args:
        wind_m: the sway by wind alone.
    """
    return np.asarray(np.hypot(wind_m, sway_m(air_speed_mps(distance_m, mass_kg, below_m))))
