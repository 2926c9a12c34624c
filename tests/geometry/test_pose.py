"""Poses and the angles drones report."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg, wrapped_deg

coordinates = st.tuples(*[st.floats(-1000, 1000)] * 3)
yaws = st.floats(-180, 180)
pitches = st.floats(-90, 90)
rolls = st.floats(-180, 180)
vectors = st.tuples(*[st.floats(-3, 3)] * 3)


@given(coordinates, yaws, pitches, rolls)
def test_angles_round_trip(center: tuple[float, float, float], yaw: float, pitch: float, roll: float) -> None:
    pose = Pose.from_yaw_pitch(center, yaw, pitch, roll)
    again = Pose.from_yaw_pitch(center, *pose.yaw_pitch_roll_deg())
    # Near straight down yaw and roll cannot be told apart, but the rotation can.
    assert rotation_angle_deg(pose.rotation, again.rotation) < 1e-5


@pytest.mark.parametrize(
    ("yaw", "pitch", "forward"),
    [(0, 0, (0, 1, 0)), (90, 0, (1, 0, 0)), (180, 0, (0, -1, 0)), (0, -90, (0, 0, -1)), (45, 90, (0, 0, 1))],
)
def test_yaw_is_clockwise_from_north_and_pitch_is_elevation(yaw, pitch, forward) -> None:
    np.testing.assert_allclose(Pose.from_yaw_pitch((0, 0, 0), yaw, pitch).forward, forward, atol=1e-12)


def test_positive_roll_lowers_the_right_side() -> None:
    assert Pose.from_yaw_pitch((0, 0, 0), 0, 0, 10).rotation[0][2] < 0


def test_angles_are_those_of_the_north_east_down_rotation_order() -> None:
    """DJI's gimbal angles: intrinsic yaw, pitch, roll about north-east-down axes, camera forward along x."""
    yaw, pitch, roll = 37.0, -52.0, 8.0
    body = Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True).as_matrix()
    ned_to_enu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    forward, right, down = (ned_to_enu @ body).T
    np.testing.assert_allclose(
        Pose.from_yaw_pitch((0, 0, 0), yaw, pitch, roll).rotation, [right, down, forward], atol=1e-12
    )


@given(coordinates, coordinates)
def test_look_at_puts_the_target_on_the_axis(center, target) -> None:
    distance = float(np.linalg.norm(np.subtract(target, center)))
    if distance < 1e-3:
        return
    pose = Pose.look_at(center, target)
    np.testing.assert_allclose(
        pose.to_camera(np.array([target], dtype=float)), [[0, 0, distance]], atol=1e-6 * max(1.0, distance)
    )
    assert pose.rotation[0][2] == pytest.approx(0.0, abs=1e-12)


@given(vectors, vectors)
def test_rotation_angle_agrees_with_scipy(a: tuple[float, float, float], b: tuple[float, float, float]) -> None:
    first, second = Rotation.from_rotvec(a), Rotation.from_rotvec(b)
    expected = np.degrees((first * second.inv()).magnitude())
    assert rotation_angle_deg(first.as_matrix(), second.as_matrix()) == pytest.approx(expected, abs=1e-5)


# Angles on a circle.


@given(st.floats(-1e4, 1e4))
def test_the_same_direction_within_half_a_turn(angle: float) -> None:
    wrapped = wrapped_deg(angle)
    assert -180.0 <= wrapped < 180.0 + 1e-9
    assert abs(np.exp(1j * np.radians(angle)) - np.exp(1j * np.radians(wrapped))) < 1e-9
