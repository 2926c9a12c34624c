"""The semi-global baseline that benchmarks compare with."""

import numpy as np
import pytest

from benchmarks.sgbm import sgbm_depth_maps
from tests.reconstruction.dense.planes import VOLUME, Plane, ring, scene_views


@pytest.fixture(scope="module")
def scene():
    return scene_views([Plane(slope_x=0.2)], ring(5))


@pytest.mark.slow
def test_the_baseline_finds_the_plane(scene):
    views, truth = scene
    for found, depth in zip(sgbm_depth_maps(views, VOLUME), truth, strict=True):
        inner = (slice(40, -40), slice(40, -40))
        error = np.abs(found.depth - depth)[inner] / depth[inner]
        assert np.mean(error < 0.01) > 0.8
