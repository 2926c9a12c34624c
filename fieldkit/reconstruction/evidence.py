"""How well a reconstruction's own geometry supports its plants' cloud, without a reference. Pure functions.

The planner's geometric score (`fieldkit.planning.score.geometric`) has the same terms and constants of what dense
stereo can be expected to make of views and pairs of views.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fieldkit.arrays import BoolArray, FloatArray, IntArray
from fieldkit.clouds.cells import voxel_thin
from fieldkit.clouds.cloud import Cloud
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.similarity import similarity_motion
from fieldkit.vocabulary import CAP_M, GSD_M

# What views and pairs are worth. What is from elsewhere says where. How incidence, resolution and the angle's far side
# enter was chosen among a dozen ways by 25 evaluations of rings, arcs, chains and clumps about tuning-1 and tuning-2:
# all milder than in the prototype, whose stereo was simpler.
BEST_ANGLE_DEG = 12.0
"""Θ₀ between two rays at which a pair is worth most: 12° in the prototype and for dense stereo's choice of sources
(`dense.views`)."""
_TAIL_DEG = 20.0
"""Over which a pair's worth falls to 1/e on the far side, as guided matches fall on real plants (219, 153, 73 and 56
above chance at 18, 27, 36 and 46° on basil_rig)."""
_FACING = 0.1, 0.5
"""|n·v| up to which a surface is too steep, and from which it is as good as seen squarely."""
PIXEL_M = 0.008
"""Footprint of a pixel at which resolution has halved what a pair is worth."""
FINEST_M = GSD_M["standard"]
"""Ground sampling distance of dense stereo: a pixel of a photograph that covers less is reduced to it, so nearness is
worth nothing by itself."""
ERROR_PX = 0.5
"""Of a match, for the noise of depths."""


def quality_of_views(seen: BoolArray, facing: FloatArray, footprint_m: FloatArray) -> FloatArray:
    """Quality in [0, 1] of views at points: seen · incidence / (1 + (footprint / `PIXEL_M`)²).

    Args:
        seen: whether a view has a point in its picture, unhidden.
        facing: |n·v| of the surface's normal and the ray, 1 where there are no normals.
        footprint_m: of a pixel at the point, metres.
    """
    steep, square = _FACING
    incidence = np.clip((facing - steep) / (square - steep), 0.0, 1.0)
    quality: FloatArray = seen * incidence / (1.0 + (footprint_m / PIXEL_M) ** 2)
    return quality


def worth_of_angles(degrees: FloatArray) -> FloatArray:
    """What pairs are worth by the angle θ between their rays: (θ/θ₀ · e^(1 − θ/θ₀)) to the power of θ₀ / tail."""
    ratio = degrees / BEST_ANGLE_DEG
    worth: FloatArray = (ratio * np.exp(1.0 - ratio)) ** (BEST_ANGLE_DEG / _TAIL_DEG)
    return worth


_POINTS = 1500
"""Most points of a cloud that are looked at."""
_SIDES = 36
"""Number of directions that a plant's upright side may have."""
_OF_SIDES = 40
"""Most points whose sides are looked at."""
_MOST_VIEWS = 60
"""Most views that are looked at."""
_SHOWN = 0.4
"""Least share of points for a side to be shown."""
_LEVER = 100.0
"""Standard deviation of a similarity's parameters before positions are known, in a unit of their noise."""
_MOVED = 100
"""Number of points whose motion is looked at."""
_LOOSE = 5.0
"""Leverage of a group that positions do not hold, and the most of any."""


@dataclass(frozen=True)
class Evidence:
    """Figures of a cloud with its cameras. How full and how clean it is, `silhouettes` says.

    They follow the planner's geometric score (docs/planning.md), with the reconstructed cloud in the true one's place
    and without occlusion.
    """

    noise_m: float
    """Standard deviation of a point's depth that matches of half a pixel leave, median over points."""
    leverage: float
    """How far the cloud is moved, root mean square, per metre that every camera's known position is wrong: what
    positions leave open of the place, tilt and scale of what a group of cameras sees (`leverage`), mean square
    over cameras. Nothing but their positions holds groups of cameras together (`fieldkit.reconstruction.mapping`)."""


def evidence(
    plants: Cloud, poses: Sequence[Pose], cameras: Sequence[Intrinsics], groups: Sequence[int], voxel_m: float
) -> Evidence | None:
    """The figures of a cloud; None where it has no points or no normals, or fewer than two cameras.

    Args:
        plants: with normals, plot frame, metres.
        poses: of the photographs that count.
        groups: (m,) which group each is in.
        voxel_m: points are taken from voxels of this edge, so that dense places count as others.
    """
    if not len(plants) or plants.normals is None or len(poses) < 2:
        return None
    thinned = voxel_thin(Cloud(plants.points), voxel_m).points
    points = thinned[np.sort(np.random.default_rng(0).permutation(len(thinned))[:_POINTS])]
    normals = plants.normals[cKDTree(plants.points).query(points)[1]].astype(np.float64)
    _, noise = _supported(points, normals, poses, cameras)
    centers = np.array([pose.center for pose in poses])
    return Evidence(float(np.median(noise)), _leverage(centers, np.array(groups), points))


