"""Height, cover and hull of plants on shapes whose figures are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fieldkit.clouds import Cloud
from fieldkit.clouds.ground import Plane
from fieldkit.clouds.plant_figures import (
    CELL_M,
    PlantFigures,
    cell_edge_m,
    covered_m2,
    hull_m3,
    plant_figures,
    voxel_edge_m,
)
from fieldkit.clouds.volume import Volume
from tests.clouds.examples import cone

Array = NDArray[np.float64]
GROUND = Plane(np.array([0.0, 0.0, 1.0]), 0.0, 0.003, 0.5, 0.01)
VOLUME = Volume((-1.0, -1.0, -0.2), (1.0, 1.0, 2.0))
GSD_M = 0.0008
SLOW = settings(max_examples=12, deadline=None)


def box(width: float, depth: float, height: float, step: float = 0.003) -> Array:
    """Points on the faces of a box that stands on the ground about the origin."""
    x, y, z = (np.linspace(0.0, edge, max(2, round(edge / step) + 1)) for edge in (width, depth, height))
    faces = []
    for a, b, axis, ends in ((x, y, 2, z), (x, z, 1, y), (y, z, 0, x)):
        u, v = (grid.ravel() for grid in np.meshgrid(a, b))
        faces += [np.insert(np.column_stack([u, v]), axis, end, axis=1) for end in (ends[0], ends[-1])]
    found: Array = np.concatenate(faces) - (width / 2, depth / 2, 0.0)
    return found


def shifted(points: Array, x: float, y: float = 0.0, z: float = 0.0) -> Array:
    return points + np.array([x, y, z])


def figures(points: Array, volume: Volume = VOLUME, ground: Plane | None = GROUND) -> PlantFigures:
    found = plant_figures(Cloud(points), volume, ground, GSD_M)
    assert found is not None
    return found


class TestShapes:
    @given(st.floats(0.08, 0.4), st.floats(0.08, 0.4), st.floats(0.1, 0.8))
    @SLOW
    def test_box(self, width: float, depth: float, height: float) -> None:
        found = figures(box(width, depth, height, 0.004))
        assert found.height_max_m == pytest.approx(height, abs=1e-9)
        assert found.height_m is not None
        assert height * 0.85 <= found.height_m <= height + 1e-9
        # Edges may fall on those of cells: off by one cell along each axis at most.
        assert found.covered_m2 == pytest.approx(width * depth, abs=1.1 * (width + depth) * found.cell_m)
        # Voxel means lie up to half a voxel inside.
        inner = np.prod([edge - 0.012 for edge in (width, depth, height)])
        assert inner <= found.hull_m3 <= width * depth * height + 1e-9
        assert found.area_m2 == pytest.approx(4.0)

    @given(st.floats(0.1, 0.5), st.floats(0.2, 1.0))
    @SLOW
    def test_cone(self, radius: float, height: float) -> None:
        found = figures(cone(radius, height))
        assert found.height_max_m == pytest.approx(height, abs=0.02)
        # Half of a cone's side lies above height · (1 − √½); 5 % of it above height · (1 − √0.05).
        assert found.height_m == pytest.approx(height * (1 - np.sqrt(0.05)), abs=0.03 * height + 0.01)
        assert found.covered_m2 == pytest.approx(np.pi * radius**2, rel=0.12)
        assert found.hull_m3 == pytest.approx(np.pi * radius**2 * height / 3, rel=0.12)

    @pytest.mark.parametrize(("width", "off"), [(0.02, 0.25), (0.05, 0.12), (0.08, 0.10)])
    def test_leaves_are_as_wide_as_they_are(self, width: float, off: float) -> None:
        """Strips at any angle: cells that the edge runs through count in part. Without a seam, thin ones lose some."""
        rng = np.random.default_rng(3)
        shares = []
        for turn in np.radians([0, 7, 30, 45, 66, 90]):
            along, across = rng.uniform(0, 0.5, 40_000), rng.uniform(0, width, 40_000)
            places = np.column_stack(
                [along * np.cos(turn) - across * np.sin(turn), along * np.sin(turn) + across * np.cos(turn)]
            )
            shares.append(covered_m2(places, 0.005) / (0.5 * width))
        assert np.mean(shares) == pytest.approx(1.0, abs=off)
        assert np.ptp(shares) < 0.35

    def test_leaning_ground(self) -> None:
        slope = np.radians(8.0)
        normal = np.array([-np.sin(slope), 0.0, np.cos(slope)])
        points = box(0.3, 0.3, 0.5)
        lifted = points + np.outer(points[:, 0], (0.0, 0.0, np.tan(slope)))
        found = figures(lifted, ground=Plane(normal, 0.0, 0.003, 0.5, 0.01))
        assert found.height_max_m == pytest.approx(0.5 * np.cos(slope), abs=1e-6)

    def test_without_ground(self) -> None:
        found = figures(box(0.3, 0.3, 0.5), ground=None)
        assert (found.height_m, found.height_max_m) == (None, None)
        assert found.covered_m2 > 0


class TestInvariance:
    @given(st.integers(0, 2**32 - 1))
    @SLOW
    def test_order_does_not_matter(self, seed: int) -> None:
        points = cone(0.3, 0.8, 4000)
        shuffled = np.random.default_rng(seed).permutation(points)
        first, second = figures(points), figures(shuffled)
        assert second.height_m == first.height_m
        assert second.cover == first.cover
        assert second.hull_m3 == pytest.approx(first.hull_m3)

    @given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0, 360))
    @SLOW
    def test_moved_and_turned(self, x: float, y: float, turn_deg: float) -> None:
        """But for how points fall into voxels."""
        points = np.concatenate([cone(0.3, 0.8), shifted(box(0.2, 0.1, 0.4, 0.005), 0.35)])
        turn = np.radians(turn_deg)
        rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        first, second = figures(points), figures(shifted(points @ rotation.T, x, y), VOLUME.grown(0.6))
        assert second.height_m == pytest.approx(first.height_m, abs=0.02)
        assert second.height_max_m == pytest.approx(first.height_max_m, abs=1e-9)
        assert second.covered_m2 == pytest.approx(first.covered_m2, rel=0.06)
        assert second.hull_m3 == pytest.approx(first.hull_m3, rel=0.04)

    @given(st.floats(1.0, 2.0), st.floats(1.0, 2.0))
    @SLOW
    def test_grows_with_the_plants_height(self, lower: float, higher: float) -> None:
        lower, higher = sorted((lower, higher))
        points = cone(0.3, 0.7)
        first, second = (figures(points * (1.0, 1.0, stretch)) for stretch in (lower, higher))
        assert first.height_m is not None
        assert second.height_m is not None
        assert second.height_m >= first.height_m - 0.01
        assert second.height_max_m is not None
        assert second.height_max_m >= (first.height_max_m or 0.0)
        assert second.hull_m3 >= 0.98 * first.hull_m3

    def test_what_is_denser_does_not_count_more(self) -> None:
        """A camera near the foot gives it ten times the points."""
        points = cone(0.3, 0.8)
        low = np.concatenate([points] + 10 * [points[points[:, 2] < 0.2]])
        assert figures(low).height_m == pytest.approx(figures(points).height_m, abs=0.005)


class TestVolume:
    def test_nothing(self) -> None:
        assert plant_figures(Cloud.empty(), VOLUME, GROUND, GSD_M) is None

    def test_what_lies_outside_of_the_volume_does_not_count(self) -> None:
        other = shifted(cone(0.3, 1.5), 3.0)
        assert figures(np.concatenate([cone(0.3, 0.8), other])) == figures(cone(0.3, 0.8))


@pytest.mark.parametrize("gsd_m", [0.0, -1.0, float("nan"), float("inf")])
def test_a_sampling_distance_that_is_none(gsd_m: float) -> None:
    with pytest.raises(ValueError, match="ground sampling distance"):
        plant_figures(Cloud(cone(0.3, 0.8)), VOLUME, GROUND, gsd_m)


def test_edges_of_voxels_and_cells() -> None:
    assert voxel_edge_m(0.0005) == 0.01
    assert voxel_edge_m(0.003) == pytest.approx(0.03)
    grid = np.stack(np.meshgrid(np.arange(40), np.arange(40), [0]), axis=-1).reshape(-1, 3).astype(np.float64)
    assert cell_edge_m(0.004 * grid) == pytest.approx(0.012)
    assert cell_edge_m(0.0001 * grid) == CELL_M[0]
    assert cell_edge_m(grid) == CELL_M[1]
    assert cell_edge_m(grid[:1]) == CELL_M[1]


def test_hull_of_flat_things() -> None:
    flat = np.random.default_rng(0).uniform(size=(50, 3)) * (1, 1, 0)
    assert hull_m3(flat) == 0.0
    assert hull_m3(flat[:3]) == 0.0
    assert covered_m2(np.zeros((0, 2)), 0.005) == 0.0
