"""True figures of plants' meshes, and the table of errors."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.plant_figures import GOOD_M, error_table
from benchmarks.true_plants import kept_truth, true_figures
from fieldkit.clouds import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.scenes.scene import Mesh


def square(size: float, z: float) -> Any:
    """A level leaf, as a scene with its truth."""
    corners = np.array([[0, 0, z], [size, 0, z], [size, size, z], [0, size, z]], dtype=np.float32)
    leaf = Mesh("plant-1", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), plant=True)
    soil = Mesh("soil", 10 * corners, np.array([[0, 1, 2]], dtype=np.int32))
    cloud = Cloud(np.random.default_rng(0).uniform((0, 0, z), (size, size, z), (2000, 3)))
    volume = Volume((-0.5, -0.5, 0.03), (1.0, 1.0, 1.0))
    return SimpleNamespace(scene=SimpleNamespace(meshes=(leaf, soil)), reference=cloud, volume=volume)


def test_of_a_leaf() -> None:
    found = true_figures(square(0.3, 0.5))
    assert found.covered_m2 == pytest.approx(0.09, rel=0.02)
    assert found.height_m == pytest.approx(0.5)
    assert found.height_max_m == 0.5
    assert found.hull_m3 == 0.0


def test_only_what_lies_within_the_volume_is_covered() -> None:
    assert true_figures(square(1.5, 0.5)).covered_m2 == pytest.approx(1.0, rel=0.01)


def test_truth_is_kept(tmp_path: Path) -> None:
    volume, figures = kept_truth(tmp_path, "some", square(0.3, 0.5))
    assert kept_truth(tmp_path, "some") == (volume, figures)


def test_errors() -> None:
    truth = {"height_m": 0.8, "height_max_m": 1.0, "covered_m2": 0.2, "hull_m3": 0.5}
    good = {"chamfer_m": GOOD_M, "truth": truth, "found": {k: 1.1 * v for k, v in truth.items()}}
    bad = {"chamfer_m": 2 * GOOD_M, "truth": truth, "found": {k: 0.5 * v for k, v in truth.items()}}
    rows = {(row[0], row[2]): row[3:] for row in error_table([good, bad]).rows}
    assert rows["good", "hull"] == ("+10 %", "10 %", "10 %")
    assert rows["good", "highest point"] == ("+100 mm", "100 mm", "100 mm")
    assert rows["all", "covered ground"][0] == "-20 %"
