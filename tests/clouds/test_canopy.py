"""Cover, canopy volume and height of shapes whose figures are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.arrays import FloatArray
from fieldkit.clouds.canopy import (
    Canopy,
    canopy,
    floats_from_m,
    highest_leaf_m,
    rectangle,
    seam_cells,
    stands_in,
)

PIXEL_M = 0.002
SLOW = settings(max_examples=12, deadline=None)


def box(width: float, depth: float, height: float, step: float = 0.0015) -> FloatArray:
    """Points on the faces of a box that stands on the ground about the origin."""
    x, y, z = (np.linspace(0.0, edge, max(2, round(edge / step) + 1)) for edge in (width, depth, height))
    faces = []
    for a, b, axis, ends in ((x, y, 2, z), (x, z, 1, y), (y, z, 0, x)):
        u, v = (grid.ravel() for grid in np.meshgrid(a, b))
        faces += [np.insert(np.column_stack([u, v]), axis, end, axis=1) for end in (ends[0], ends[-1])]
    found: FloatArray = np.concatenate(faces) - (width / 2, depth / 2, 0.0)
    return found


def seen(points: FloatArray, pixel_m: float = PIXEL_M, swayed_m: float = 0.0) -> Canopy:
    return canopy(points, points[:, 2], pixel_m, swayed_m)


class TestShapes:
    @given(st.floats(0.08, 0.4), st.floats(0.08, 0.4), st.floats(0.1, 0.8), st.floats(0.0, 0.02))
    @SLOW
    def test_a_box_less_its_seam(self, width: float, depth: float, height: float, swayed_m: float) -> None:
        """The seam is what leaves are widened by, and lack where they sway; half a cell of it is the grid's own."""
        found = seen(box(width, depth, height), swayed_m=swayed_m)
        seam = 2.0 * (seam_cells(PIXEL_M, swayed_m) - 0.5) * PIXEL_M
        assert found.covered_m2 == pytest.approx((width - seam) * (depth - seam), abs=(width + depth) * PIXEL_M)
        assert found.volume_m3 == pytest.approx(found.covered_m2 * height, rel=1e-5)

    @pytest.mark.parametrize(("step", "whole"), [(0.003, True), (0.006, False)])
    def test_gaps_of_a_leaf_in_fine_cells(self, step: float, whole: bool) -> None:
        found = seen(box(0.1, 0.06, 0.05, step), pixel_m=0.0004)
        assert (found.covered_m2 == pytest.approx(0.006, rel=0.04)) == whole
        assert found.volume_m3 == pytest.approx(found.covered_m2 * 0.05, rel=1e-5)

    def test_the_tops_of_swaying_leaves_reach_over_what_is_seen_between_them(self) -> None:
        rng = np.random.default_rng(1)
        leaf, below = rng.uniform(0, 0.2, (4_000, 2)), rng.uniform(0, 0.2, (60_000, 2))
        points = np.concatenate([np.insert(leaf, 2, 0.4, axis=1), np.insert(below, 2, 0.2, axis=1)])
        still, swaying = (found.volume_m3 / found.covered_m2 for found in (seen(points), seen(points, swayed_m=0.005)))
        assert still < 0.38 < swaying

    def test_an_upper_leaf_is_narrowed_over_a_lower_one_as_over_soil(self) -> None:
        upper, lower = (np.add(box(width, 0.2, 0.0), (0, 0, z)) for width, z in ((0.06, 0.5), (0.3, 0.1)))
        tops = seen(np.concatenate([upper, lower])).tops
        alone = seen(upper).covered_m2
        assert float((tops > 0.3).sum()) * PIXEL_M**2 == pytest.approx(alone, rel=0.06)

    def test_gaps_between_points_are_covered(self) -> None:
        rng = np.random.default_rng(1)
        dense = np.column_stack([rng.uniform(0, 0.2, (60_000, 2)), np.full(60_000, 0.4)])
        sparse = dense[rng.uniform(size=len(dense)) < 0.3]
        assert seen(sparse).covered_m2 == pytest.approx(seen(dense).covered_m2, rel=0.04)


