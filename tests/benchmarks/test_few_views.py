"""How poses of a subset are judged and tabled; mapping itself is tested elsewhere."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.few_views import GOAL, GRID, MAIN, Outcome, Plan, assess
from benchmarks.rigs import RigSet
from fieldkit.captures.model import Capture
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit_sim.simulation import ring


@pytest.fixture
def rig() -> RigSet:
    poses = {f"{i:02d}.jpg": pose for i, pose in enumerate(ring(12, 0.3, 0.1))}
    capture = Capture(Path("x"), Path("x"), (), (), (), {})
    camera = Intrinsics.pinhole(400, 300, 300.0)
    return RigSet("ring", capture, tuple(poses), poses, poses, camera, 0.005, 0.0, 0.0)


UP = np.array([0.0, 0.0, 1.0])
ELSEWHERE = Similarity(3.0, rotation_from_vector(np.array([0.3, 1.0, -0.5])), np.array([5.0, -2.0, 1.0]))


def moved(poses: dict[str, Pose]) -> dict[str, Pose]:
    return {name: ELSEWHERE.apply_pose(pose) for name, pose in poses.items()}


def test_the_right_poses_in_another_frame_are_right(rig: RigSet) -> None:
    found = assess(moved(rig.dense), rig)
    assert (found.registered, found.right, found.wrong) == (12, 12, 0)
    assert found.rig_max_m == pytest.approx(0.0, abs=1e-9)
    assert found.dense_rms_m == pytest.approx(0.0, abs=1e-9)
    assert found.angle_max_deg == pytest.approx(0.0, abs=1e-5)


def test_a_displaced_pose_is_wrong_and_shows_in_the_errors(rig: RigSet) -> None:
    bad = dict(rig.dense)
    bad["03.jpg"] = replace(bad["03.jpg"], center=bad["03.jpg"].center + UP * 0.05)
    found = assess(moved(bad), rig)
    assert (found.registered, found.right, found.wrong) == (12, 11, 1)
    assert 0.03 < found.rig_max_m < 0.05  # the least-squares similarity takes a part of it
    assert found.rig_rms_m == pytest.approx(found.dense_rms_m)


def test_two_poses_cannot_be_checked(rig: RigSet) -> None:
    two = dict(list(rig.dense.items())[:2])
    assert assess(two, rig) == Outcome(2, 0, None, None, None, None, None)
    assert assess({}, rig) == Outcome(0, 0, None, None, None, None, None)


def test_a_rig_at_height_zero_is_judged(rig: RigSet) -> None:
    flat = {n: Pose(p.rotation, p.center * (1.0, 1.0, 0.0)) for n, p in rig.nominal.items()}
    assert assess(moved(rig.dense), replace(rig, nominal=flat)).right == 12


def test_the_plan_tries_everything_where_a_goal_is_set() -> None:
    assert len(set(GRID)) == 12
    assert {GOAL} < set(MAIN) < set(GRID)
    plan = Plan({"r": (10, 20)}, {"r": (10,)})
    assert (plan.noises("r", 10, 0), plan.noises("r", 10, 1)) == (GRID, MAIN)
    assert (plan.noises("r", 20, 0), plan.noises("r", 20, 1)) == (MAIN, (GOAL,))
    assert replace(plan, whole_grid=True).noises("r", 20, 1) == GRID
