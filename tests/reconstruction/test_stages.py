"""What stages keep of single photographs."""

from pathlib import Path

import numpy as np
import pytest

import fieldkit.reconstruction.stages as stages
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.runtime.context import Context

SMALL_PLOT = Path(__file__).parents[1] / "data" / "small_plot"


def test_quality_is_measured_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    photos, context = read_capture(SMALL_PLOT).photos, Context(StageCache(tmp_path))
    first = stages.load_pictures(photos, context)
    monkeypatch.setattr(stages, "measure_photo", None)
    again = stages.load_pictures(photos, context)
    for name, picture in first.items():
        np.testing.assert_array_equal(picture.widths, again[name].widths)
        assert (picture.light, picture.readable) == (again[name].light, again[name].readable)