def hidden_sides(plants: FloatArray, poses: Sequence[Pose], cameras: Sequence[Intrinsics]) -> list[tuple[float, float]]:
    """Directions that plants (n, 3) have an upright side to which hardly any two photographs show well enough.

    Expected from poses alone, as the planner's score does: what plants hide of one another is not counted. Each range
    is from one azimuth to another, degrees clockwise from +y, of which the first may be the larger.
    """
    few = np.unique(np.linspace(0, len(poses) - 1, min(len(poses), _MOST_VIEWS)).round().astype(int))
    some = plants[np.random.default_rng(0).permutation(len(plants))[:_OF_SIDES]]
    if not len(some) or not len(few):
        return []
    step = 360.0 / _SIDES
    azimuth = np.radians(step * np.arange(_SIDES))
    facing = np.repeat(np.stack([np.sin(azimuth), np.cos(azimuth), np.zeros(_SIDES)], axis=1), len(some), axis=0)
    support, _ = _supported(
        np.tile(some, (_SIDES, 1)), facing, [poses[k] for k in few], [cameras[k] for k in few], one_sided=True
    )
    shown = support.reshape(_SIDES, -1).mean(axis=1) >= _SHOWN
    if not shown.any():
        return [(0.0, 360.0)]
    starts = np.flatnonzero(~shown & np.roll(shown, 1))
    ends = np.flatnonzero(~shown & np.roll(shown, -1))
    last = [min(ends, key=lambda end: (end - start) % _SIDES) for start in starts]
    edges = ((np.stack([starts - 0.5, np.array(last) + 0.5], axis=1) * step) % 360.0).reshape(-1, 2).tolist()
    return [(start, end) for start, end in edges]


def _leverage(centers: FloatArray, group: IntArray, points: FloatArray) -> float:
    """Root mean square over cameras of their groups' leverage, none above `_LOOSE`."""
    groups = [centers[group == number] for number in np.unique(group)]
    own = [min(_LOOSE, leverage(members, points)) if len(members) > 1 else _LOOSE for members in groups]
    return float(np.sqrt(np.average(np.square(own), weights=[len(members) for members in groups])))


def leverage(centers: FloatArray, points: FloatArray) -> float:
    """Root mean square motion of points (p, 3) per unit of noise in positions (n, 3) that a similarity is fitted to.

    Linearised: its parameters have the covariance (Σ JᵀJ)⁻¹ per unit variance and axis. Cameras close together, or on
    one line, leave a tilt that far points feel; the prior `_LEVER` bounds it.
    """
    middle = centers.mean(axis=0)
    of_centers, of_points = (
        similarity_motion(places - middle) for places in (centers, points[:: max(1, len(points) // _MOVED)])
    )
    covariance = np.linalg.inv(np.einsum("nai,naj->ij", of_centers, of_centers) + np.eye(7) * _LEVER**-2)
    return float(np.sqrt(np.einsum("nai,ij,naj->n", of_points, covariance, of_points).mean() / 3.0))


def _supported(
    points: FloatArray,
    normals: FloatArray,
    poses: Sequence[Pose],
    cameras: Sequence[Intrinsics],
    *,
    one_sided: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """(p,) probability that two depths are right, (p,) noise of a depth in metres."""
    rays, quality, footprint = [], [], []
    for pose, camera in zip(poses, cameras, strict=True):
        towards = pose.center - points
        distance = np.linalg.norm(towards, axis=1)
        ray = towards / np.maximum(distance, 1e-9)[:, None]
        seen = camera.sees(points, pose)
        pixel = np.maximum(distance / camera.fx, FINEST_M)
        rays.append(ray)
        footprint.append(pixel)
        cosine = (normals * ray).sum(axis=1)
        quality.append(quality_of_views(seen, np.maximum(cosine, 0.0) if one_sided else np.abs(cosine), pixel))
    fails = np.ones((len(poses), len(points)))
    information = np.full(len(points), CAP_M**-2)
    for a in range(len(poses)):
        for b in range(a + 1, len(poses)):
            cosine = np.clip((rays[a] * rays[b]).sum(axis=1), -1.0, 1.0)
            success = worth_of_angles(np.degrees(np.arccos(cosine))) * np.minimum(quality[a], quality[b])
            fails[a] *= 1.0 - success
            fails[b] *= 1.0 - success
            information += success * (1.0 - cosine**2) / (ERROR_PX**2 * footprint[a] * footprint[b])
    none = np.prod(fails, axis=0)
    one = sum((1.0 - fails[a]) * np.prod(np.delete(fails, a, axis=0), axis=0) for a in range(len(poses)))
    return 1.0 - none - one, 1.0 / np.sqrt(information)