class TestInvariance:
    @given(st.floats(-5, 5), st.floats(-5, 5))
    @SLOW
    def test_a_place_changes_nothing(self, x: float, y: float) -> None:
        points = box(0.2, 0.3, 0.4)
        moved = points + np.array([x, y, 0.0])
        assert seen(moved).covered_m2 == pytest.approx(seen(points).covered_m2, rel=0.04)

    def test_a_large_plot_takes_coarser_cells(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("fieldkit.clouds.canopy.MOST_CELLS", 10_000)
        found = seen(box(0.4, 0.4, 0.5))
        assert found.cover.size < 15_000
        assert found.covered_m2 == pytest.approx(0.4**2, rel=0.06)


class TestOutline:
    def test_half_a_box(self) -> None:
        found = seen(box(0.2, 0.2, 0.5))
        half = found.within(rectangle((-1.0, -1.0), (0.0, 1.0)))
        assert half.covered_m2 == pytest.approx(0.5 * found.covered_m2, rel=0.03)
        assert half.volume_m3 == pytest.approx(0.5 * found.volume_m3, rel=0.03)
        assert found.within(rectangle((1.0, 1.0), (2.0, 2.0))).covered_m2 == 0.0


class TestHeight:
    def test_what_floats_above_a_leaf_does_not_count(self) -> None:
        rng = np.random.default_rng(0)
        clump = rng.normal((0.0, 0.0, 0.56), 0.006, (60, 3))  # near enough to pass for a part of the plant
        points = np.concatenate([box(0.1, 0.1, 0.5), clump, [[0.0, 0.0, 0.52]]])
        assert highest_leaf_m(points, points[:, 2], PIXEL_M) == pytest.approx(0.5, abs=1e-6)

    def test_a_thin_tip_counts(self) -> None:
        tip = np.column_stack([np.zeros(60), np.zeros(60), np.linspace(0.5, 0.62, 60)])
        points = np.concatenate([box(0.1, 0.1, 0.5), tip])
        assert highest_leaf_m(points, points[:, 2], PIXEL_M) == pytest.approx(0.62, abs=1e-6)

    def test_a_leaf_whose_stem_is_missing_counts(self) -> None:
        leaf = np.random.default_rng(0).uniform((0.3, 0.3, 0.7), (0.4, 0.34, 0.7005), (4000, 3))
        points = np.concatenate([box(0.1, 0.1, 0.5), leaf])
        assert highest_leaf_m(points, points[:, 2], PIXEL_M) == pytest.approx(0.7, abs=0.001)


def test_leaves_that_hang_over_the_edge_of_a_plot_are_of_the_plants_they_grow_on() -> None:
    rng = np.random.default_rng(3)
    own, others = rng.uniform((-1.0, -1.0, 0.2), (0.0, 1.0, 0.8), (8000, 3)), rng.uniform(-1.0, 1.0, (8000, 3))
    others = others * (0.5, 1.0, 0.5) + (0.5, 0.0, 0.7)  # up to 1.2 m, beside the plot
    hangs_in, hangs_out = np.array([[-0.1, 0.5, 1.1], [-0.05, 0.5, 1.15]]), np.array([[0.02, -1.1, 0.6]])
    outline = rectangle((-1.0, -1.0), (0.0, 1.0))
    assert not stands_in(np.concatenate([hangs_in, own, others]), outline)[:2].any()
    assert stands_in(np.concatenate([hangs_out, own]), outline)[0]
    assert stands_in(own, outline).all()


def test_what_floats_over_an_empty_layer_is_no_canopy() -> None:
    rng = np.random.default_rng(2)
    canopy_m, tip_m = rng.uniform(0.2, 1.4, 50_000), rng.uniform(1.4, 1.62, 300)
    clumps = np.concatenate([rng.uniform(2.1, 2.15, 40), rng.uniform(4.9, 5.1, 30)])
    assert floats_from_m(np.concatenate([canopy_m, tip_m, clumps])) == pytest.approx(1.65, abs=0.04)
    assert floats_from_m(np.concatenate([canopy_m, tip_m])) >= tip_m.max()
    swarm_m = 1.6 + 1.4 * rng.uniform(0.0, 1.0, 3_000) ** 0.25
    both_m = np.concatenate([canopy_m, tip_m[tip_m < 1.6], swarm_m])
    assert floats_from_m(both_m) == pytest.approx(1.65, abs=0.06)
    # Cut off in the swarm, what floats is told; cut off in the canopy, plants go on.
    assert floats_from_m(both_m[both_m < 2.2], 2.2) == pytest.approx(1.65, abs=0.06)
    assert floats_from_m(both_m[both_m < 1.3], 1.3) >= 1.3
