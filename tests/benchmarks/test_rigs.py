"""Commanded poses of a rig, completed; subsets; noise."""

import numpy as np
import pytest

from benchmarks.rigs import complete_poses, perturb, uniform_subset
from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg, rotation_from_vector


def rig(count: int = 24) -> tuple[dict[str, tuple[np.ndarray, float]], dict[str, Pose]]:
    """A circle about (0.4, 0.4), with a camera mounted askew on a tilted axis."""
    mount = rotation_from_vector(np.array([1.2, -0.4, 0.7]))
    tilt = rotation_from_vector(np.array([0.05, -0.03, 0.0]))
    commanded, true = {}, {}
    for i in range(count):
        pan = 360.0 * i / count
        turn = rotation_from_vector(np.array([0.0, 0.0, np.radians(pan)]))
        center = np.array([0.4 - 0.3 * np.cos(np.radians(pan)), 0.4 - 0.3 * np.sin(np.radians(pan)), 0.1])
        commanded[f"{i:02d}.jpg"] = (center, pan)
        true[f"{i:02d}.jpg"] = Pose(mount @ turn.T @ tilt, center)
    return commanded, true


def test_mount_and_tilt_are_found() -> None:
    commanded, true = rig()
    found = complete_poses(commanded, true)
    assert max(rotation_angle_deg(found[n].rotation, true[n].rotation) for n in true) < 0.01


def test_subsets_are_even_and_move_with_the_phase() -> None:
    names = [str(i) for i in range(79)]
    for count in (10, 13, 16, 20):
        chosen = uniform_subset(names, count)
        assert len(set(chosen)) == count
        gaps = np.diff([int(n) for n in chosen])
        assert gaps.min() >= 79 // count
        assert gaps.max() <= -(-79 // count)
        shifted = uniform_subset(names, count, 1)
        assert [(int(a) + 1) % 79 for a in chosen] == [int(b) for b in shifted]


def test_noise_has_its_size_and_scales() -> None:
    _, poses = rig(400)
    noisy, twice = perturb(poses, 0.01, 1.0, 3), perturb(poses, 0.02, 2.0, 3)
    shift = np.array([noisy[n].center - poses[n].center for n in poses])
    assert shift.std(axis=0) == pytest.approx([0.01] * 3, rel=0.15)
    np.testing.assert_allclose([twice[n].center - poses[n].center for n in poses], 2 * shift, atol=1e-12)
    angles = [rotation_angle_deg(noisy[n].rotation, poses[n].rotation) for n in poses]
    assert np.sqrt(np.mean(np.square(angles)) / 3) == pytest.approx(1.0, rel=0.1)
    same = perturb(poses, 0.0, 0.0, 3)
    assert all(np.allclose(same[n].rotation, poses[n].rotation, atol=1e-12) for n in poses)
    assert not np.allclose(perturb(poses, 0.01, 1.0, 4)["00.jpg"].center, noisy["00.jpg"].center)
