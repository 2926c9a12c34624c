from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures.model import Capture
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.geometry.priors import PosePrior, Priors, SourceFrame
from fieldkit.reconstruction.plot_frame import (
    check_upright,
    find_ground,
    known_up,
    plot_from_world,
    volume_of_interest,
)

UP = np.array([0.0, 0.0, 1.0])
CAMERA = Intrinsics.pinhole(800, 600, 700.0)


def _ring(count: int = 12) -> dict[str, Pose]:
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return {
        f"{k}": Pose.look_at([1.5 * np.cos(a), 1.5 * np.sin(a), 1.2], [0.0, 0.0, 0.2]) for k, a in enumerate(angles)
    }


def _soil_and_plant() -> np.ndarray:
    rng = np.random.default_rng(1)
    soil = np.stack([*rng.uniform(-0.4, 0.4, (2, 3000)), rng.normal(0.0, 0.002, 3000)], axis=1)
    plant = np.stack([*rng.normal(0.0, 0.03, (2, 800)), rng.uniform(0.0, 0.4, 800)], axis=1)
    return np.concatenate([soil, plant])


@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0], [0.4, -0.3, 1.0], [3.0, 0.1, 0.0]])
def test_the_ground_becomes_z_0_with_the_cameras_above(turn: list[float]) -> None:
    rotation = rotation_from_vector(turn)
    points = _soil_and_plant() @ rotation.T + [3.0, 1.0, -2.0]
    poses = {n: Pose(p.rotation @ rotation.T, rotation @ p.center + [3.0, 1.0, -2.0]) for n, p in _ring().items()}
    ground = find_ground(points, poses, seed=0)
    assert ground is not None
    motion = plot_from_world(points, poses, ground, georeferenced=False)
    moved = motion.apply(points)
    assert np.abs(np.median(moved[:3000, 2])) < 0.002
    assert all(motion.apply_pose(p).center[2] > 1.0 for p in poses.values())
    assert np.abs(np.median(moved[3000:, :2], axis=0)).max() < 0.05
    assert ground.moved(motion).normal == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


def test_a_georeferenced_slope_stays_a_slope() -> None:
    tilt = rotation_from_vector([0.1, 0.0, 0.0])
    points = _soil_and_plant() @ tilt.T
    ground = find_ground(points, _ring(), seed=0, up=UP)
    assert ground is not None
    motion = plot_from_world(points, _ring(), ground, georeferenced=True)
    assert motion.rotation == pytest.approx(np.eye(3))
    assert ground.moved(motion).tilt_deg() == pytest.approx(np.degrees(0.1), abs=0.3)


def _priors(poses: dict[str, Pose], said: str, sigma_m: float) -> Priors:
    known = {n: PosePrior(p.center if "places" in said else None, sigma_m) for n, p in poses.items()}
    if "angles" in said:
        known = {n: k.with_angles(tuple(map(float, poses[n].yaw_pitch_roll_deg()))) for n, k in known.items()}
    origin = LocalFrame(52.0, 10.0, 80.0, "ellipsoid") if "earth" in said else None
    frame = SourceFrame("poses.csv", origin, Similarity.identity()) if "places" in said else None
    return Priors(frame, known)


@pytest.mark.parametrize(
    ("said", "sigma_m", "known"),
    [
        ("places", 0.05, True),
        ("places", 0.5, False),
        ("places on a line", 0.001, False),
        ("places and angles on a line", 0.001, True),
        ("places on earth", 3.0, True),
        ("angles", 0.05, True),
        ("nothing", 0.05, False),
    ],
)
def test_up_is_what_a_georeference_three_positions_or_angles_say(said: str, sigma_m: float, known: bool) -> None:
    poses = _ring()
    if "line" in said:
        poses = {n: Pose(p.rotation, p.center * [1.0, 0.0, 0.0] + [0.0, 0.0, 1.2]) for n, p in poses.items()}
    priors, metric = _priors(poses, said, sigma_m), "places" in said
    turn = np.eye(3) if metric else rotation_from_vector([1.0, -0.5, 0.3])
    up = known_up({n: Pose(p.rotation @ turn.T, turn @ p.center) for n, p in poses.items()}, priors, metric=metric)
    if known:
        assert up == pytest.approx(turn @ UP, abs=1e-9)
    else:
        assert up is None


def test_the_volume_holds_what_converging_cameras_share_and_not_the_background() -> None:
    rng = np.random.default_rng(2)
    background = rng.normal(size=(2000, 3))
    background = background / np.linalg.norm(background, axis=1, keepdims=True) * 6.0
    points = np.concatenate([_soil_and_plant(), background])
    poses = _ring()
    volume = volume_of_interest(points, poses, dict.fromkeys(poses, CAMERA))
    assert volume.contains(_soil_and_plant()[3000:]).mean() > 0.97
    assert not volume.contains(background).any()


def test_too_few_points_leave_the_volume_to_the_person() -> None:
    poses = _ring()
    with pytest.raises(ReconstructionError) as caught:
        volume_of_interest(np.full((3, 3), 9.0), poses, dict.fromkeys(poses, CAMERA))
    assert "--bounds" in caught.value.remedy


def _capture(pitches: dict[str, float | None]) -> Capture:
    priors = {name: PosePrior().with_angles((None, pitch, None)) for name, pitch in pitches.items()}
    return Capture(Path("plot"), Path("plot"), (), (), (), priors)


def _plane_of_cameras(pitches: list[float]) -> dict[str, Pose]:
    return {f"{k}": Pose.from_yaw_pitch([10.0 * k, 3.0 * (k % 2), 40.0], 30.0, p) for k, p in enumerate(pitches)}


@pytest.mark.parametrize("pitches", [[89.0] * 4, [89.0, -89.0, 88.0, -89.0]])
@pytest.mark.parametrize("recorded", [None, -89.9, 0.0])
def test_a_plane_of_cameras_below_what_it_sees_is_refused(pitches: list[float], recorded: float | None) -> None:
    poses = _plane_of_cameras(pitches)
    with pytest.raises(ReconstructionError, match=r"upside down.*mirrored") as caught:
        check_upright(poses, _capture(dict.fromkeys(poses, recorded)))
    assert "hemisphere" in caught.value.remedy


@pytest.mark.parametrize(
    ("pitches", "recorded"), [([-89.0] * 4, None), ([40.0] * 4, 40.0), ([10.0] * 4, None), ([], None)]
)
def test_cameras_that_look_down_or_are_known_to_look_up_are_not(pitches: list[float], recorded: float | None) -> None:
    poses = _plane_of_cameras(pitches)
    check_upright(poses, _capture(dict.fromkeys(poses, recorded)))
