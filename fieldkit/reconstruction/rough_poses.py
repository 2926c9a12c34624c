"""What prior mapping starts from: known positions with orientations from the records, a blind model, or pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.reconstruction.agreement import ANGLE_SIGMAS, align_to_positions, judge
from fieldkit.reconstruction.colmap import pycolmap
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.known_poses import KnownPoses
from fieldkit.reconstruction.orientation import orient_cameras
from fieldkit.reconstruction.prior_mapping import RoughPose
from fieldkit.reconstruction.verification import TwoView

FOUND_SIGMA_DEG = 6.0
"""What orientations found from positions and pairs are good to (measured 0.3–6° on the recorded rigs)."""


def rough_from_records(known: KnownPoses) -> dict[str, RoughPose]:
    """Rough poses, by name, of the images whose position and orientation are recorded."""
    rough = {}
    for name in known.positioned:
        record = known.poses[name]
        if record.rotation is not None and record.position is not None:
            pose = Pose(record.rotation, record.position)
            rough[name] = RoughPose(pose, np.full(3, record.position_sigma_m), record.angle_sigma_deg)
    return rough


def rough_from_model(model: pycolmap.Reconstruction, known: KnownPoses, *, seed: int) -> dict[str, RoughPose]:
    """Known positions with the orientations of a blind model, of the images that it has right."""
    poses = model_poses(model)
    similarity = align_to_positions(poses, known.poses, seed=seed)
    found: dict[str, RoughPose] = {}
    if similarity is None:
        return found
    for name in known.positioned:
        record = known.poses[name]
        if name not in poses or record.position is None:
            continue
        pose = similarity.apply_pose(poses[name])
        if judge(pose, record).right:
            sigma = np.full(3, record.position_sigma_m)
            found[name] = RoughPose(Pose(pose.rotation, record.position), sigma, FOUND_SIGMA_DEG)
    return found


def rough_from_pairs(
    names: Sequence[str], known: KnownPoses, pairs: Mapping[tuple[int, int], TwoView], *, seed: int
) -> dict[str, RoughPose]:
    """Known positions with the orientations that verified pairs (by indices into ``names``) give."""
    records = [known.poses.get(name) for name in names]
    positions = [None if record is None else record.position for record in records]
    sigmas = [0.0 if record is None else record.position_sigma_m for record in records]
    found = {}
    for index, rotation in sorted(orient_cameras(positions, sigmas, pairs, seed=seed).items()):
        position = positions[index]
        if position is not None:
            found[names[index]] = RoughPose(Pose(rotation, position), np.full(3, sigmas[index]), FOUND_SIGMA_DEG)
    return found


def contradict(found: RoughPose, recorded: RoughPose) -> bool:
    """Whether an orientation that was found lies outside a recorded one's bound.

    Seen on real flights: photographs that were turned by 180° after the camera had written its yaw.
    """
    turn = rotation_angle_deg(found.pose.rotation, recorded.pose.rotation)
    return turn > ANGLE_SIGMAS * float(np.hypot(recorded.angle_sigma_deg, found.angle_sigma_deg))
