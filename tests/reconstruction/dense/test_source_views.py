"""Choice of source views, and the rays through the volume."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense import View
from fieldkit.reconstruction.dense.views import SOURCES, active_pixels, choose_sources, depth_range, views_of

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


FIELD_CAMERA = Intrinsics.pinhole(400, 300, 295.0)


def flight(height_m: float = 8.0) -> dict[str, Pose]:
    """Nadir and four oblique directions over a field of 12 × 12 m, by name of direction and place."""
    poses = {}
    for name, yaw, pitch in (("nadir", 0, -90), ("n", 0, -60), ("e", 90, -60), ("s", 180, -60), ("w", 270, -60)):
        back = 0.0 if pitch == -90 else height_m / np.tan(np.radians(60))
        ahead = back * np.array([np.sin(np.radians(yaw)), np.cos(np.radians(yaw))])
        for x in np.arange(-6.0, 6.1, 2.0):
            for y in np.arange(-6.0, 6.1, 2.0):
                center = (x - ahead[0], y - ahead[1], height_m)
                poses[f"{name} {height_m:g} {x:g} {y:g}"] = Pose.from_yaw_pitch(center, yaw, pitch)
    return poses


@pytest.mark.parametrize("place", [(0.0, 0.0), (5.0, -4.0)])
def test_the_views_of_a_plot_show_it_from_all_directions_and_match(place):
    volume = Volume((place[0] - 0.8, place[1] - 2.0, 0.0), (place[0] + 0.8, place[1] + 2.0, 1.8))
    poses = flight()
    chosen = views_of(poses, dict.fromkeys(poses, FIELD_CAMERA), volume, 12)
    assert len(set(chosen)) == 12
    assert chosen[:6] == views_of(poses, dict.fromkeys(poses, FIELD_CAMERA), volume, 6)
    assert all(FIELD_CAMERA.sees(poses[name].to_camera(volume.corners())).mean() >= 0.75 for name in chosen)
    offsets = np.array([poses[name].center[:2] - place for name in chosen])
    assert (offsets.max(axis=0) > 2.0).all()
    assert (offsets.min(axis=0) < -2.0).all()
    image = np.zeros((300, 400, 3), dtype=np.uint8)
    views = [View(name, image, FIELD_CAMERA, poses[name]) for name in chosen]
    assert min(len(sources) for sources in choose_sources(views, volume)) == SOURCES


def test_the_views_of_a_plot_are_near_and_none_looks_elsewhere():
    volume = Volume((-0.8, -2.0, 0.0), (0.8, 2.0, 1.8))
    far, away = flight(16.0), Pose.from_yaw_pitch((40.0, 0.0, 8.0), 0.0, -90.0)
    poses = {"away": away} | far | flight()
    intrinsics = dict.fromkeys(poses, FIELD_CAMERA)
    assert not set(views_of(poses, intrinsics, volume, 12)) & set(far)
    assert set(views_of(poses, intrinsics, volume, 1000)) < set(poses) - {"away"}
    assert views_of({"away": away}, intrinsics, volume, 12) == ()
