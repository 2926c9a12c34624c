"""Choice of source views, and the rays through the volume."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense import View
from fieldkit.reconstruction.dense.views import active_pixels, choose_sources, depth_range

VOLUME = Volume((-0.2, -0.2, 0.0), (0.2, 0.2, 0.4))
CAMERA = Intrinsics.pinhole(60, 45, 60.0)


def circle(degrees: list[float], radius: float = 2.0) -> list[View]:
    """Views on a level circle about the volume."""
    image = np.zeros((45, 60, 3), dtype=np.uint8)
    views = []
    for i, angle in enumerate(np.radians(degrees)):
        pose = Pose.look_at([radius * np.cos(angle), radius * np.sin(angle), 0.2], [0, 0, 0.2])
        views.append(View(str(i), image, CAMERA, pose))
    return views


def test_views_about_twelve_degrees_away_are_best():
    views = circle([0, 1, 6, 12, 20, 45, 60, 180])
    assert choose_sources(views, VOLUME)[0] == (3, 4, 2, 5)


def test_a_full_circle_has_sources_on_both_sides():
    views = circle(list(range(0, 360, 9)))
    for i, chosen in enumerate(choose_sources(views, VOLUME)):
        steps = sorted((j - i + 20) % 40 - 20 for j in chosen)
        assert steps == [-2, -1, 1, 2]


@given(
    st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    st.floats(-180, 180),
    st.floats(-89, 89),
    st.integers(0, 59),
    st.integers(0, 44),
)
def test_the_depth_range_is_where_the_ray_is_inside(center, yaw, pitch, column, row):
    pose = Pose.from_yaw_pitch(center, yaw, pitch)
    near, far = depth_range(CAMERA, pose, VOLUME)
    ray = np.array([(column + 0.5 - CAMERA.cx) / CAMERA.fx, (row + 0.5 - CAMERA.cy) / CAMERA.fy, 1.0]) @ pose.rotation
    depths = np.linspace(0.001, 6.0, 2000)
    inside = VOLUME.contains(pose.center + depths[:, None] * ray)
    claimed = (depths >= near[row, column]) & (depths <= far[row, column])
    if VOLUME.contains(pose.center[None])[0]:
        assert (claimed <= inside).all()
    else:
        edge = np.minimum(np.abs(depths - near[row, column]), np.abs(depths - far[row, column])) < 0.01
        skipped = depths < 0.05 * far[row, column]
        assert ((claimed == inside) | edge | skipped).all()


def test_active_pixels_are_those_on_the_mask_that_meet_the_volume():
    view = circle([0])[0]
    mask = np.zeros((45, 60), dtype=bool)
    mask[:, 30:] = True
    near, far = depth_range(CAMERA, view.pose, VOLUME)
    active = active_pixels(replace(view, mask=mask), VOLUME, 0.5)
    expected = mask & (far > near)
    assert np.array_equal(active.place >= 0, expected)
    assert np.array_equal(active.pixels, np.argwhere(expected))
    assert active.ranges[:, 0] == pytest.approx(1 / (1.5 * far[expected]))
    assert active.ranges[:, 1] == pytest.approx(1 / near[expected])
    assert active.inside(1 / far[expected].astype(np.float32) * np.float32(1.001)).all()
    assert not active.inside(1 / far[expected].astype(np.float32) * np.float32(0.999)).any()
