"""The plot frame (z up, z = 0 on the ground, origin at the plot's centre), and the volume of interest in it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.captures.model import Capture
from fieldkit.clouds.ground import MAX_TILT_DEG, UP, fit_ground_plane
from fieldkit.clouds.volume import Volume
from fieldkit.errors import EmptyCloudError, ReconstructionError
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.priors import Priors
from fieldkit.reconstruction.agreement import POSITION_SIGMAS
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.mapping.angle_conventions import look_odd
from fieldkit.results.fields import vector
from fieldkit.results.frame import Plane
from fieldkit.vocabulary import LEAST_POSITIONS
from fieldkit.wording import count

_LOOKING_UP = 0.5  # sine of the optical axis' elevation
_RECORDED_UP_DEG = 10.0
"""Recorded pitch from which a camera that looks up in the model was meant to, degrees."""


def known_up(poses: Mapping[str, Pose], priors: Priors, *, metric: bool) -> FloatArray | None:
    """Upwards (3,) in a model's frame, where a georeference, three positions off one line or angles say it.

    Args:
        poses: of the photographs that count.
        priors: what is known of them; other programs' frames need not stand upright.
        metric: whether the model is in the priors' frame.
    """
    known = {name: priors.by_name[name] for name in poses if name in priors.by_name}
    recorded = {name: p.rotation for name, p in known.items() if p.rotation is not None and p.angles is not None}
    if metric and priors.frame is not None and priors.frame.georeferenced:
        return np.array(UP)
    placed = priors.positions(known) if metric and known else np.zeros((0, 3))
    if len(placed) >= LEAST_POSITIONS and priors.frame is not None and priors.frame.source == "poses.csv":
        across_m = float(np.linalg.svd(placed - placed.mean(axis=0), compute_uv=False)[1])
        held = POSITION_SIGMAS * priors.sigma_m <= np.tan(np.radians(MAX_TILT_DEG)) * across_m
        if held and (recorded or 2 * len(_looking_up(poses)) < len(poses)):
            return np.array(UP)
    if len(recorded) < LEAST_POSITIONS or look_odd(recorded):
        return None
    mean = np.mean([poses[name].rotation.T @ rotation[:, 2] for name, rotation in recorded.items()], axis=0)
    length = float(np.linalg.norm(mean))
    return np.asarray(mean / length) if length >= np.cos(np.radians(MAX_TILT_DEG)) else None


def find_ground(
    points: FloatArray,
    poses: Mapping[str, Pose],
    *,
    seed: int,
    up: FloatArray | None = None,
    well_seen: BoolArray | None = None,
) -> Plane | None:
    """The ground plane near where the cameras look, or None where none can be found.

    Args:
        points: (n, 3) sparse or dense points.
        poses: in the same frame; the ground is below them.
        up: (3,) in the same frame, where it is known.
        well_seen: (n,) which points are hardly noise; all where not given.
    """
    centers = np.array([pose.center for pose in poses.values()])
    region = region_of_interest(list(poses.values()))
    if region is not None:
        near = np.linalg.norm(points - np.array(region.center), axis=1) <= region.radius
        points, well_seen = points[near], None if well_seen is None else well_seen[near]
    try:
        return fit_ground_plane(points, centers, up=up, well_seen=well_seen, seed=seed)
    except (EmptyCloudError, ReconstructionError):
        return None


def plot_from_world(
    points: FloatArray,
    poses: Mapping[str, Pose],
    ground: Plane | None,
    *,
    georeferenced: bool,
    up: FloatArray | None = None,
) -> Similarity:
    """The rigid motion into the plot frame.

    Without a georeference the ground becomes z = 0 and its normal z; without a ground ``up`` (3,) does, where it is
    known. With a georeference the frame stays east-north-up and only moves: headings and heights stay true, and a slope
    stays a slope.
    """
    region = region_of_interest(list(poses.values()))
    middle = np.median(points, axis=0) if region is None else np.array(region.center)
    if ground is None and up is not None:
        ground = Plane(vector(up), float(up @ middle), 0.0, 0.0, 0.0)
    if ground is None:
        return Similarity(1.0, np.eye(3), -middle)
    if not georeferenced:
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
    up = [name for name in _looking_up(poses) if (pitches.get(name) or -90.0) < _RECORDED_UP_DEG]
    if not up or 2 * len(up) < len(poses):
        return
    raise ReconstructionError(
        f"the model is upside down: {len(up)} of {len(poses)} cameras look up at what they were flown over, so the "
        "positions are mirrored",
        path=capture.folder,
        registered=len(poses),
        remedy="Check the positions' hemisphere letters (N or S, E or W), their signs, and the order of x and y.",
    )


def _looking_up(poses: Mapping[str, Pose]) -> list[str]:
    return [name for name, pose in poses.items() if pose.forward[2] > _LOOKING_UP]


_SHARED_BY = 0.5  # of the cameras see a point of a converging capture
_TRIM = 0.005
"""Share of points at each end of an axis that is left out."""
_MARGIN = 0.15  # of the box's edges, on every side but the top
_TOP_MARGIN = 0.35  # few sparse points lie on the tips of leaves
_MIN_POINTS = 20
"""Least number of sparse points that give a volume."""


def volume_of_interest(points: FloatArray, poses: Mapping[str, Pose], intrinsics: Mapping[str, Intrinsics]) -> Volume:
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
            seen += intrinsics[name].sees(points, pose)
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
