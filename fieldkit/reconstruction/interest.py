"""The volume of interest where nobody gives one: from where the cameras look and what they share."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds.volume import Volume
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.wording import count

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

    Cameras that converge on a place share it: the box holds the sparse points near where their axes meet that at
    least half of the cameras have in their frames. Cameras that look alike (a nadir survey) share all they see: the
    box holds all sparse points. Either is trimmed of 0.5 % at each end and grown by 15 %, upwards by 35 %.

    Args:
        points: (n, 3) sparse points, plot frame.
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

    Args:
        gsd_m: length that a pixel of the depth maps covers.
    """
    layer = max(_CUT_LAYER * (volume.upper[2] - volume.lower[2]), 2.0 * gsd_m)
    return int(np.count_nonzero(plants[:, 2] > volume.upper[2] - layer)) >= _CUT_POINTS
