"""How well a reconstruction's own geometry supports its plants' cloud, without a reference. Pure functions.

`StereoQuality` has the terms and constants that the planner's geometric score (`fieldkit.planning.score.geometric`) and
the evidence have in common: what dense stereo can be expected to make of views and pairs of views.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.thinning import voxel_thin
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.runtime.colmap import pycolmap
from fieldkit.vocabulary import GSD_M

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StereoQuality:
    """Constants of what views and pairs are worth.

    What is from elsewhere says where. How incidence, resolution and the angle's far side enter was chosen among a dozen
    ways by 25 evaluations of rings, arcs, chains and clumps about tuning-1 and tuning-2: all milder than in the
    prototype, whose stereo was simpler.
    """

    best_angle_deg: float = 12.0
    """Θ₀ between two rays at which a pair is worth most: 12° in the prototype and for dense stereo's choice of
    sources (`dense.settings.Settings`)."""
    tail_deg: float = 20.0
    """Over which a pair's worth falls to 1/e on the far side, as guided matches fall on real plants (219, 153, 73
    and 56 above chance at 18, 27, 36 and 46° on basil_rig)."""
    facing: tuple[float, float] = (0.1, 0.5)
    """|n·v| up to which a surface is too steep, and from which it is as good as seen squarely."""
    pixel_m: float = 0.008
    """Footprint of a pixel at which resolution has halved what a pair is worth."""
    gsd_m: float = GSD_M["standard"]
    """Ground sampling distance of dense stereo: a pixel of a photograph that covers less is reduced to it, so nearness
    is worth nothing by itself."""
    error_px: float = 0.5
    """Of a match, for the noise of depths."""
    tolerance_px: float = 6.0
    """Motion of a leaf between two views at which half of their matches fail: 2 ranks sets in wind worse, 4 to 20
    about as well (docs/experiments/score-and-planner.md)."""
    cap_m: float = 0.10
    """Of every distance, as in the objective's rule (`Rule`)."""

    def of_views(self, seen: NDArray[np.bool_], facing: Array, footprint_m: Array) -> Array:
        """Quality in [0, 1] of views at points: seen · incidence / (1 + (footprint / `pixel_m`)²).

        Args:
            seen: whether a view has a point in its picture, unhidden.
            facing: |n·v| of the surface's normal and the ray, 1 where there are no normals.
            footprint_m: of a pixel at the point, metres.
        """
        steep, square = self.facing
        incidence = np.clip((facing - steep) / (square - steep), 0.0, 1.0)
        quality: Array = seen * incidence / (1.0 + (footprint_m / self.pixel_m) ** 2)
        return quality

    def of_angles(self, degrees: Array) -> Array:
        """What pairs are worth by the angle θ between their rays: (θ/θ₀ · e^(1 − θ/θ₀)) to the power of θ₀ / tail."""
        ratio = degrees / self.best_angle_deg
        worth: Array = (ratio * np.exp(1.0 - ratio)) ** (self.best_angle_deg / self.tail_deg)
        return worth


_POINTS = 1500
_SIDES, _OF_SIDES, _MOST_VIEWS = 36, 40, 60
_SHOWN = 0.4
_QUALITY = StereoQuality()
_LEVER = 100.0
_MOVED = 100
_LOOSE = 5.0
LEAST_SHARED = 20
"""Sparse points in common from which two photographs hold each other."""


@dataclass(frozen=True)
class Evidence:
    """Figures of a cloud with its cameras. How full and how clean it is, `silhouettes` says.

    They follow the planner's geometric score (docs/objective.md), with the reconstructed cloud in the true one's place
    and without occlusion.
    """

    noise_m: float
    """Standard deviation of a point's depth that matches of half a pixel leave, median over points."""
    leverage: float
    """How far the cloud is moved, root mean square, per metre that every camera's known position is wrong: what
    positions leave open of the place, tilt and scale of what a group of cameras sees (`leverage`), mean square
    over cameras. A group are cameras that a chain of pairs with at least `LEAST_SHARED` sparse points in common
    joins: nothing but their positions holds groups together."""


def evidence(
    plants: Cloud, poses: Sequence[Pose], cameras: Sequence[Intrinsics], shared: NDArray[np.int64], voxel_m: float
) -> Evidence | None:
    """The figures of a cloud; None where it has no points or no normals, or fewer than two cameras.

    Args:
        plants: with normals, plot frame, metres.
        poses: of the photographs that count.
        shared: (m, m) how many sparse points each two photographs have in common.
        voxel_m: points are taken from voxels of this edge, so that dense places count as others.
    """
    if not len(plants) or plants.normals is None or len(poses) < 2:
        return None
    thinned = voxel_thin(Cloud(plants.points), voxel_m).points
    points = thinned[np.sort(np.random.default_rng(0).permutation(len(thinned))[:_POINTS])]
    normals = plants.normals[cKDTree(plants.points).query(points)[1]].astype(np.float64)
    _, noise = _supported(points, normals, poses, cameras)
    _, group = connected_components(np.asarray(shared) >= LEAST_SHARED, directed=False)
    return Evidence(float(np.median(noise)), _leverage(np.array([pose.center for pose in poses]), group, points))


