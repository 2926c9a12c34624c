"""Rows of leaves that look alike, as in a closed canopy, of which masks tell nothing."""

from dataclasses import replace

import numpy as np

from fieldkit.clouds.neighbors import PointIndex
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Pose
from fieldkit.reconstruction.dense import compute_depth_maps, fuse
from fieldkit.runtime.context import Context
from tests.reconstruction.dense.planes import Plane, scene_views

VOLUME = Volume((-0.5, -0.4, -0.05), (0.5, 0.4, 0.6))


def rows() -> list[Plane]:
    """Soil and three rows of leaves with one texture, tilted and at different heights."""
    rng = np.random.default_rng(0)
    leaves = [
        Plane(rng.uniform(0.1, 0.3), *rng.uniform(-1.0, 1.0, 2), 0.03, 1, (0.4, 1.0, 0.3), (x, y))
        for x in (-0.3, 0.0, 0.3)
        for y in np.arange(-0.4, 0.41, 0.05)
    ]
    return [Plane(tint=(0.6, 1.0, 0.5)), *leaves]


def surface(planes: list[Plane]) -> np.ndarray:
    """(n, 3) points 5 mm apart."""
    points = []
    for plane in planes:
        steps = np.arange(-min(plane.half, 0.6), min(plane.half, 0.6), 0.005)
        x, y = (axis.ravel() for axis in np.meshgrid(steps, steps))
        z = plane.height + plane.slope_x * x + plane.slope_y * y
        points.append(np.stack([x + plane.center[0], y + plane.center[1], z], axis=1))
    return np.concatenate(points)


def test_nothing_floats_above_rows_of_leaves_that_look_alike():
    planes = rows()
    poses = [Pose.look_at([x, y, 1.3], [0.5 * x, 0.5 * y, 0.1]) for x in (-0.3, 0.0, 0.3) for y in (-0.3, 0.0, 0.3)]
    views = [replace(view, mask=np.ones((180, 240), np.bool_)) for view in scene_views(planes, poses)[0]]
    cloud, _ = fuse(views, compute_depth_maps(views, VOLUME, Context(), seed=0), VOLUME)
    found, leaves = PointIndex(cloud.points), surface(planes[1:])
    distance = PointIndex(surface(planes)).nearest(cloud.points)[0]
    assert (distance > 0.05).mean() < 0.002
    assert (found.nearest(leaves)[0] < 0.015).mean() > 0.9
