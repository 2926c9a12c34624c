import numpy as np
import pytest

from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.agreement import align_to_positions, judge


def _known(position, sigma: float = 0.005, rotation=None) -> PosePrior:
    return PosePrior(None if position is None else np.array(position, dtype=float), sigma, rotation, 3.0)


@pytest.mark.parametrize(("shift", "right"), [(0.019, True), (0.021, False)])
def test_a_position_is_right_up_to_four_standard_deviations(shift: float, right: bool) -> None:
    found = judge(Pose(np.eye(3), np.array([shift, 0.0, 0.0])), _known([0, 0, 0]))
    assert found.right is right
    assert found.position_residual_m == pytest.approx(shift)
    assert ("0.021 m" in found.reason) is not right


@pytest.mark.parametrize(("turn_deg", "right"), [(11.0, True), (13.0, False)])
def test_an_orientation_is_right_up_to_four_standard_deviations(turn_deg: float, right: bool) -> None:
    turned = rotation_from_vector(np.radians([turn_deg, 0.0, 0.0]))
    found = judge(Pose(turned, np.zeros(3)), _known([0, 0, 0], rotation=np.eye(3)))
    assert found.right is right
    assert found.angle_residual_deg == pytest.approx(turn_deg)


def test_alignment_finds_the_similarity_in_spite_of_wrong_images() -> None:
    rng = np.random.default_rng(5)
    world = rng.normal(size=(12, 3))
    similarity = Similarity(0.3, rotation_from_vector([0.2, -0.5, 1.0]), np.array([1.0, 2.0, 3.0]))
    inverse = similarity.inverse()
    poses = {str(k): inverse.apply_pose(Pose(np.eye(3), c)) for k, c in enumerate(world)}
    poses["3"] = Pose(np.eye(3), np.array([9.0, 9.0, 9.0]))
    known = {str(k): _known(c) for k, c in enumerate(world)}
    found = align_to_positions(poses, known, seed=0)
    assert found.scale == pytest.approx(0.3, rel=1e-6)
    right = {name for name, pose in poses.items() if judge(found.apply_pose(pose), known[name]).right}
    assert right == set(poses) - {"3"}


@pytest.mark.parametrize("height", [0.0, 0.4])
@pytest.mark.parametrize("turned", [False, True])
def test_positions_in_one_plane_align_wherever_the_plane_lies(height: float, turned: bool) -> None:
    """A rig's circle about the origin of its own frame: COLMAP's solver alone finds nothing at height zero."""
    angles = np.linspace(0.0, 2 * np.pi, 15, endpoint=False)
    ring = np.stack([0.3 * np.cos(angles), 0.3 * np.sin(angles), np.full(15, height)], axis=1)
    world = ring @ rotation_from_vector([0.7, 0.1, -0.4]).T if turned else ring
    similarity = Similarity(2.5, rotation_from_vector([0.2, -0.5, 1.0]), np.array([1.0, 2.0, 3.0]))
    inverse = similarity.inverse()
    poses = {str(k): inverse.apply_pose(Pose(np.eye(3), c)) for k, c in enumerate(world)}
    found = align_to_positions(poses, {str(k): _known(c) for k, c in enumerate(world)}, seed=0)
    assert found.scale == pytest.approx(2.5, rel=1e-6)
    np.testing.assert_allclose(found.apply(inverse.apply(world)), world, atol=1e-9)


def test_positions_on_one_line_do_not_align() -> None:
    poses = {str(k): Pose(np.eye(3), np.array([k, 0.0, 0.0])) for k in range(5)}
    known = {str(k): _known([2.0 * k, 0, 0]) for k in range(5)}
    assert align_to_positions(poses, known, seed=0) is None
