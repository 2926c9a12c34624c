"""The picture of a flight."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from fieldkit.clouds.cloud import Cloud
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.pictures.mission import draw_mission, frustum

CAMERA = Intrinsics.pinhole(4000, 3000, 3500.0)
HOME = np.zeros(2)


def _lines(axes: Axes) -> list[list[Any]]:
    """Of legs, then of cameras."""
    return [drawn.get_segments() for drawn in axes.collections if isinstance(drawn, LineCollection)]


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
    figure = draw_mission(
        "a flight",
        legs,
        poses,
        CAMERA,
        plants,
        [fence],
        near=4,
        near_plants=plants,
        stations=list("1234567"),
        plots=["A"] * 7,
        home=HOME,
    )
    above, close, front = figure.axes
    for axes in (close, front):
        assert {text.get_text() for text in axes.texts} >= {str(k) for k in range(1, 5)}
    # Legs, and a dot and lines a camera; from the front what is of the first plot.
    for axes, flown, taken in ((above, 6, 7), (close, 6, 7), (front, 5, 4)):
        assert [len(some) for some in _lines(axes)] == [flown, taken]
        assert len(axes.lines[-1].get_xdata()) == taken
    left, right = above.get_xlim()
    assert left < min(p.center[0] for p in poses) < max(p.center[0] for p in poses) < right
    assert np.ptp(close.get_xlim()) < np.ptp(above.get_xlim())
    for axes in (above, close, front):
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        box = axes.get_position()
        width, height = figure.get_size_inches()
        assert (right - left) / (box.width * width) == pytest.approx((top - bottom) / (box.height * height))


def test_home_north_names_of_plots_and_the_plans_own_numbers() -> None:
    """Numbers are those that are given, not the order of flight; a plot's name stands once, at its middle."""
    ring = [Pose.look_at((1.3 * np.cos(a), 1.3 * np.sin(a), 1.2), (0, 0, 0)) for a in np.linspace(0, 5, 4)]
    poses = ring + [Pose(pose.rotation, pose.center + np.array([6.0, 0.0, 0.0])) for pose in ring]
    legs = [np.array([a.center, b.center]) for a, b in pairwise(poses)]
    figure = draw_mission(
        "two",
        legs,
        poses,
        CAMERA,
        Cloud(np.zeros((0, 3))),
        [],
        near=4,
        near_plants=Cloud(np.zeros((0, 3))),
        stations=list("31427856"),
        plots=["A01"] * 4 + ["$b$"] * 4,
        home=np.array([0.0, -3.0]),
    )
    above, close, front = ([text.get_text() for text in axes.texts] for axes in figure.axes)
    assert {"N", "home", "A01", "$b$"} <= set(above)
    assert above.count("A01") == 1
    assert {"N", "3", "1", "4", "2"} <= set(close)
    assert {"N", "home", "A01"}.isdisjoint(front)
    assert [axes.get_title(loc="left") for axes in figure.axes[1:]] == ["A01 from above", "A01 from the front"]
