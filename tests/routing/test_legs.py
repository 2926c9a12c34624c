"""Safe ways between two places."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.errors import MissionError
from fieldkit.routing.legs import legs_between
from fieldkit.routing.motion import path_time_s, stretch_time_s
from fieldkit.routing.obstacles import TOLERANCE_M, Obstacles, Volume
from fieldkit.vehicles.vehicle import Speeds
from tests.missions.clearance import is_clear
from tests.routing.single_leg import safe_leg

SPEEDS = Speeds(cruise_mps=2.0, climb_mps=1.5, descent_mps=1.0, acceleration_mps2=1.0, yaw_dps=60.0)
PLOT = ((-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0))
PLANTS = Volume("plot-1", PLOT, 2.5, 0.5, "plants")


def field(seed: int) -> Obstacles:
    """A fenced field with plots, masts, a zone and a ceiling, at random."""
    rng = np.random.default_rng(seed)
    volumes = [PLANTS]
    for k in range(int(rng.integers(0, 6))):
        x, y = rng.uniform(-15, 15, 2)
        w, h = rng.uniform(0.5, 4, 2)
        corners = ((x, y), (x + w, y), (x + w, y + h), (x, y + h))
        volumes.append(Volume(f"block-{k}", corners, float(rng.uniform(1, 12)), float(rng.uniform(0, 1))))
    volumes.append(Volume.cylinder("mast", (6.0, 0.0), 0.2, 20.0, 1.0))
    volumes.append(Volume.no_fly("yard", ((8.0, -6.0), (9.0, -6.0), (9.0, 6.0), (8.5, 0.0), (8.0, 6.0)), 0.5))
    fence = (((-18.0, -18.0), (18.0, -18.0), (18.0, 18.0), (0.0, 8.0), (-18.0, 18.0)),)
    return Obstacles(tuple(volumes), fence, 0.5, ceiling_m=float(rng.uniform(6, 30)))


@given(st.integers(0, 10**6), st.one_of(st.none(), st.floats(0, 8)))
def test_every_leg_is_clear_by_sampling(seed: int, level: float | None) -> None:
    obstacles = field(seed)
    rng = np.random.default_rng(seed + 1)
    places = rng.uniform((-17, -17, 0.5), (17, 17, 6), (40, 3))
    places = places[~obstacles.blocked(places, places)]
    ends = places[: len(places) // 2 * 2].reshape(-1, 2, 3)
    together = legs_between(ends[:, 0], ends[:, 1], obstacles, SPEEDS, level_m=level)
    for k, (a, b) in enumerate(ends):
        if math.isinf(together.time_s[k]):
            with pytest.raises(MissionError, match="no safe way"):
                safe_leg(a, b, obstacles, SPEEDS, level_m=level)
            continue
        leg = safe_leg(a, b, obstacles, SPEEDS, level_m=level)
        np.testing.assert_allclose((leg.points[0], leg.points[-1]), (a, b))
        assert is_clear(leg.points, obstacles)
        assert is_clear(together.places(k), obstacles)
        assert together.via_counts[k] == len(together.places(k)) - 2
        assert leg.time_s == pytest.approx(path_time_s(leg.points, SPEEDS))
        assert together.time_s[k] == pytest.approx(path_time_s(together.places(k), SPEEDS))
        assert leg.time_s >= stretch_time_s(a, b, SPEEDS) - 1e-9
        assert leg.length_m >= np.linalg.norm(b - a) - 1e-9
        if level is not None and len(leg.points) > 2:
            # Between the upright stretches it is not below the level.
            upright = np.linalg.norm(np.diff(np.array(leg.points)[:, :2], axis=0), axis=1) < 1e-6
            heights = np.array(leg.points)[:, 2]
            assert (np.minimum(heights[:-1], heights[1:])[~upright] >= min(level, heights.max()) - 1e-9).all()


def test_straight_where_that_is_clear() -> None:
    obstacles = Obstacles((PLANTS,))
    leg = safe_leg((-5, 0, 4), (5, 0, 3.1), obstacles, SPEEDS)
    assert leg.points == ((-5.0, 0.0, 4.0), (5.0, 0.0, 3.1))
    assert leg.via == ()
    same = safe_leg((5, 0, 3), (5, 0, 3), obstacles, SPEEDS)
    assert (same.length_m, same.time_s) == (0.0, 0.0)


def test_over_where_that_is_quicker_and_around_where_it_is_not() -> None:
    over = safe_leg((-5, 0, 2), (5, 0, 2), Obstacles((PLANTS,)), SPEEDS)
    height = 3.0
    assert over.points == ((-5.0, 0.0, 2.0), (-5.0, 0.0, height), (5.0, 0.0, height), (5.0, 0.0, 2.0))
    assert over.length_m == pytest.approx(12.0)
    tall = Volume("poplar", PLOT, 25.0, 0.5)
    around = safe_leg((-5, 0, 2), (5, 0, 1), Obstacles((tall,)), SPEEDS)
    assert {abs(x) for x, _, _ in around.via} <= {2.55}
    assert all(1.0 < z < 2.0 for _, _, z in around.via)
    assert len(around.via) == 2
    # A corner only: one place is flown around.
    assert len(safe_leg((-5, 1.8, 2), (1.8, -5, 2), Obstacles((tall,)), SPEEDS).via) == 1


def test_level_over_some_and_around_the_rest() -> None:
    obstacles = Obstacles((PLANTS, Volume.cylinder("mast", (6.0, 0.0), 0.2, 40.0, 1.0)), ceiling_m=30.0)
    leg = safe_leg((0, 0, 3.5), (10, 0, 2), obstacles, SPEEDS)
    assert is_clear(leg.points, obstacles)
    assert max(z for _, _, z in leg.points) == 3.5
    level = safe_leg((-5, 0, 1), (10, 0, 2), obstacles, SPEEDS, level_m=5.0)
    assert is_clear(level.points, obstacles)
    assert [z for _, _, z in level.points[1:-1]] == [5.0] * (len(level.points) - 2)
    # Between plants on all sides and under a zone's edge: both are needed at once.
    wall = Volume.no_fly("wall", ((5.0, -4.0), (6.0, -4.0), (6.0, 4.0), (5.0, 4.0)))
    ring = (
        (-3.0, -3.0),
        (3.0, -3.0),
        (3.0, 3.0),
        (-3.0, 3.0),
        (-3.0, 0.1),
        (-2.0, 0.1),
        (-2.0, 2.0),
        (2.0, 2.0),
        (2.0, -2.0),
        (-2.0, -2.0),
        (-2.0, -0.1),
        (-3.0, -0.1),
    )
    both = Obstacles((Volume("ring", ring, 2.0, 0.5, "plants"), wall), ceiling_m=10.0)
    leg = safe_leg((0, 0, 1), (9, 0, 1), both, SPEEDS)
    assert is_clear(leg.points, both)
    assert max(z for _, _, z in leg.points) >= 2.5 - TOLERANCE_M


def test_fence_is_flown_around_or_refused() -> None:
    notch = ((-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (0.0, -5.0), (-10.0, 10.0))
    a, b = (-8.0, 3.0, 2.0), (8.0, 3.0, 2.0)
    leg = safe_leg(a, b, Obstacles(fence=(notch,)), SPEEDS)
    assert is_clear(leg.points, Obstacles(fence=(notch,)))
    assert len(leg.via) == 1
    assert leg.via[0][:2] == pytest.approx((0.0, -5.0), abs=0.2)
    apart = Obstacles(
        fence=(
            ((-10.0, 0.0), (-5.0, 0.0), (-5.0, 5.0), (-10.0, 5.0)),
            ((5.0, 0.0), (10.0, 0.0), (10.0, 5.0), (5.0, 5.0)),
        )
    )
    with pytest.raises(MissionError, match="from home to station 3: the straight way leaves the fence, which may not"):
        safe_leg(a, b, apart, SPEEDS, names=("home", "station 3"))


def test_why_there_is_no_way() -> None:
    room = ((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0))
    hedge = Volume("hedge", ((-1.0, -30.0), (1.0, -30.0), (1.0, 30.0), (-1.0, 30.0)), 8.0, 1.0)
    low = Obstacles((hedge,), (room,), ceiling_m=6.0)
    with pytest.raises(MissionError, match=r"near to hedge; over it, 9.00 m above home, is above the ceiling"):
        safe_leg((-5, 0, 2), (5, 0, 2), low, SPEEDS)
    with pytest.raises(MissionError, match=r"flown 7.00 m above home, and the ceiling is 6 m"):
        safe_leg((-5, 0, 2), (5, 0, 2), low, SPEEDS, level_m=7.0)
    assert safe_leg((-5, 0, 2), (5, 0, 2), Obstacles((hedge,), (room,), ceiling_m=9.5), SPEEDS).points[1][2] == 9.0


@pytest.mark.parametrize(
    ("place", "message"),
    [
        (
            (0, 0, 2),
            r"station 2: is 0.98 m too low over the plants of plot-1, which are kept clear of up to 2.98 m",
        ),
        ((2.3, 0, 2), "0.98 m too low over the plants of plot-1"),
        ((6, 0, 2), "is in mast"),
        ((8.5, -3, 2), "is in the no-fly zone yard"),
        ((0, -30, 2), "is outside the fence"),
        ((-9, 0, 50), "is above the ceiling"),
    ],
)
def test_an_end_in_an_obstacle_is_named(place: tuple[float, float, float], message: str) -> None:
    with pytest.raises(MissionError, match=message):
        safe_leg((-5.0, -5.0, 4.0), place, field(0), SPEEDS, names=("home", "station 4"))


def test_station_beside_a_plant_below_its_top_is_climbed_from() -> None:
    leg = safe_leg((2.5, 0, 0.8), (-2.5, 0, 0.8), Obstacles((PLANTS,), ceiling_m=10.0), SPEEDS)
    assert is_clear(leg.points, Obstacles((PLANTS,)))
