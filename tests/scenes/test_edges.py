"""Edges smoothed after the fact: nearer to four samples per pixel than one is, and nothing else changed."""

import numpy as np
import pytest

from fieldkit.arrays import ByteArray
from fieldkit.geometry import Intrinsics
from fieldkit.scenes.edges import smooth_edges
from fieldkit.scenes.renderer import Renderer
from fieldkit_sim.simulation import ring


def half_plane(slope: float, samples: int) -> ByteArray:
    """(60, 80, 3): bright below a line of that slope, each pixel the mean of its samples² points."""
    y, x = (np.mgrid[: 60 * samples, : 80 * samples] + 0.5) / samples
    covered = (y > 12.3 + slope * x).reshape(60, samples, 80, samples).mean((1, 3))
    return np.repeat(np.rint(40 + 160 * covered)[..., None], 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize("slope", [0.08, 0.55])
@pytest.mark.parametrize("transposed", [False, True])
def test_a_straight_edge_comes_near_its_true_coverage(slope: float, transposed: bool) -> None:
    stairs, truth = half_plane(slope, 1), half_plane(slope, 16)
    if transposed:
        stairs, truth = np.ascontiguousarray(stairs.swapaxes(0, 1)), truth.swapaxes(0, 1)
    smooth = smooth_edges(stairs)
    inner = (slice(3, -3), slice(3, -3))
    before = np.abs(stairs[inner].astype(float) - truth[inner]).sum()
    after = np.abs(smooth[inner].astype(float) - truth[inner]).sum()
    assert after < 0.6 * before


def test_what_has_no_edges_stays_as_it_is() -> None:
    ramp = np.repeat((np.arange(120, dtype=np.uint8) * 2)[None, :, None], 60, axis=0).repeat(3, axis=2)
    np.testing.assert_array_equal(smooth_edges(ramp), ramp)
    dim = np.random.default_rng(3).integers(90, 98, (50, 60, 3)).astype(np.uint8)
    np.testing.assert_array_equal(smooth_edges(dim), dim)


def test_a_rendered_plant_lies_nearer_to_many_samples(renderer: Renderer) -> None:
    camera = Intrinsics.pinhole(400, 300, 340.0)
    pose = ring(1, 1.0, 0.8)[0]
    large = renderer.photograph(pose, camera.scaled(1600, 1200)).astype(np.float64)
    truth = large.reshape(300, 4, 400, 4, 3).mean((1, 3))
    single = renderer.photograph(pose, camera, samples=0)

    def error(image: ByteArray) -> float:
        return float(np.sqrt(((image - truth) ** 2).mean()))

    assert error(smooth_edges(single)) < 0.9 * error(single)
