"""Depth maps of scenes whose depths are known exactly."""

import numpy as np
import pytest

from fieldkit.cache import StageCache
from fieldkit.reconstruction.dense import DepthMap, View, compute_depth_maps, fuse
from fieldkit.reconstruction.dense import depth_maps as module
from fieldkit.reconstruction.dense.matching import UNMATCHED
from fieldkit.runtime.context import Context
from tests.reconstruction.dense.planes import VOLUME, Plane, ring, scene_views

NOTHING_KEPT = StageCache(None)


def depth_maps(views: list[View], seed: int = 0) -> list[DepthMap]:
    return compute_depth_maps(views, VOLUME, seed=seed, context=Context(NOTHING_KEPT))


def relative_errors(found: DepthMap, truth: np.ndarray, margin: int = 12) -> np.ndarray:
    """|error| / depth of the pixels away from the image's border; those without a depth count as infinite."""
    inner = (slice(margin, -margin), slice(margin, -margin))
    error = np.where(found.depth > 0, np.abs(found.depth - truth) / truth, np.inf)
    return np.asarray(error[inner])


@pytest.fixture(scope="module")
def slanted() -> tuple[list[View], list[np.ndarray], list[DepthMap]]:
    views, truth = scene_views([Plane(slope_x=0.3, slope_y=-0.2)], ring(5))
    return views, truth, depth_maps(views)


def test_a_slanted_plane_is_found_to_a_fraction_of_a_pixel(slanted):
    _, truth, found = slanted
    errors = np.concatenate([relative_errors(f, t, 45).ravel() for f, t in zip(found, truth, strict=True)])
    # One pixel of disparity is about 1 % of the depth between neighbouring views of this ring.
    assert np.median(errors) < 0.0006
    assert np.mean(errors < 0.002) > 0.99


def test_normals_are_those_of_the_plane_and_face_the_camera(slanted):
    views, _, found = slanted
    normal = np.array([-0.3, 0.2, 1.0])
    normal /= np.linalg.norm(normal)
    for view, depth_map in zip(views, found, strict=True):
        has = depth_map.depth > 0
        assert np.allclose(np.linalg.norm(depth_map.normal[has], axis=1), 1.0, atol=1e-5)
        assert not depth_map.normal[~has].any()
        angles = np.degrees(np.arccos(np.clip(depth_map.normal[has] @ normal, -1, 1)))
        assert np.median(angles) < 6.0
        camera = view.intrinsics
        rows, columns = np.nonzero(has)
        rays = np.stack([(columns + 0.5 - camera.cx) / camera.fx, (rows + 0.5 - camera.cy) / camera.fy], axis=1)
        world = np.concatenate([rays, np.ones((len(rays), 1))], axis=1) @ view.pose.rotation
        assert ((depth_map.normal[has] * world).sum(axis=1) < 0).all()


def test_depths_on_both_sides_of_an_occluding_edge():
    front = Plane(height=0.25, half=0.15, seed=3, tint=(0.5, 1.0, 0.4))
    views, truth = scene_views([Plane(), front], ring(6))
    for depth_map, depth in zip(depth_maps(views), truth, strict=True):
        errors = relative_errors(depth_map, depth)
        near_front = depth[12:-12, 12:-12] < depth[12:-12, 12:-12].max() * 0.85
        assert np.mean(errors[near_front] < 0.01) > 0.9
        assert np.mean(errors < 0.01) > 0.88


def test_what_lies_behind_the_volume_is_left_out():
    views, _ = scene_views([Plane(height=-0.8, half=3.0)], ring(5))
    found = depth_maps(views)
    assert np.mean([(f.depth > 0).mean() for f in found]) < 0.2
    assert len(fuse(views, found, VOLUME)[0]) < 500


def test_what_lies_behind_the_volume_is_matched_on_the_coarsest_level_only(monkeypatch):
    monkeypatch.setattr(module, "COARSEST", 12_000)
    front = Plane(height=0.25, half=0.15, seed=3, tint=(0.5, 1.0, 0.4))
    views, truth = scene_views([Plane(height=-0.8, half=3.0), front], ring(6))
    matched, to_depth_map = [], module.to_depth_map

    def spy(view, active, planes, memory):
        behind = planes.planes[:, 0] == 0.0
        assert not active.inside(planes.planes[:, 0])[behind].any()
        assert (planes.costs[behind] == UNMATCHED).all()
        matched.append(1.0 - behind.mean())
        return to_depth_map(view, active, planes, memory)

    monkeypatch.setattr(module, "to_depth_map", spy)
    shares = []
    for depth_map, depth in zip(depth_maps(views), truth, strict=True):
        near = depth < 1.3
        shares.append(near.mean())
        found = depth_map.depth[near]
        assert np.mean(np.abs(found - depth[near]) < 0.01 * depth[near]) > 0.9
    assert np.mean(shares) < np.mean(matched) < 0.5


def test_a_view_without_neighbours_has_no_depths():
    views, _ = scene_views([Plane()], ring(4))
    for depth_map in depth_maps(views[:1]):
        assert not depth_map.depth.any()


@pytest.mark.parametrize("coarsest", [10_000_000, 5_000])
def test_every_number_of_pyramid_levels_finds_the_plane(coarsest, monkeypatch):
    monkeypatch.setattr(module, "COARSEST", coarsest)
    views, truth = scene_views([Plane(slope_x=-0.25)], ring(4))
    found = depth_maps(views)
    errors = np.concatenate([relative_errors(f, t).ravel() for f, t in zip(found, truth, strict=True)])
    assert np.mean(errors < 0.005) > 0.95
