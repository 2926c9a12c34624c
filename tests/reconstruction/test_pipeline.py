"""What a reconstruction refuses before and after its work."""

from pathlib import Path

import pytest

from fieldkit.captures import read_capture
from fieldkit.clouds.volume import Volume
from fieldkit.errors import MetadataError, ReconstructionError
from fieldkit.reconstruction.pipeline import reconstruct, with_scene
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from tests.evaluation.examples import reconstruction

SMALL_PLOT = Path(__file__).parents[1] / "data" / "small_plot"


def test_masks_that_are_not_there_are_told_before_hours_of_work() -> None:
    with pytest.raises(MetadataError, match="and 4 more") as raised:
        reconstruct(read_capture(SMALL_PLOT), ReconstructionSettings(mask="file"), Context())
    assert "NAME_mask.png" in raised.value.remedy


def test_photographs_of_another_place_are_told_before_dense_stereo(monkeypatch: pytest.MonkeyPatch) -> None:
    """Georeferenced ones; whatever lies in no two pictures, dense stereo cannot find."""
    monkeypatch.setattr("fieldkit.reconstruction.pipeline.compute_depth_maps", None)
    elsewhere = ReconstructionSettings(bounds=Volume((100.0, 100.0, 0.0), (103.0, 102.0, 2.0)))
    with pytest.raises(ReconstructionError, match=r"look at a place 1[0-9]{2}\.[0-9] m beside the volume"):
        reconstruct(read_capture(SMALL_PLOT), elsewhere, Context())


def test_a_scene_that_is_there_is_not_made_again() -> None:
    found = reconstruction()
    assert found.scene is not None
    assert with_scene(found, ReconstructionSettings(), Context()) is found
