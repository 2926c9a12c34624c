"""A pattern photographed over a small rendered plot and evaluated as a flight is."""

import pytest

from fieldkit.geometry import Intrinsics
from fieldkit.planning.patterns.block import Block
from fieldkit.planning.patterns.objective import evaluate
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.results.pattern import Look, Pattern
from fieldkit.scenes.plot_description import TrialDescription
from fieldkit.scenes.renderer import Renderer, RenderingError


@pytest.mark.slow
def test_close_passes_measure_a_plot_and_two_photographs_do_not() -> None:
    block = Block.of(TrialDescription(seed=3, ranges=1, columns=1, length_m=1.0, stage="V4"))
    camera, noise = Intrinsics.pinhole(1200, 900, 1000.0), NoiseSettings(pose_m=0.02, pose_deg=1.0)
    looks = Look(0.0, -70.0), Look(180.0, -70.0)
    try:
        with Renderer(block.scene) as renderer:
            close = evaluate(Pattern(looks, 3.0, 0.6, 1.0), block, renderer, camera, noise)
            far = evaluate(Pattern(looks[:1], 3.0, 2.5, 4.0), block, renderer, camera, noise)
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    assert close.right >= 9
    assert close.errors is not None
    assert max(abs(close.errors[f"height_p{share}_m"]) for share in (95, 99)) < 0.05
    assert close.within > 0.5
    assert far.photographs < 9
    assert far.errors is None
    assert far.value_m > close.value_m
