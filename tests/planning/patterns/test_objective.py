"""A pattern photographed, mapped and reconstructed over two small plants."""

import pytest

from fieldkit.clouds.canopy import inside_outline, rectangle
from fieldkit.geometry import Intrinsics
from fieldkit.planning.patterns.block import Block
from fieldkit.planning.patterns.objective import evaluate
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.planning.space.plots import above_soil
from fieldkit.results.pattern import Look, Pattern
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.renderer import RenderingError
from fieldkit.scenes.sampling import sample_visible
from tests.scenes.conftest import made_scene


def test_close_passes_reconstruct_the_plants_and_their_traits() -> None:
    scene = made_scene()
    reference, volume = above_soil(sample_visible(scene, (20_000,), 0)[0])
    outline = rectangle(volume.lower[:2], volume.upper[:2])
    reference = reference.select(inside_outline(reference.points, outline))
    block = Block(SceneDescription(), scene, outline, reference, reference.points, reference.points[:3][None])
    pattern = Pattern((Look(0.0, -70.0), Look(180.0, -70.0)), 1.5, 0.25, 0.5)
    try:
        made = evaluate(pattern, block, Intrinsics.pinhole(480, 360, 420.0), NoiseSettings(pose_m=0.002), 0, (0.0, 0.0))
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    assert made.failure == ""
    assert 6 <= made.right <= made.photographs <= 20
    assert made.value_m < 0.05
    assert made.errors is not None
    assert made.errors.height_m < 0.1
