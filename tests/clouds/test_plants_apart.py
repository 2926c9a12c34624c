"""Which plant each point of a cloud belongs to, against simulated plants."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fieldkit.clouds import Cloud, concatenate
from fieldkit.clouds.plants_apart import PlantsApart, tell_apart
from tests.scenes.conftest import Row, make_row


def with_holes(row: Row, share: float, radius_m: float = 0.012) -> Row:
    """Without balls of points in the lower 40 % of the plants, until so much is missing there."""
    rng = np.random.default_rng(0)
    z = row.cloud.points[:, 2]
    low = np.flatnonzero(z < z.min() + 0.4 * np.ptp(z))
    tree, gone = cKDTree(row.cloud.points), np.zeros(len(z), bool)
    while gone[low].mean() < share:
        gone[tree.query_ball_point(row.cloud.points[rng.choice(low)], radius_m)] = True
    return Row(row.cloud.select(~gone), row.plants[~gone])


def moved(row: Row, number: int, x: float, y: float) -> Cloud:
    """One plant of the row with its foot there."""
    plant = row.cloud.select(row.plants == number)
    return replace(plant, points=plant.points - (0.25 * (number - 2) - x, -y, 0.0))


@pytest.fixture(scope="module")
def row() -> Row:
    """Three plants 25 cm apart along x, whose leaves cross."""
    return make_row()


@pytest.fixture(scope="module")
def apart(row: Row) -> PlantsApart:
    return tell_apart(row.cloud)


def test_each_point_of_a_row_goes_to_its_plant(row: Row, apart: PlantsApart) -> None:
    assert apart.count == 3
    assert not apart.refused
    assert (apart.numbers == row.plants).mean() > 0.95
    np.testing.assert_allclose(apart.feet_m[:, :2], [(-0.25, 0.0), (0.0, 0.0), (0.25, 0.0)], atol=0.02)
    np.testing.assert_allclose(apart.feet_m[:, 2], row.cloud.points[:, 2].min(), atol=0.01)


def test_holes_do_not_cut_a_plant_in_two(row: Row) -> None:
    torn = with_holes(row, 0.3)
    apart = tell_apart(torn.cloud)
    assert apart.count == 3, apart.refused
    assert (apart.numbers == torn.plants).mean() > 0.9


def test_weeds_belong_to_no_plant(row: Row) -> None:
    rng = np.random.default_rng(2)
    weed = Cloud(rng.uniform((-0.03, 0.2, -0.02), (0.03, 0.26, 0.02), (500, 3)))
    with_weed = concatenate([replace(row.cloud, normals=None, colors=None), weed])
    apart = tell_apart(with_weed)
    assert apart.count == 3
    assert (apart.numbers[-500:] == 0).all()


def test_a_closed_canopy_is_refused(row: Row) -> None:
    places = [(0.08 * i, 0.08 * j) for i in range(3) for j in range(3)]
    canopy = concatenate([moved(row, 1 + k % 3, x, y) for k, (x, y) in enumerate(places)])
    refused = tell_apart(canopy)
    assert refused.refused
    assert refused.count == 0
    assert (refused.numbers == 0).all()


def test_a_plant_without_its_foot_is_refused(row: Row) -> None:
    """Else its leaves would turn about a neighbour's foot."""
    z = row.cloud.points[:, 2]
    footless = row.cloud.select((row.plants != 2) | (z > z.min() + 0.2 * np.ptp(z)))
    assert "no foot" in tell_apart(footless).refused


def test_what_is_no_plant_is_refused() -> None:
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(20_000, 3))
    ball = 0.5 * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    assert tell_apart(Cloud(ball)).refused
    assert tell_apart(Cloud(ball * (1.0, 1.0, 0.0))).refused
    assert tell_apart(Cloud(ball[:5])).refused
    assert tell_apart(Cloud.empty()).refused
    floating = Cloud(np.concatenate([ball + np.array((0.0, 0.0, 1.0)), np.zeros((100, 3))]))
    assert "no foot" in tell_apart(floating).refused
