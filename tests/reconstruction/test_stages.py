"""What stages keep of single photographs."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import fieldkit.reconstruction.stages as stages
from fieldkit.cache import StageCache
from fieldkit.captures import assess_quality, read_capture

SMALL_PLOT = Path(__file__).parents[1] / "data" / "small_plot"


def test_quality_is_measured_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    capture, cache = read_capture(SMALL_PLOT), StageCache(tmp_path)
    assert stages.load_quality(capture, cache) == assess_quality(capture)
    monkeypatch.setattr(stages, "measure_photo", None)
    assert stages.load_quality(capture, cache) == assess_quality(capture)


def test_a_photograph_with_a_mask_is_measured_anew(tmp_path: Path) -> None:
    folder, cache = tmp_path / "images", StageCache(tmp_path / "cache")
    folder.mkdir()
    rng = np.random.default_rng(0)
    for name in ("a", "b", "c"):
        Image.fromarray(rng.integers(0, 255, (60, 80, 3), np.uint8)).save(folder / f"{name}.jpg")
    without = stages.load_quality(read_capture(folder), cache)
    mask = np.zeros((60, 80), np.uint8)
    mask[10:20, 10:20] = 255
    Image.fromarray(mask).save(folder / "a_mask.png")
    capture = read_capture(folder)
    found = stages.load_quality(capture, cache)
    assert found == assess_quality(capture)
    assert found["a.jpg"] != without["a.jpg"]
    assert found["b.jpg"] == without["b.jpg"]
