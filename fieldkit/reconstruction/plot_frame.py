"""The plot frame: z up, z = 0 on the ground, origin at the plot's centre."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.model import Capture
from fieldkit.clouds.ground import fit_ground_plane
from fieldkit.errors import EmptyCloudError, ReconstructionError
from fieldkit.geometry import Pose, Similarity
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.results.fields import vector
from fieldkit.results.frame import Plane

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

    A plane of cameras fits mirrored positions as well as right ones, from below what it looks at.

    Args:
        capture: whose angles say which cameras do look up.
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