def hidden_sides(plants: Array, poses: Sequence[Pose], cameras: Sequence[Intrinsics]) -> list[tuple[float, float]]:
    """Directions that plants (n, 3) have an upright side to which hardly any two photographs show well enough.

    Expected from poses alone, as the planner's score does: what plants hide of one another is not counted.

    Returns:
        Each range from one azimuth to another, degrees clockwise from +y, of which the first may be the larger.
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


def shared_points(model: pycolmap.Reconstruction, names: Sequence[str]) -> NDArray[np.int64]:
    """(m, m) how many sparse points each two photographs of a model have in common, in the order of ``names``.

    The diagonal has all points that a photograph sees.
    """
    row = {name: k for k, name in enumerate(names)}
    rows = {i: row[str(model.image(i).name)] for i in model.reg_image_ids() if str(model.image(i).name) in row}
    ids = sorted(model.point3D_ids())
    seen = np.zeros((len(names), len(ids)), dtype=np.int64)
    for column, key in enumerate(ids):
        for element in model.points3D[key].track.elements:
            if element.image_id in rows:
                seen[rows[element.image_id], column] = 1
    shared: NDArray[np.int64] = seen @ seen.T
    return shared


def _leverage(centers: Array, group: NDArray[np.int64], points: Array) -> float:
    """Root mean square over cameras of their groups' leverage, none above `_LOOSE`."""
    squares = 0.0
    for number in range(int(group.max()) + 1):
        members = centers[group == number]
        own = leverage(members, points) if len(members) > 1 else _LOOSE
        squares += len(members) * min(own, _LOOSE) ** 2
    return float(np.sqrt(squares / len(centers)))


def leverage(centers: Array, points: Array) -> float:
    """Root mean square motion of points (p, 3) per unit of noise in positions (n, 3) that a similarity is fitted to.

    Linearised: a position c moves by t + ω × c + s · c, so t, ω and s have the covariance (Σ JᵀJ)⁻¹ per unit variance
    and axis. Cameras close together, or on one line, leave a tilt that far points feel; the prior `_LEVER` bounds it.
    """
    middle = centers.mean(axis=0)
    information = sum(j.T @ j for j in (_motion(c - middle) for c in centers)) + np.eye(7) * _LEVER**-2
    covariance = np.linalg.inv(information)
    some = points[:: max(1, len(points) // _MOVED)]
    moved = [float(np.trace(j @ covariance @ j.T)) for j in (_motion(p - middle) for p in some)]
    return float(np.sqrt(np.mean(moved) / 3.0))


def _motion(place: Array) -> Array:
    """(3, 7) derivative of a place's position by translation, rotation and scale."""
    x, y, z = place
    turned = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    return np.column_stack([np.eye(3), turned, place])


def _supported(
    points: Array, normals: Array, poses: Sequence[Pose], cameras: Sequence[Intrinsics], *, one_sided: bool = False
) -> tuple[Array, Array]:
    """(p,) probability that two depths are right, (p,) noise of a depth in metres."""
    rays, quality, footprint = [], [], []
    for pose, camera in zip(poses, cameras, strict=True):
        towards = pose.center - points
        distance = np.linalg.norm(towards, axis=1)
        ray = towards / np.maximum(distance, 1e-9)[:, None]
        seen = camera.without_distortion().sees(pose.to_camera(points))
        pixel = np.maximum(distance / camera.fx, _QUALITY.gsd_m)
        rays.append(ray)
        footprint.append(pixel)
        cosine = (normals * ray).sum(axis=1)
        quality.append(_QUALITY.of_views(seen, np.maximum(cosine, 0.0) if one_sided else np.abs(cosine), pixel))
    fails = np.ones((len(poses), len(points)))
    information = np.full(len(points), _QUALITY.cap_m**-2)
    for a in range(len(poses)):
        for b in range(a + 1, len(poses)):
            cosine = np.clip((rays[a] * rays[b]).sum(axis=1), -1.0, 1.0)
            success = _QUALITY.of_angles(np.degrees(np.arccos(cosine))) * np.minimum(quality[a], quality[b])
            fails[a] *= 1.0 - success
            fails[b] *= 1.0 - success
            information += success * (1.0 - cosine**2) / (_QUALITY.error_px**2 * footprint[a] * footprint[b])
    none = np.prod(fails, axis=0)
    one = sum((1.0 - fails[a]) * np.prod(np.delete(fails, a, axis=0), axis=0) for a in range(len(poses)))
    return 1.0 - none - one, 1.0 / np.sqrt(information)
