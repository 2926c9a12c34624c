"""The ground of a field below its plots."""

import numpy as np
import pytest

from fieldkit.geometry import Pose
from fieldkit.reconstruction.field_ground import FieldGround, grounds_under

PLOT = np.array([(2.0, 1.0), (6.0, 1.0), (6.0, 2.5), (2.0, 2.5)])
"""Corners of a plot of 4 × 1.5 m."""


def field(soil: np.ndarray, canopy: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Points (n, 3): soil at places (n, 2) on a slope of 3 %, uneven by 8 mm, and leaves over other places."""
    ground = np.column_stack([soil, 0.03 * soil[:, 0] + rng.normal(0.0, 0.008, len(soil))])
    leaves = np.column_stack([canopy, 0.03 * canopy[:, 0] + rng.uniform(0.3, 1.4, len(canopy))])
    return np.concatenate([ground, leaves])


def survey(points: np.ndarray) -> FieldGround:
    poses = {f"{x} {y}": Pose.from_yaw_pitch((x, y, 8.0), 0.0, -90.0) for x in (0.0, 4.0, 8.0) for y in (0.0, 3.0)}
    ground = FieldGround.of(points, poses, np.ones(len(points), np.bool_))
    assert ground is not None
    return ground


def error_m(ground: FieldGround) -> tuple[float, float]:
    """Of the plane's height at the plot's middle, and what is said of it."""
    known = ground.under(PLOT)
    assert known is not None
    plane, sigma_m = known
    return float(plane.above(np.array([[4.0, 1.75]]))[0, 2] - 0.03 * 4.0), sigma_m


def test_the_ground_below_a_closed_canopy_is_that_of_the_alleys_about_it() -> None:
    rng = np.random.default_rng(5)
    places = rng.uniform((-1.0, -2.0), (9.0, 5.5), (6000, 2))
    inside = ((places > PLOT.min(axis=0)) & (places < PLOT.max(axis=0))).all(axis=1)
    open_error, open_sigma = error_m(survey(field(places, places[inside], rng)))
    error, sigma = error_m(survey(field(places[~inside], places[inside], rng)))
    assert abs(open_error) <= 2.0 * open_sigma
    assert abs(error) <= 2.0 * sigma < 0.03


def test_far_from_soil_the_ground_is_known_less() -> None:
    rng = np.random.default_rng(6)
    places = rng.uniform((-1.0, -2.0), (9.0, 5.5), (3000, 2))
    beside = places[(places[:, 0] < 2.0) & (places[:, 1] > 0.0)]
    _, everywhere = error_m(survey(field(places, places, rng)))
    _, on_one_side = error_m(survey(field(beside, places, rng)))
    assert on_one_side > 1.3 * everywhere


@pytest.mark.parametrize("far_m", [20.0, 200.0])
def test_there_is_no_ground_where_no_soil_was_seen(far_m: float) -> None:
    rng = np.random.default_rng(7)
    places = rng.uniform((-1.0, -2.0), (9.0, 5.5), (3000, 2))
    assert survey(field(places, places, rng)).under(PLOT + far_m) is None


def test_an_earlier_flight_over_bare_soil_tells_the_ground_where_its_height_is_off() -> None:
    rng = np.random.default_rng(8)
    places = rng.uniform((-1.0, -2.0), (9.0, 5.5), (4000, 2))
    beside = places[places[:, 0] < 1.0]
    closed, bare = (
        survey(field(beside, places, rng)),
        survey(field(places, places[:1], rng) + np.array([0.0, 0.0, 0.07])),
    )
    outlines = [PLOT - np.array([3.5, 0.0]), PLOT + np.array([1.0, 0.0])]
    assert closed.under(outlines[1]) is None
    grounds = grounds_under(outlines, closed, bare)
    assert grounds[1] is not None
    plane, sigma_m = grounds[1]
    off_m = float(plane.above(np.array([[5.0, 1.75]]))[0, 2] - 0.03 * 5.0)
    assert abs(off_m) <= 2.0 * max(sigma_m, 0.01)
    alone = grounds_under(outlines[1:], None, bare, 0.05)[0]
    assert alone is not None
    assert alone[1] > 0.05
