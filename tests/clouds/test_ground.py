from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.clouds import fit_ground_plane, read_ply
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.results.fields import vector
from fieldkit.results.frame import Plane
from tests.clouds.examples import leaves


def plot(seed: int, *, soil: int = 3000, plants: int = 30_000, clutter: int = 1500) -> tuple[np.ndarray, np.ndarray]:
    """Points of a plot with rough soil at z = 0 and noise below it, most points on plants; and camera centres."""
    rng = np.random.default_rng(seed)
    ground = np.column_stack([rng.uniform(-1.5, 1.5, (soil, 2)), rng.normal(0, 0.005, soil)])
    canopy = leaves(plants, noise_m=0.002, seed=seed) * [1.2, 1.2, 0.9] + [0, 0, 0.6]
    below = rng.uniform([-1.5, -1.5, -0.8], [1.5, 1.5, 0.0], (clutter, 3))
    angle = np.linspace(0, 2 * np.pi, 10, endpoint=False)
    cameras = np.column_stack([2.5 * np.cos(angle), 2.5 * np.sin(angle), np.full(10, 1.8)])
    return np.concatenate([ground, canopy[canopy[:, 2] > 0], below]), cameras


@given(st.integers(0, 2**32 - 1), st.sampled_from([(3000, 30_000, 0), (3000, 30_000, 1500), (6000, 6000, 3000)]))
@settings(max_examples=15)
def test_ground_under_plants_in_any_orientation(seed: int, counts: tuple[int, int, int]) -> None:
    soil, plants, clutter = counts
    points, cameras = plot(seed % 1000, soil=soil, plants=plants, clutter=clutter)
    rng = np.random.default_rng(seed)
    turn = Similarity(1.0, rotation_from_vector(rng.normal(size=3) * 2), rng.normal(size=3) * 1000)
    plane = fit_ground_plane(turn.apply(points), turn.apply(cameras), seed=seed)
    up = turn.rotation[:, 2]
    assert np.degrees(np.arccos(min(1.0, plane.normal @ up))) < 0.5
    heights = plane.heights(turn.apply([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(heights, [0.0, 1.0], atol=0.006)
    assert 0 < plane.rms_m < plane.tolerance_m
    assert 0.03 < plane.inlier_share < 0.7


def test_a_canopy_that_is_flatter_than_the_soil_is_not_the_ground() -> None:
    rng = np.random.default_rng(0)
    soil = np.column_stack([rng.uniform(-1, 1, (4000, 2)), rng.normal(0, 0.006, 4000)])
    canopy = np.column_stack([rng.uniform(-1, 1, (9000, 2)), rng.normal(0.8, 0.001, 9000)])
    cameras = np.column_stack([rng.uniform(-1, 1, (8, 2)), np.full(8, 3.0)])
    plane = fit_ground_plane(np.concatenate([soil, canopy]), cameras)
    assert abs(plane.heights(np.zeros((1, 3)))[0]) < 0.01


def test_a_known_up_direction_rules_out_slanting_planes() -> None:
    rng = np.random.default_rng(0)
    soil = np.column_stack([rng.uniform(-0.5, 0.5, (1500, 2)), rng.normal(0, 0.002, 1500)])
    panel = np.column_stack([rng.uniform(-0.5, 0.5, (9000, 2)), np.zeros(9000)])
    panel[:, 2] = 0.6 + panel[:, 0] + rng.normal(0, 0.001, 9000)
    points = np.concatenate([soil, panel])
    assert fit_ground_plane(points, [[-2.0, 0, 3]]).tilt_deg() > 40
    assert fit_ground_plane(points, [[-2.0, 0, 3]], up=[0.1, 0.1, 2.0]).tilt_deg() < 1


def canopy(seed: int, *, soil: int, leaves: int = 3000) -> tuple[np.ndarray, np.ndarray]:
    """Well-seen points of ten rows of maize, most of them high in the leaves, and some on the soil between the rows;
    and cameras above."""
    rng = np.random.default_rng(seed)
    rows = 0.75 * rng.integers(-5, 5, leaves + soil)
    along, across = rng.uniform(-2.5, 2.5, leaves + soil), rng.normal(0.0, 0.16, leaves + soil)
    height = 0.15 + 1.2 * rng.beta(2.5, 1.5, leaves + soil)
    rows[leaves:] += 0.375
    across[leaves:] *= 0.5
    height[leaves:] = rng.normal(0.0, 0.008, soil)
    cameras = np.column_stack([rng.uniform(-3, 3, 40), rng.uniform(-0.8, 0.8, 40), np.full(40, 2.5)])
    return np.column_stack([along, rows + across, height]), cameras


@given(st.integers(0, 2**32 - 1), st.integers(80, 1000), st.floats(0.0, 5.0))
@settings(max_examples=5)
def test_a_few_points_between_rows_are_a_good_ground(seed: int, soil: int, tilt_deg: float) -> None:
    points, cameras = canopy(seed, soil=soil)
    turn = rotation_from_vector(np.radians([tilt_deg, 0.0, 0.0]))
    plane = fit_ground_plane(
        points @ turn.T, cameras @ turn.T, up=[0, 0, 1], well_seen=np.ones(len(points), bool), seed=seed
    )
    np.testing.assert_allclose(plane.heights(points[-soil:] @ turn.T), points[-soil:, 2], atol=0.02)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=5)
def test_many_points_in_the_leaves_are_none(seed: int) -> None:
    points, cameras = canopy(seed, soil=0)
    with pytest.raises(ReconstructionError, match="no ground plane"):
        fit_ground_plane(points, cameras, up=[0, 0, 1], well_seen=np.ones(len(points), bool), seed=seed)


def test_levelling_puts_the_ground_at_zero() -> None:
    for normal in ([0, 0, 1], [0, 0, -1], [1, 0, 0], [0.3, -0.5, -0.8]):
        unit = np.array(normal) / np.linalg.norm(normal)
        plane = Plane(vector(unit), 2.5, 0.0, 1.0, 0.01)
        origin = np.array([4.0, 5.0, 6.0])
        level = plane.levelling(origin)
        np.testing.assert_allclose(level.rotation @ level.rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(level.rotation) == pytest.approx(1.0)
        points = np.random.default_rng(0).normal(size=(20, 3))
        np.testing.assert_allclose(level.apply(points)[:, 2], plane.heights(points), atol=1e-9)
        np.testing.assert_allclose(level.apply(origin)[:2], 0.0, atol=1e-9)


def test_a_plant_without_any_ground_is_told(data_folder: Path) -> None:
    basil = read_ply(data_folder / "basil_rig" / "reference_cloud.ply")
    cameras = basil.points.mean(axis=0) + np.array([[300.0, 0, 250], [-300, 0, 250], [0, 300, 250]])
    with pytest.raises(ReconstructionError, match="noticeable share"):
        fit_ground_plane(basil.points, cameras, up=[0, 0, 1])
