"""`standard` on a simulated plot with known truth and known poses: the test scenes, on which nothing was tuned."""

import numpy as np
import pytest

from benchmarks.scenes import benchmark_cameras, benchmark_scene
from benchmarks.sgbm import sgbm_depth_maps
from fieldkit.clouds.metrics import score
from fieldkit.clouds.volume import Volume
from fieldkit.reconstruction.dense import compute_depth_maps, fuse, prepare_view, resolution
from fieldkit.runtime.context import Context
from fieldkit.scenes.renderer import Renderer, RenderingError
from fieldkit.scenes.sampling import sample_visible
from fieldkit_sim.plot import build_scene

# The soil is bumpy: what lies lower is not counted on either side.
LOWEST_M = 0.03


@pytest.mark.slow
@pytest.mark.parametrize("index", [0, 1])
def test_ten_views_of_a_plot(index):
    scene = build_scene(benchmark_scene("test", index))
    poses, intrinsics = benchmark_cameras(10)
    rng = np.random.default_rng(0)
    truth = sample_visible(scene, (200_000,))[0]
    truth = truth.select(truth.points[:, 2] > LOWEST_M)
    around = Volume.around(truth.points, margin_m=0.03)
    volume = Volume((*around.lower[:2], LOWEST_M), around.upper)
    views = []
    try:
        with Renderer(scene) as renderer:
            for i, pose in enumerate(poses):
                clean = renderer.photograph(pose, intrinsics)
                noisy = np.clip(clean + rng.normal(0, 2, clean.shape), 0, 255).astype(np.uint8)
                size = resolution((2000, 1500), intrinsics, pose, volume, "standard").size
                views.append(prepare_view(f"{i:02d}", noisy, intrinsics, pose, size))
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    found = compute_depth_maps(views, volume, seed=0, context=Context())
    ours = score(truth, fuse(views, found, volume)[0], [0.010]).f_scores[0.010]
    theirs, _ = fuse(views, sgbm_depth_maps(views, volume), volume)
    baseline = score(truth, theirs, [0.010]).f_scores[0.010]
    assert ours.f_score >= 0.95
    assert ours.precision >= 0.97
    assert ours.f_score > baseline.f_score
