"""One way, as a tour takes many at once."""

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.results.finding import Refused
from fieldkit.routing.flights import Stop, objections
from fieldkit.routing.legs import Leg, leg_of, legs_between, no_way
from fieldkit.routing.obstacles import Obstacles
from fieldkit.vehicles.vehicle import Speeds


def safe_leg(
    a: ArrayLike,
    b: ArrayLike,
    obstacles: Obstacles,
    speeds: Speeds,
    *,
    level_m: float | None = None,
    names: tuple[str, str] = ("the start", "the end"),
) -> Leg:
    """The quickest safe way from a to b; MissionError where an end is in an obstacle, or there is none."""
    start, stop = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    stops = [Stop((float(x), float(y), float(z)), 0.0, 0.0, "", k) for k, (x, y, z) in enumerate((start, stop))]
    against = objections(stops, (0.0, 0.0, 1e3), (0.0, 0.0, 1e3), obstacles, takeoff_m=0.0, transit_m=-1e9)
    if blocked := [found for found in against if found.station is not None]:
        raise Refused(blocked)
    legs = legs_between(start[None], stop[None], obstacles, speeds, level_m=level_m)
    if np.isinf(legs.time_s[0]):
        raise no_way(start, stop, names, obstacles, level_m)
    return leg_of(legs.places(0), speeds)
