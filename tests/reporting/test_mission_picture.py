"""The picture of a flight."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fieldkit.clouds.cloud import Cloud
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reporting.mission_picture import draw_mission, frustum

CAMERA = Intrinsics.pinhole(4000, 3000, 3500.0)


def test_a_frustum_shows_what_the_camera_sees() -> None:
    pose = Pose.from_yaw_pitch((1.0, 2.0, 3.0), 40.0, -30.0)
    corners = frustum(pose, CAMERA, 2.0)
    np.testing.assert_allclose(corners[0], pose.center)
    seen = CAMERA.project(pose.to_camera(corners[1:]))
    np.testing.assert_allclose(seen, [[0, 0], [4000, 0], [4000, 3000], [0, 3000]], atol=1e-6)
    np.testing.assert_allclose(pose.to_camera(corners[1:])[:, 2], 2.0)


@pytest.mark.parametrize("plants", [Cloud(np.zeros((0, 3))), Cloud(np.random.default_rng(0).random((500, 3)))])
def test_legs_and_cameras_are_drawn_in_all_views(plants: Cloud) -> None:
    poses = [Pose.look_at((3.0 * np.cos(a), 3.0 * np.sin(a), 1.5), (0, 0, 0)) for a in np.linspace(0, 5, 7)]
    up = np.array([0.0, 0.0, 2.0])
    legs = [np.array([a.center, a.center + up, b.center]) for a, b in pairwise(poses)]
    fence = np.array([[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]])
    figure = draw_mission("a flight", legs, poses, CAMERA, plants, [fence], near=4)
    above, close, front = figure.axes
    for axes in (close, front):
        assert {text.get_text() for text in axes.texts} >= {str(k) for k in range(1, 5)}
    assert len(above.lines) == len(close.lines) == len(front.lines) + 1  # the fence
    left, right = above.get_xlim()
    assert left < min(p.center[0] for p in poses) < max(p.center[0] for p in poses) < right
    assert np.ptp(close.get_xlim()) < np.ptp(above.get_xlim())
    for axes in (above, close, front):
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        box = axes.get_position()
        width, height = figure.get_size_inches()
        assert (right - left) / (box.width * width) == pytest.approx((top - bottom) / (box.height * height))
