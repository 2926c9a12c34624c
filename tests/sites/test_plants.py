"""The plants' no-fly volume."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fieldkit.results.plan import PlanPlants
from fieldkit.sites.plot_plants import BAND_M, Band, no_fly_bands


def inside(bands: tuple[Band, ...], places: NDArray[np.float64]) -> NDArray[np.bool_]:
    found = np.zeros(len(places), dtype=np.bool_)
    for band in bands:
        polygon = shapely.Polygon(band.corners)
        assert polygon.is_valid
        found |= shapely.contains_xy(polygon, places[:, 0], places[:, 1]) & (places[:, 2] < band.top_m)
    return found


def drawn(
    seed: int, count: int, clearance: float
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """Whether random places are inside, their distances (places, points) and those in the plan, below points only."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((-1, -0.5, 0.0), (1, 0.5, 1.4), (count, 3)).round(3)
    plants = PlanPlants(points_m=tuple((x, y, z) for x, y, z in points.tolist()), cell_m=0.05)
    places = rng.uniform((-3, -3, 0), (3, 3, 3.5), (400, 3))
    apart = places[:, None] - points[None]
    below = np.where(apart[..., 2] < 0, np.linalg.norm(apart[..., :2], axis=2), np.inf)
    return inside(no_fly_bands(plants, clearance), places), np.linalg.norm(apart, axis=2), below


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 60), st.floats(0.2, 1.5))
def test_what_is_near_or_below_a_plant_is_inside(seed: int, count: int, clearance: float) -> None:
    found, apart, below = drawn(seed, count, clearance)
    near = clearance - BAND_M - 0.02 - 0.02 * clearance  # a disc of sixteen sides lies 2 % inside the circle
    assert found[(apart < near).any(axis=1) | (below < near).any(axis=1)].all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 2), st.floats(0.2, 1.5))  # more could surround a place
def test_what_keeps_the_distance_is_outside(seed: int, count: int, clearance: float) -> None:
    found, apart, below = drawn(seed, count, clearance)
    assert not found[(apart >= clearance).all(axis=1) & (below >= clearance).all(axis=1)].any()


def test_no_plants_take_no_air() -> None:
    assert no_fly_bands(PlanPlants(points_m=(), cell_m=0.05), 0.5) == ()
