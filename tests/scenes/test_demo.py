"""The demo's captures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures import read_capture
from fieldkit.clouds import read_cloud
from fieldkit.scenes.demo import DENSE_VIEWS, FEW_VIEWS, demo_scene, write_demo_captures


@pytest.mark.slow
def test_demo_captures_are_complete(tmp_path: Path) -> None:
    captures = write_demo_captures(tmp_path, seed=0)
    for folder, views in ((captures.dense, DENSE_VIEWS), (captures.few, FEW_VIEWS)):
        capture = read_capture(folder)
        assert len(capture.photos) == views
        assert capture.metric_source == "poses.csv"
        assert capture.groups[0].intrinsics == demo_scene().camera
        assert not capture.findings
    reference = read_cloud(captures.truth / "reference.ply")
    assert len(reference) > 100_000
    assert np.abs(reference.points).max() < 1.2
    assert sorted(p.name for p in captures.truth.iterdir()) == ["dense-poses.csv", "few-poses.csv", "reference.ply"]
