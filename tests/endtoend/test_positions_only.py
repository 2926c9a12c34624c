"""Few photographs of a plant with positions and nothing else: no angles, no calibration."""

import csv
import shutil
from pathlib import Path

import pytest

from benchmarks.rigs import RIG_FILE, read_rig, uniform_subset
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.reconstruction.pipeline import place
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context


@pytest.mark.slow
@pytest.mark.parametrize("phase", range(6))
def test_thirteen_even_views_come_out_right(data_folder: Path, tmp_path: Path, phase: int) -> None:
    """At phase 5 the blind model that calibrates the camera fits four positions, turned by half a circle."""
    rig, folder = data_folder / "basil_rig", tmp_path / "views"
    folder.mkdir()
    with (rig / "images" / "poses.csv").open(newline="") as file:
        rows = {row["image"]: row for row in csv.DictReader(file)}
    chosen = uniform_subset(list(read_rig(rig / RIG_FILE)), 13, phase)
    for name in chosen:
        shutil.copy(rig / "images" / name, folder / name)
    with (folder / "poses.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, ["image", "x_m", "y_m", "z_m", "accuracy_m"], extrasaction="ignore")
        table.writeheader()
        table.writerows(rows[name] for name in chosen)
    sparse, _ = place(read_capture(folder), ReconstructionSettings(), [], Context(StageCache(tmp_path / "c")))
    assert sparse.right == 13
