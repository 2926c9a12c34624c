"""Clumps that are smaller than leaves and touch nothing, beside shapes that must stay."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.arrays import FloatArray
from fieldkit.clouds.cells import STRAY_M2, find_stand, without_strays
from tests.clouds.examples import cone

VOXEL_M = 0.01
PLANT = cone(0.3, 0.8, 20_000)


def leaf(length: float, width: float, count: int = 4000) -> FloatArray:
    """Level, far from the plant."""
    rng = np.random.default_rng(2)
    return np.column_stack([rng.uniform(0.5, 0.5 + length, count), rng.uniform(0, width, count), np.full(count, 0.9)])


def test_points_and_clumps_in_the_air_go() -> None:
    rng = np.random.default_rng(1)
    clumps = [rng.normal(place, 0.008, (40, 3)) for place in ((0.8, 0.8, 1.6), (-0.8, 0.1, 1.2))]
    stray = np.concatenate([rng.uniform((-0.9, -0.9, 1.1), (0.9, 0.9, 1.9), (60, 3)), *clumps])
    kept = without_strays(np.concatenate([PLANT, stray]), VOXEL_M)
    assert kept[: len(PLANT)].all()
    assert not kept[len(PLANT) :].any()


def test_a_leaf_that_hangs_by_a_thread_of_points() -> None:
    thread = np.column_stack([np.linspace(0.28, 0.48, 9), np.zeros(9), np.full(9, 0.9)])
    cap = np.column_stack([PLANT[:, :2], np.full(20_000, 0.9)])
    kept = without_strays(np.concatenate([cap, thread, leaf(0.02, 0.02, 200)]), VOXEL_M)
    assert kept.all()


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.01, 0.03]))
def test_properties(seed: int, voxel_m: float) -> None:
    """The order of the points does not matter, and what was kept is kept again, and all of it."""
    rng = np.random.default_rng(seed)
    places, spreads = rng.uniform(-1, 1, (6, 3)), rng.uniform(0.003, 0.08, 6)
    sizes = range(50, 650, 100)
    points = np.concatenate([rng.normal(p, s, (n, 3)) for p, s, n in zip(places, spreads, sizes, strict=True)])
    kept = without_strays(points, voxel_m)
    order = rng.permutation(len(points))
    assert np.array_equal(without_strays(points[order], voxel_m), kept[order])
    assert without_strays(points[kept], voxel_m).all()
    if kept.any():
        assert len(np.unique(np.floor(points[kept] / voxel_m), axis=0)) * voxel_m**2 >= STRAY_M2[0]


# A stand of plants, and weeds far from it.


def row(y: float, count: int = 5) -> np.ndarray:
    return np.concatenate([cone(0.12, 0.8, 4000, seed=k) + np.array([0.25 * k - 0.5, y, 0.0]) for k in range(count)])


WEED = cone(0.03, 0.08, 500) + np.array([0.9, 1.9, 0.0])


def test_one_weed_far_out_is_not_the_stand() -> None:
    stand = find_stand(np.concatenate([row(0.0), row(0.75), WEED]))
    np.testing.assert_allclose(stand.low, (-0.62, -0.12), atol=0.04)
    np.testing.assert_allclose(stand.high, (0.62, 0.87), atol=0.04)
    assert 0.0 < stand.apart < 0.05
    assert stand.reach == pytest.approx((1.55, 2.05), abs=0.05)


def test_rows_and_small_plants_between_them_belong_together() -> None:
    small = cone(0.03, 0.1, 500) + np.array([0.7, 0.4, 0.0])
    for points in (np.concatenate([row(0.0), row(0.75)]), np.concatenate([row(0.0), row(0.75), small])):
        stand = find_stand(points)
        assert stand.apart == 0.0
