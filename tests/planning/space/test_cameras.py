"""Sets of cameras: the vector z, poses and aiming."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.planning.space.cameras import Cameras

lengths = st.floats(-50, 50, allow_nan=False)
cameras_z = (
    st.integers(1, 6)
    .flatmap(
        lambda n: st.lists(
            st.tuples(lengths, lengths, lengths, st.floats(-720, 720), st.floats(-89.5, 89.5)), min_size=n, max_size=n
        )
    )
    .map(lambda rows: np.array(rows).reshape(-1))
)


@given(cameras_z)
def test_vectors_round_trip_bit_for_bit(z: np.ndarray) -> None:
    cameras = Cameras.from_vector(z)
    again = Cameras.from_vector(cameras.vector())
    assert again == cameras
    assert again.vector().tobytes() == cameras.vector().tobytes()
    assert ((cameras.yaw_deg >= -180) & (cameras.yaw_deg < 180)).all()
    turns = (cameras.yaw_deg - z.reshape(-1, 5)[:, 3]) / 360
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)


@given(cameras_z)
def test_poses_round_trip(z: np.ndarray) -> None:
    cameras = Cameras.from_vector(z)
    poses = cameras.poses()
    again = Cameras.from_poses(poses)
    np.testing.assert_allclose(again.positions, cameras.positions)
    np.testing.assert_allclose([pose.forward for pose in poses], cameras.forward, atol=1e-12)
    for pose, other in zip(poses, again.poses(), strict=True):
        assert rotation_angle_deg(pose.rotation, other.rotation) < 1e-5
        assert abs(pose.yaw_pitch_roll_deg()[2]) < 1e-6


@given(cameras_z, st.tuples(lengths, lengths, lengths))
def test_aimed_cameras_look_at_their_target(z: np.ndarray, target: tuple[float, float, float]) -> None:
    positions = Cameras.from_vector(z).positions
    aimed = Cameras.aimed(positions, target)
    way = np.array(target) - positions
    far = np.linalg.norm(way, axis=1) > 1e-3
    off = np.cross(aimed.forward, way)[far]
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), 0.0, atol=1e-9)
    assert ((aimed.forward * way).sum(axis=1)[far] > 0).all()


@pytest.mark.parametrize("z", [[0.0] * 4, [0, 0, 0, 0, 91.0], [np.nan, 0, 0, 0, 0], [0, 0, 0, np.inf, 0]])
def test_nonsense_is_refused(z: list[float]) -> None:
    with pytest.raises(ValueError):
        Cameras.from_vector(z)
