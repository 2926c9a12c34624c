"""Evidence for a cloud: leverage of positions, support by views, roughness."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.arrays import FloatArray
from fieldkit.clouds import Cloud
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.evidence import (
    BEST_ANGLE_DEG,
    PIXEL_M,
    Evidence,
    evidence,
    hidden_sides,
    leverage,
    quality_of_views,
    worth_of_angles,
)
from fieldkit_sim.simulation import ring

CAMERA = Intrinsics.pinhole(2000, 1500, 1700.0)
RING = ring(10, 1.4, 1.1)


def leaf(noise_m: float = 0.0, step: float = 0.004, seed: int = 0) -> FloatArray:
    """Points on a level square of 0.4 m, 0.3 m above the ground."""
    rng = np.random.default_rng(seed)
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(-0.2, 0.2, step), np.arange(-0.2, 0.2, step)))
    return np.column_stack([x, y, np.full(len(x), 0.3)]) + rng.normal(0, noise_m, (len(x), 3)) * (0, 0, 1)


def groups_of(count: int, groups: int = 1) -> list[int]:
    return [k * groups // count for k in range(count)]


def level(points: FloatArray) -> Cloud:
    return Cloud(points, normals=np.tile(np.float32([0, 0, 1]), (len(points), 1)))


def found(points: FloatArray, poses: list[Pose] | None = None, groups: int = 1) -> Evidence:
    chosen = RING if poses is None else poses
    result = evidence(level(points), chosen, [CAMERA] * len(chosen), groups_of(len(chosen), groups), 0.01)
    assert result is not None
    return result


class TestLeverage:
    @given(st.integers(0, 1000), st.integers(6, 13))
    @settings(max_examples=8)
    def test_as_similarities_fitted_to_noise(self, seed: int, count: int) -> None:
        rng = np.random.default_rng(seed)
        centers, points = rng.normal(0, 1.0, (count, 3)), rng.normal(0, 0.3, (60, 3))
        moved = []
        for _ in range(150):
            motion = fit_similarity(centers, centers + rng.normal(0, 0.001, centers.shape))
            moved.append(motion.apply(points) - points)
        measured = float(np.sqrt(np.mean(np.square(moved)))) / 0.001
        assert leverage(centers, points) == pytest.approx(measured, rel=0.2)

    def test_cameras_close_together_leave_a_tilt(self) -> None:
        points = leaf()
        around, beside = np.array([p.center for p in RING]), np.array([p.center for p in RING])
        beside[:, :2] = 0.1 * beside[:, :2] + (1.4, 0.0)
        assert leverage(beside, points) > 3 * leverage(around, points)


class TestEvidence:
    def test_two_views_are_noisier_than_ten(self) -> None:
        assert found(leaf(), RING[:2]).noise_m > found(leaf()).noise_m

    def test_nothing(self) -> None:
        assert evidence(Cloud.empty(), RING, [CAMERA] * 10, groups_of(10), 0.01) is None
        assert evidence(Cloud(leaf()), RING, [CAMERA] * 10, groups_of(10), 0.01) is None
        assert evidence(level(leaf()), RING[:1], [CAMERA], groups_of(1), 0.01) is None


def test_a_pair_is_worth_most_at_the_best_angle() -> None:
    angles = np.array([0.0, 6.0, BEST_ANGLE_DEG, 18.0, 40.0, 90.0])
    worth = worth_of_angles(angles)
    assert worth[0] == 0.0
    assert worth[2] == pytest.approx(1.0)
    assert (np.diff(worth[:3]) > 0).all()
    assert (np.diff(worth[2:]) < 0).all()


def test_steep_surfaces_and_coarse_pixels_lessen_a_view() -> None:
    seen = np.array([True, True, True, False])
    facing, footprint = np.array([1.0, 1.0, 0.1, 1.0]), np.array([0.0, PIXEL_M, 0.0, 0.0])
    np.testing.assert_array_equal(quality_of_views(seen, facing, footprint), [1.0, 0.5, 0.0, 0.0])


def test_sides_that_no_two_photographs_show_are_named() -> None:
    poses = [Pose.look_at((1.2 * np.sin(a), 1.2 * np.cos(a), 0.6), (0, 0, 0.3)) for a in np.radians(range(0, 360, 24))]
    cameras = [CAMERA] * len(poses)
    assert hidden_sides(leaf(), poses, cameras) == []
    assert hidden_sides(leaf(), [pose for pose in poses for _ in range(5)], cameras * 5) == []
    ((start, end),) = hidden_sides(leaf(), poses[3:-1], cameras[3:-1])  # none from 336 by 0 to 72 degrees
    assert 350 <= start <= 360 or start < 20
    assert 20 <= end <= 60
    assert hidden_sides(leaf(), [Pose.look_at((x, 0.01, 2.0), (x, 0, 0)) for x in (-0.2, 0.0, 0.2)], cameras[:3]) == [
        (0.0, 360.0)
    ]
    assert hidden_sides(np.zeros((0, 3)), poses, cameras) == []
