"""True traits of plants' meshes, and the table of errors."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.true_plants import kept_truth
from fieldkit.clouds import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.truth import height_map, true_traits


def square(size: float, z: float) -> Any:
    """A level leaf, as a scene with its truth."""
    corners = np.array([[0, 0, z], [size, 0, z], [size, size, z], [0, size, z]], dtype=np.float32)
    leaf = Mesh("plant-1", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), plant=True)
    around = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], dtype=np.float32)
    soil = Mesh("soil-0", around, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    cloud = Cloud(np.random.default_rng(0).uniform((0, 0, z), (size, size, z), (2000, 3)))
    volume = Volume((-0.5, -0.5, 0.03), (1.0, 1.0, 1.0))
    return SimpleNamespace(scene=SimpleNamespace(meshes=(leaf, soil)), reference=cloud, volume=volume)


def test_of_a_leaf() -> None:
    leaf = square(0.3, 0.5)
    found = true_traits(leaf.scene.meshes, leaf.volume)
    assert found.covered_area_m2 == pytest.approx(0.09, rel=0.01)
    assert found.height_m == 0.5
    assert found.canopy_volume_m3 == pytest.approx(0.045, rel=0.01)
    assert found.cover_percent == pytest.approx(4.0, rel=0.01)


def test_a_height_map_has_the_upper_surface() -> None:
    low, high = square(0.3, 0.5).scene.meshes[0], square(0.1, 0.8).scene.meshes[0]
    found = height_map([high, low], Volume((0.0, 0.0, 0.0), (0.4, 0.4, 1.0)), 0.01)
    assert found[5, 5] == pytest.approx(0.8)
    assert found[20, 20] == pytest.approx(0.5)
    assert np.isnan(found[35, 35])
    slope = SimpleNamespace(vertices=np.array([[0, 0, 0.0], [1, 0, 1.0], [0, 1, 0.0]]), faces=np.array([[0, 1, 2]]))
    assert height_map([slope], Volume((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), 0.01)[10, 49] == pytest.approx(0.495)


def test_truth_is_kept(tmp_path: Path) -> None:
    volume, traits = kept_truth(tmp_path, "some", square(0.3, 0.5))
    assert kept_truth(tmp_path, "some") == (volume, traits)
