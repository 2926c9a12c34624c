"""The plot frame (z up, z = 0 on the ground, origin at the plot's centre), and the volume of interest in it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.model import Capture
from fieldkit.clouds.ground import fit_ground_plane
from fieldkit.clouds.volume import Volume
from fieldkit.errors import EmptyCloudError, ReconstructionError
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.results.fields import vector
from fieldkit.results.frame import Plane
from fieldkit.wording import count

_LOOKING_UP = 0.5  # sine of the optical axis' elevation
_RECORDED_UP_DEG = 10.0


def find_ground(
    points: NDArray[np.float64], poses: Mapping[str, Pose], *, seed: int, keep_upright: bool
) -> Plane | None:
    """The ground plane near where the cameras look, or None where none can be found.

    Args:
        points: (n, 3) sparse or dense points.
        poses: in the same frame; up is towards them.
        keep_upright: the frame's z is up already (GPS).
    """
    centers = np.array([pose.center for pose in poses.values()])
    region = region_of_interest(list(poses.values()))
    if region is not None:
        points = points[np.linalg.norm(points - np.array(region.center), axis=1) <= region.radius]
    try:
        return fit_ground_plane(points, centers, up=(0.0, 0.0, 1.0) if keep_upright else None, seed=seed)
    except (EmptyCloudError, ReconstructionError):
        return None


def plot_from_world(
    points: NDArray[np.float64], poses: Mapping[str, Pose], ground: Plane | None, *, keep_upright: bool
) -> Similarity:
    """The rigid motion into the plot frame.

    Without a georeference the ground becomes z = 0 and its normal z. With one (``keep_upright``) the frame stays
    east-north-up and only moves: headings and heights stay true, and a slope stays a slope.
    """
    region = region_of_interest(list(poses.values()))
    middle = np.median(points, axis=0) if region is None else np.array(region.center)
    if ground is None:
        return Similarity(1.0, np.eye(3), -middle)
    if not keep_upright:
        return ground.levelling(middle)
    foot = middle.copy()
    foot[2] = (ground.offset_m - ground.normal[:2] @ middle[:2]) / ground.normal[2]
    return Similarity(1.0, np.eye(3), -foot)


def check_upright(poses: Mapping[str, Pose], capture: Capture) -> None:
    """Refuse a model that is upside down in a frame whose z is up.

    A plane of cameras fits mirrored positions as well as right ones, from below what it looks at. The capture's angles
    say which cameras do look up.
    """
    pitches = {name: prior.pitch_deg for name, prior in capture.priors.items()}
    up = [n for n, p in poses.items() if p.forward[2] > _LOOKING_UP and (pitches.get(n) or -90.0) < _RECORDED_UP_DEG]
    if not up or 2 * len(up) < len(poses):
        return
    raise ReconstructionError(
        f"the model is upside down: {len(up)} of {len(poses)} cameras look up at what they were flown over, so the "
        "positions are mirrored",
        path=capture.folder,
        registered=len(poses),
        remedy="Check the positions' hemisphere letters (N or S, E or W), their signs, and the order of x and y.",
    )


def moved_plane(plane: Plane, motion: Similarity) -> Plane:
    """The same plane after a rigid motion."""
    normal = motion.rotation @ plane.normal
    offset_m = plane.offset_m + float(normal @ motion.translation)
    return Plane(vector(normal), offset_m, plane.rms_m, plane.inlier_share, plane.tolerance_m)


_SHARED_BY = 0.5  # of the cameras see a point of a converging capture
_TRIM = 0.005
_MARGIN = 0.15  # of the box's edges, on every side but the top
_TOP_MARGIN = 0.35  # few sparse points lie on the tips of leaves
_MIN_POINTS = 20
_CUT_LAYER = 0.005  # of the box's height
_CUT_POINTS = 20


def volume_of_interest(
    points: NDArray[np.float64], poses: Mapping[str, Pose], intrinsics: Mapping[str, Intrinsics]
) -> Volume:
    """A box about what was photographed.

    Cameras that converge on a place share it: the box holds the sparse points near where their axes meet that at least
    half of the cameras have in their frames. Cameras that look alike (a nadir survey) share all they see: the box holds
    all sparse points. Either is trimmed of 0.5 % at each end and grown by 15 %, upwards by 35 %. ``points`` (n, 3) are
    sparse, in the plot frame.
    """
    chosen = points
    region = region_of_interest(list(poses.values()))
    if region is not None:
        near = np.linalg.norm(points - np.array(region.center), axis=1) <= region.radius
        seen = np.zeros(len(points))
        for name, pose in poses.items():
            seen += intrinsics[name].without_distortion().sees(pose.to_camera(points))
        shared = near & (seen >= _SHARED_BY * len(poses))
        chosen = points[shared] if shared.sum() >= _MIN_POINTS else points[near]
    if len(chosen) < _MIN_POINTS:
        raise ReconstructionError(
            f"only {count(len(chosen), 'point lies', 'points lie')} where the cameras look, too few to find the "
            "volume of interest",
            remedy="Give it with --bounds, in metres in the plot frame.",
        )
    lower, upper = np.quantile(chosen, [_TRIM, 1.0 - _TRIM], axis=0)
    edges = np.maximum(upper - lower, 0.05 * float(np.max(upper - lower)))
    return Volume(tuple(lower - _MARGIN * edges), tuple(upper + np.array([_MARGIN, _MARGIN, _TOP_MARGIN]) * edges))


def looked_beside_m(poses: Mapping[str, Pose], volume: Volume) -> float:
    """How far beside a volume, horizontally, the place lies that cameras look at; 0 where it is above or below it."""
    region = region_of_interest(list(poses.values()))
    center = np.mean([pose.center for pose in poses.values()], axis=0) if region is None else np.array(region.center)
    outside = np.maximum(np.array(volume.lower) - center, center - np.array(volume.upper))[:2]
    return float(np.hypot(*np.maximum(outside, 0.0)))


def cuts_plants(plants: NDArray[np.float64], volume: Volume, gsd_m: float) -> bool:
    """Whether a plants' cloud (n, 3) goes on to the top of the volume, as plants do that are higher than it.

    ``gsd_m`` is the length that a pixel of the depth maps covers.
    """
    layer = max(_CUT_LAYER * (volume.upper[2] - volume.lower[2]), 2.0 * gsd_m)
    return int(np.count_nonzero(plants[:, 2] > volume.upper[2] - layer)) >= _CUT_POINTS
