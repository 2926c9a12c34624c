"""The semi-global baseline that benchmarks compare with."""

import numpy as np
import pytest

from benchmarks.sgbm import rectify, sgbm_depth_maps
from tests.reconstruction.dense.planes import VOLUME, Plane, ring, scene_views


@pytest.fixture(scope="module")
def scene():
    return scene_views([Plane(slope_x=0.2)], ring(5))


def test_the_baseline_finds_the_plane(scene):
    views, truth = scene
    for found, depth in zip(sgbm_depth_maps(views, VOLUME), truth, strict=True):
        inner = (slice(40, -40), slice(40, -40))
        error = np.abs(found.depth - depth)[inner] / depth[inner]
        assert np.mean(error < 0.01) > 0.8


def test_a_rectified_pair_shares_its_rows(scene):
    views = scene[0]
    pair = rectify(views[0], views[1], VOLUME)
    point = np.array([0.05, -0.1, 0.01])
    rays = [pair.rotation @ views[0].pose.rotation @ (point - views[i].pose.center) for i in (0, 1)]
    rows = [pair.focal * r[1] / r[2] + c[1] for r, c in zip(rays, (pair.left_center, pair.right_center), strict=True)]
    assert rows[0] == pytest.approx(rows[1])
    assert rays[0][2] == pytest.approx(rays[1][2])
    assert (rays[0] - rays[1])[0] == pytest.approx(pair.baseline)
