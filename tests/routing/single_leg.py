"""One way, as a tour takes many at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.routing.legs import Leg, check_places, leg_of, legs_between, no_way
from fieldkit.routing.obstacles import Obstacles
from fieldkit.vehicles.vehicle import Speeds


def safe_leg(
    a: ArrayLike, b: ArrayLike, obstacles: Obstacles, speeds: Speeds, *, level_m: float | None = None,
    names: tuple[str, str] = ("the start", "the end"),
) -> Leg:  # fmt: skip
    """The quickest safe way from a to b; MissionError where an end is in an obstacle, or there is none."""
    start, stop = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    check_places(np.stack([start, stop]), names, obstacles)
    legs = legs_between(start[None], stop[None], obstacles, speeds, level_m=level_m)
    if np.isinf(legs.time_s[0]):
        raise no_way(start, stop, names, obstacles, level_m)
    return leg_of(legs.places(0), speeds)
