"""Two-view geometry of known poses."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.guided import epipolar_distance, fundamental_matrix, relative_pose

A = Intrinsics("PINHOLE", 1600, 1200, (1500.0, 1480.0, 810.0, 590.0))
B = Intrinsics("PINHOLE", 1200, 1600, (900.0, 905.0, 600.0, 800.0))
places = st.tuples(*[st.floats(-3, 3)] * 3).filter(lambda place: np.linalg.norm(place) > 1)


def points(count: int = 20) -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.3, 0.3, (count, 3))


def line_distance(line: np.ndarray, point: np.ndarray) -> float:
    return abs(float(line @ (*point, 1.0))) / float(np.hypot(line[0], line[1]))


@given(places, places)
def test_images_of_a_point_lie_on_each_others_lines(one: tuple, other: tuple) -> None:
    assume(np.linalg.norm(np.subtract(one, other)) > 0.1)
    a, b = Pose.look_at(one, (0, 0, 0)), Pose.look_at(other, (0.1, 0, 0))
    fundamental = fundamental_matrix(a, b, A, B)
    pixels_a, pixels_b = A.project(a.to_camera(points())), B.project(b.to_camera(points()))
    assert epipolar_distance(fundamental, pixels_a, pixels_b) == pytest.approx(0, abs=1e-6)


@given(places, places)
def test_relative_pose_maps_one_camera_into_the_other(one: tuple, other: tuple) -> None:
    a, b = Pose.look_at(one, (0, 0, 0)), Pose.look_at(other, (0.1, 0, 0))
    rotation, translation = relative_pose(a, b)
    assert a.to_camera(points()) @ rotation.T + translation == pytest.approx(b.to_camera(points()), abs=1e-9)


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    a, b = Pose.look_at((1, 0, 0.4), (0, 0, 0)), Pose.look_at((0.6, 0.7, 0.5), (0, 0, 0))
    fundamental = fundamental_matrix(a, b, A, B)
    pixels_a = A.project(a.to_camera(points(60))) + rng.normal(0, 20, (60, 2))
    pixels_b = B.project(b.to_camera(points(60)[:50])) + rng.normal(0, 20, (50, 2))
    return fundamental, pixels_a, pixels_b


def test_the_distance_is_the_larger_of_the_two() -> None:
    fundamental, a, b = scene()
    for one, other in zip(a[:50], b, strict=True):
        forth = line_distance(fundamental @ (*one, 1.0), other)
        back = line_distance(fundamental.T @ (*other, 1.0), one)
        (distance,) = epipolar_distance(fundamental, one[None], other[None])
        assert distance == pytest.approx(max(forth, back))
