"""The recorded rigs: commanded poses, dense poses, subsets and noise.

A rig's file gives positions and the pan axis's angle, but not the camera's mount on that axis. The constant mount and
the axis's tilt come from the model of all photographs and complete the commanded poses.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.captures.model import Capture
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import rotation_angle_deg, rotation_from_vector
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.pipeline import place
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stages import StageTimer
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress

RIG_FILE = "poses_rig.csv"
_ROUNDS = 50


@dataclass(frozen=True, eq=False)
class RigSet:
    """A recorded rig."""

    name: str
    """Of the set."""
    capture: Capture
    """All photographs."""
    names: tuple[str, ...]
    """Of the photographs in the model of all, in the circle's order."""
    nominal: dict[str, Pose]
    """Commanded poses in the rig's frame, metres."""
    dense: dict[str, Pose]
    """Poses of the model of all photographs, by Sim3 in the rig's frame."""
    intrinsics: Intrinsics
    """Calibrated by that model."""
    accuracy_m: float
    """Of the commanded positions, standard deviation per axis as the set's poses.csv states it."""
    rms_m: float
    """Of the dense centres against the commanded ones."""
    angle_rms_deg: float
    """Of the dense rotations against the commanded ones."""


def load_rig(data: Path, name: str, *, cache: StageCache, progress: Progress, workers: int = 1) -> RigSet:
    """A rig of the recorded sets with the model of all its photographs (through the cache)."""
    capture = read_capture(data / name / "images")
    commanded = read_rig(data / name / RIG_FILE)
    sparse, _ = place(capture, ReconstructionSettings(), [], Context(cache, StageTimer(progress), workers))
    names = tuple(n for n in commanded if n in sparse.poses)
    source = np.array([sparse.poses[n].center for n in names])
    centers = np.array([commanded[n][0] for n in names])
    to_rig = fit_similarity(source, centers)
    dense = {n: to_rig.apply_pose(sparse.poses[n]) for n in names}
    nominal = complete_poses({n: commanded[n] for n in names}, dense)
    sigmas = [p.position_sigma_m for n in names if (p := capture.priors.get(n)) and p.position is not None]
    turned = [rotation_angle_deg(nominal[n].rotation, dense[n].rotation) for n in names]
    return RigSet(
        name=name,
        capture=capture,
        names=names,
        nominal=nominal,
        dense=dense,
        intrinsics=sparse.intrinsics[names[0]],
        accuracy_m=float(np.median(sigmas)),
        rms_m=root_mean_square(np.linalg.norm(to_rig.apply(source) - centers, axis=1)),
        angle_rms_deg=root_mean_square(np.array(turned)),
    )


def read_rig(path: Path) -> dict[str, tuple[FloatArray, float]]:
    """Position (3,) in metres and pan in degrees (mathematical, about z) by photograph name."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return {
                row["image"]: (np.array([float(row[f"{axis}_mm"]) for axis in "xyz"]) / 1000.0, float(row["pan_deg"]))
                for row in csv.DictReader(file)
            }
    except (OSError, KeyError, ValueError) as error:
        raise MetadataError(
            f"the rig's commanded poses cannot be read: {error}",
            path=path,
            remedy="FIELDKIT_DATA has to name the folder with the recorded sets.",
        ) from error


def complete_poses(commanded: Mapping[str, tuple[FloatArray, float]], dense: Mapping[str, Pose]) -> dict[str, Pose]:
    """Commanded positions with full rotations: mount · Rz(−pan) · tilt.

    Mount and tilt are one rotation each for the whole rig, fitted in turn to the dense poses (chordal means).
    """
    mount, tilt = np.eye(3), np.eye(3)
    turns = {n: _about_z(pan) for n, (_, pan) in commanded.items()}
    for _ in range(_ROUNDS):
        mount = _mean_rotation([dense[n].rotation @ tilt.T @ turn for n, turn in turns.items()])
        tilt = _mean_rotation([turn @ mount.T @ dense[n].rotation for n, turn in turns.items()])
    return {n: Pose(mount @ turns[n].T @ tilt, position) for n, (position, _) in commanded.items()}


def uniform_subset(names: Sequence[str], count: int, phase: int = 0) -> tuple[str, ...]:
    """``count`` of the names, evenly around the circle, starting at number ``phase``."""
    return tuple(names[(round(k * len(names) / count) + phase) % len(names)] for k in range(count))


def perturb(poses: Mapping[str, Pose], noise_m: float, noise_deg: float, draw: int) -> dict[str, Pose]:
    """Poses with Gaussian noise per axis of position and of rotation (about camera axes).

    A photograph's noise depends only on the draw and its place in ``poses``; other sizes scale the same noise.
    """
    rng = np.random.default_rng(draw)
    noisy = {}
    for name, pose in poses.items():
        shift, turn = rng.normal(size=3) * noise_m, rng.normal(size=3) * np.radians(noise_deg)
        noisy[name] = Pose(rotation_from_vector(turn) @ pose.rotation, pose.center + shift)
    return noisy


def root_mean_square(values: FloatArray) -> float:
    """√ of the mean of the squares."""
    return float(np.sqrt(np.mean(np.square(values))))


def _about_z(angle_deg: float) -> FloatArray:
    return rotation_from_vector(np.array([0.0, 0.0, np.radians(angle_deg)]))


def _mean_rotation(rotations: Sequence[FloatArray]) -> FloatArray:
    u, _, vt = np.linalg.svd(np.sum(rotations, axis=0))
    flip = np.diag([1.0, 1.0, np.linalg.det(u @ vt)])
    mean: FloatArray = u @ flip @ vt
    return mean
