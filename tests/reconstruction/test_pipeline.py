"""What a reconstruction refuses before and after its work."""

from pathlib import Path

import pytest

from fieldkit.captures import read_capture
from fieldkit.errors import MetadataError
from fieldkit.reconstruction.pipeline import reconstruct, with_scene
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from tests.evaluation.examples import reconstruction

SMALL_PLOT = Path(__file__).parents[1] / "data" / "small_plot"


def test_masks_that_are_not_there_are_told_before_hours_of_work() -> None:
    with pytest.raises(MetadataError, match="and 7 more") as raised:
        reconstruct(read_capture(SMALL_PLOT), ReconstructionSettings(mask="file"), Context())
    assert "NAME_mask.png" in raised.value.remedy


def test_a_scene_that_is_there_is_not_made_again() -> None:
    found = reconstruction()
    assert found.scene is not None
    assert with_scene(found, ReconstructionSettings(), Context()) is found
