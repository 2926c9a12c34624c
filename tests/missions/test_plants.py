"""The plants' no-fly volume."""

from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fieldkit.missions.plan import PlanPlants
from fieldkit.missions.plants import BAND_M, Band, no_fly_bands


def inside(bands: tuple[Band, ...], places: NDArray[np.float64]) -> NDArray[np.bool_]:
    found = np.zeros(len(places), dtype=np.bool_)
    for band in bands:
        polygon = shapely.Polygon(band.corners)
        assert polygon.is_valid
        found |= shapely.contains_xy(polygon, places[:, 0], places[:, 1]) & (places[:, 2] < band.top_m)
    return found


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 60), st.floats(0.2, 1.5))
def test_all_that_is_near_or_below_a_plant_is_inside_and_nothing_far(seed: int, count: int, clearance: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform((-1, -0.5, 0.0), (1, 0.5, 1.4), (count, 3)).round(3)
    plants = PlanPlants(points_m=tuple((x, y, z) for x, y, z in points.tolist()), cell_m=0.05)
    bands = no_fly_bands(plants, clearance)
    places = rng.uniform((-3, -3, 0), (3, 3, 3.5), (400, 3))
    apart = places[:, None] - points[None]
    near = (np.linalg.norm(apart, axis=2) < clearance).any(axis=1)
    below = ((np.linalg.norm(apart[..., :2], axis=2) < clearance) & (apart[..., 2] < 0)).any(axis=1)
    found = inside(bands, places)
    assert found[near | below].all()
    # A step up and the corners of discs is what may be too much.
    apart[..., 2] = np.maximum(apart[..., 2] - BAND_M, 0.0)
    far = (np.linalg.norm(apart, axis=2) > clearance + 0.15).all(axis=1)
    surrounded = inside(bands, np.column_stack([places[:, :2], np.full(len(places), -5.0)]))
    assert not found[far & ~surrounded].any()
    assert not found[far & (places[:, 2] > points[:, 2].max() + clearance + BAND_M)].any()


def test_no_plants_take_no_air() -> None:
    assert no_fly_bands(PlanPlants(points_m=(), cell_m=0.05), 0.5) == ()
