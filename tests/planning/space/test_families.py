"""Families of cameras: every point of the cube decodes to N cameras that look at the plot and can be made feasible."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.planning.space.envelope import fill_distance_m, reach_m
from fieldkit.planning.space.families import circles, families
from tests.planning.leafy import problem

PROBLEM = problem(9)
FAMILIES = families(PROBLEM)
BY_NAME = {family.name: family for family in FAMILIES}
designs = st.sampled_from(FAMILIES).flatmap(
    lambda f: st.tuples(st.just(f), st.lists(st.floats(0, 1), min_size=len(f), max_size=len(f)))
)


@given(designs)
def test_cameras_look_at_the_plot_and_become_feasible(design: tuple) -> None:
    found, unit = design
    cameras = found.decode(unit)
    assert len(cameras) == PROBLEM.count
    # Along each optical axis there is a point inside the volume of interest.
    low, high = np.array(PROBLEM.envelope.target.lower), np.array(PROBLEM.envelope.target.upper)
    way = np.linspace(0, 5, 2000)[None, :, None] * cameras.forward[:, None] + cameras.positions[:, None]
    assert ((way >= low) & (way <= high)).all(axis=2).any(axis=1).all()
    assert PROBLEM.contains(PROBLEM.nearest(cameras))


def test_points_of_another_cube_are_refused() -> None:
    with pytest.raises(ValueError):
        BY_NAME["ring"].decode([0.5] * 3)


def test_a_chain_alternates_and_a_spiral_rises() -> None:
    chain = BY_NAME["chain"].decode([0.5, 0.5, 0.2, 0.9, 0.1, 0.8, 0.5, 0.5])
    heights = chain.positions[:, 2]
    assert np.allclose(heights[::2], heights[0])
    assert np.allclose(heights[1::2], heights[1])
    assert heights[1] > heights[0]
    spiral = BY_NAME["spiral"].decode([0.5, 0.5, 0.9, 0.3, 0.1, 0.9, 0.5])
    assert (np.diff(spiral.positions[:, 2]) > 0).all()


def test_circles_fill_the_ranges() -> None:
    grid = circles(PROBLEM, 4, 3, 2)
    assert len(set(grid)) == 24
    radius, altitude, aim = PROBLEM.ranges
    assert {c.radius_m for c in grid} >= set(radius)
    assert {c.altitude_m for c in grid} >= set(altitude)
    assert {c.aim_m for c in grid} == set(aim)
    assert altitude == PROBLEM.envelope.height_m
    assert radius[1] <= reach_m(PROBLEM.envelope)
    assert radius[0] < radius[1]
    assert fill_distance_m(PROBLEM.envelope, PROBLEM.camera) / 3.0 <= radius[0]
    inside = {c.radius_m for c in circles(PROBLEM, 1, 2, inner=True)}
    width = radius[1] - radius[0]
    np.testing.assert_allclose(sorted(inside), [radius[0] + 0.25 * width, radius[0] + 0.75 * width])
