"""Legs against plants, obstacles, zones, fences and ceilings."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.errors import MissionError
from fieldkit.routing.obstacles import TOLERANCE_M, Obstacles, Volume
from tests.missions.clearance import is_clear

SQUARE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
HORSESHOE = ((-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (1.0, 3.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 3.0), (-3.0, 3.0))


def star(seed: int, corners: int, centre: tuple[float, float] = (0.0, 0.0)) -> tuple[tuple[float, float], ...]:
    """A simple polygon with corners in and out."""
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0, 2 * np.pi, corners)) + np.arange(corners) * 1e-3
    reach = rng.uniform(0.5, 4.0, corners)
    return tuple(
        (centre[0] + float(r * math.cos(t)), centre[1] + float(r * math.sin(t)))
        for r, t in zip(reach, angles, strict=True)
    )


@given(st.integers(0, 10**6), st.integers(5, 14), st.floats(0.0, 1.0), st.booleans())
def test_agrees_with_shapely_on_any_polygon(seed: int, corners: int, clearance: float, fenced: bool) -> None:
    footprint = star(seed, corners)
    if not shapely.Polygon(footprint).is_valid:
        return
    rng = np.random.default_rng(seed + 1)
    volume = Volume("hedge", footprint, 2.0, clearance)
    fence = (((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (0.0, 2.0), (-5.0, 5.0)),) if fenced else ()
    obstacles = Obstacles((volume,), fence)
    a, b = (rng.uniform((-6, -6, 0), (6, 6, 4), (60, 3)) for _ in range(2))
    a[:5, :2] = b[:5, :2]
    plan, top = volume.solid
    found = obstacles.blocked(a, b)
    for start, stop, blocked in zip(a, b, found, strict=True):
        # Of the part that is below the top, the shadow.
        low, high = sorted((start, stop), key=lambda place: place[2])
        part = 1.0 if high[2] < top else max((top - low[2]) / (high[2] - low[2]), 0.0)
        shadow = shapely.LineString([low[:2], (low + part * (high - low))[:2]])
        shadow = shapely.Point(low[:2]) if shadow.length == 0.0 else shadow
        expected = low[2] < top and plan.intersects(shadow)
        if fenced:
            whole = (
                shapely.LineString([start[:2], stop[:2]]) if (start[:2] != stop[:2]).any() else shapely.Point(start[:2])
            )
            expected |= not shapely.Polygon(fence[0]).contains_properly(whole)
        assert blocked == expected
        assert bool(obstacles.leg_problems(start, stop)) == blocked


@given(st.integers(0, 10**6))
def test_clear_legs_have_no_sample_inside_and_problems_are_where_they_begin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    obstacles = Obstacles(
        (Volume("plot-1", SQUARE, 2.0, 0.5, "plants"), Volume.cylinder("mast", (3.0, 2.0), 0.3, 6.0, 0.7)),
        ceiling_m=8.0,
    )
    for _ in range(20):
        a, b = rng.uniform((-5, -5, 0), (5, 5, 9), (2, 3))
        problems = obstacles.leg_problems(a, b)
        if not problems:
            assert is_clear([a, b], obstacles)
        for problem in problems:
            share = np.linalg.norm(np.array(problem.place) - a) / np.linalg.norm(b - a)
            np.testing.assert_allclose(a + share * (b - a), problem.place, atol=1e-9)
            before = obstacles.leg_problems(a, a + max(share - 1e-6, 0.0) * (b - a))
            assert share < 1e-6 or problem.kind not in {p.kind for p in before if p.name == problem.name}


def test_heights_and_sides_of_a_prism() -> None:
    obstacles = Obstacles((Volume("plot-1", SQUARE, 2.0, 0.5, "plants"),))
    over, side = 2.5 - TOLERANCE_M, 1.5 - TOLERANCE_M
    assert not obstacles.blocked([[-5, 0, over]], [[5, 0, over]])[0]
    assert obstacles.blocked([[-5, 0, over - 1e-6]], [[5, 0, over - 1e-6]])[0]
    assert not obstacles.blocked([[side + 1e-6, -5, 1]], [[side + 1e-6, 5, 1]])[0]
    assert obstacles.blocked([[side - 1e-6, -5, 1]], [[side - 1e-6, 5, 1]])[0]
    # Sinks into it from above, beside which it starts.
    assert obstacles.blocked([[0, 0, 4]], [[1, 0, 1]])[0]
    assert not obstacles.blocked([[0, 0, 4]], [[3, 0, 1]])[0]
    assert obstacles.blocked([[0, 0, 4]], [[0, 0, 1]])[0]
    assert not obstacles.blocked([[0, 0, 4]], [[0, 0, 3]])[0]


def test_between_the_arms_of_a_horseshoe() -> None:
    obstacles = Obstacles((Volume.no_fly("yard", HORSESHOE),))
    assert not obstacles.blocked([[0, 0, 1]], [[0, 9, 1]])[0]
    assert obstacles.blocked([[0, 0, 1]], [[9, 0, 1]])[0]
    assert obstacles.blocked([[0, 0, 1]], [[0, -2, 900]])[0]
    # Along an edge is in.
    assert obstacles.blocked([[1, 0, 1]], [[1, 2, 1]])[0]


def test_fence_is_left_at_a_leg_whose_ends_are_inside() -> None:
    fence = (((-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (0.0, -5.0), (-10.0, 10.0)),)
    obstacles = Obstacles(fence=fence, fence_clearance_m=0.5)
    ends = np.array([[-8.0, 3.0, 2.0], [8.0, 3.0, 2.0]])
    assert not obstacles.blocked(ends, ends).any()
    (problem,) = obstacles.leg_problems(*ends)
    assert (problem.kind, problem.name) == ("fence", "")
    assert -8.0 < problem.place[0] < 0.0
    assert str(problem).startswith("leaves the fence at ")
    # Two that overlap are one room.
    two = Obstacles(
        fence=(((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)), ((5.0, 0.0), (9.0, 0.0), (9.0, 4.0), (5.0, 4.0)))
    )
    assert not two.blocked([[1, 1, 1]], [[8, 3, 1]])[0]
    assert two.blocked([[1, 1, 1]], [[8, 5, 1]])[0]


def test_ceiling() -> None:
    obstacles = Obstacles(ceiling_m=10.0)
    assert not obstacles.blocked([[0, 0, 10]], [[5, 0, 10]])[0]
    (problem,) = obstacles.leg_problems((0, 0, 5), (10, 0, 15))
    assert problem.kind == "ceiling"
    assert problem.place == pytest.approx((5.0, 0.0, 10.0), abs=0.03)


def test_what_is_of_no_use_is_refused() -> None:
    with pytest.raises(MissionError, match="no simple polygon"):
        Volume.no_fly("zone", ((0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)))
    with pytest.raises(MissionError, match="fewer than three"):
        Volume.no_fly("zone", ((0.0, 0.0), (1.0, 1.0)))
    with pytest.raises(MissionError, match="farther than"):
        Volume.no_fly("zone", ((0.0, 0.0), (1e6, 1.0), (1.0, 0.0)))
    with pytest.raises(MissionError, match="farther than"):
        Volume.no_fly("zone", ((0.0, 0.0), (math.nan, 1.0), (1.0, 0.0)))
    with pytest.raises(MissionError, match="is no height"):
        Volume("hut", SQUARE, math.nan)
    with pytest.raises(MissionError, match="leaves no room"):
        Obstacles(fence=(SQUARE,), fence_clearance_m=1.5)
    with pytest.raises(MissionError, match="farther than"):
        Obstacles().blocked([[math.inf, 0, 0]], [[0, 0, 0]])
    assert not Obstacles().blocked(np.zeros((1, 3)), np.ones((1, 3)))[0]
