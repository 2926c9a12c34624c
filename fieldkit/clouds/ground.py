"""The ground plane of a cloud, found among plants."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.clouds.cells import voxel_thin
from fieldkit.clouds.cloud import Cloud
from fieldkit.errors import EmptyCloudError, ReconstructionError
from fieldkit.results.fields import vector
from fieldkit.results.frame import Plane
from fieldkit.runtime.kernels import kernel

UP = (0.0, 0.0, 1.0)
"""Upwards in a frame whose z is up."""
_HYPOTHESES = 8192
"""Number of planes that are tried where up is not known; a fourfold one where it is."""
_SCORED_POINTS = 20_000
"""Most points that planes are judged by."""
_PLANES_AT_ONCE = 512
"""Whose sides all points are told at a time: 80 MB."""
_TOLERANCE_SHARE = 0.005  # of the cloud's diagonal: 15 mm on a plot 3 m across
_LEAST_SHARE = 0.015  # of the thinned points must lie on the ground
_MOST_BELOW = 3.0  # times as many may lie below it
_CAMERAS_ABOVE = 0.8
"""Least share of cameras above a ground."""
MAX_TILT_DEG = 10.0
"""Of the ground against a known upward direction: fields that are worked by machines are rarely half as steep."""
_STANDS_OUT = 1.5
"""Times the points of a layer beside the ground lie in one as thick on it; in leaves it is about once."""
_LEAST_SEEN = 20
"""Points on the ground."""
_LEAST_UNDER = 40
"""The same of a ground under a canopy."""
_FINER = 3.0
"""By which the tolerance is divided there: soil is thinner than leaves."""
_SEEN_BELOW = 0.2
"""Of the well-seen points on the ground: so many may lie below it."""
_REFINEMENTS = 20
"""Most rounds in which a plane is fitted to its inliers."""


def fit_ground_plane(
    points: ArrayLike,
    camera_centers: ArrayLike | None = None,
    *,
    up: ArrayLike | None = None,
    well_seen: BoolArray | None = None,
    seed: int = 0,
) -> Plane:
    """Find the ground by RANSAC (Fischler and Bolles 1981) and refine it by least squares on its inliers.

    The points are thinned first, so that dense plants do not outvote sparse soil. A plane is rated by the number of
    points on it (MSAC: the nearer the more, Torr and Zisserman 2000), divided by (1 + below / on)⁴: the ground has
    plants above and little but noise below, while planes through the canopy, leaves and walls have much on both
    sides. The cameras must be on one side, which is up. Few points can be a good ground, and many in the leaves none:
    it has to stand out of the layers beside it, and hardly any well-seen points may lie below it. Under a canopy, where
    most points are leaves', it is looked for among well-seen points alone, to a third of the tolerance.

    Args:
        points: (n, 3), any orientation and unit.
        camera_centers: (m, 3) in the same frame. Without them up is the side with more points.
        up: (3,) upwards to within `MAX_TILT_DEG`, where it is known (the z axis of a GPS frame, recorded angles): it
            keeps slanting pots and walls of leaves from being taken for the ground.
        well_seen: (n,) which points are hardly noise. All but clutter where not given: three times as many as on the
            ground may lie below it then.
    """
    p = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    if not len(p):
        raise EmptyCloudError("no points to find the ground in", remedy="Check the volume of interest.")
    low, high = np.quantile(p, [0.01, 0.99], axis=0)
    tolerance = _TOLERANCE_SHARE * float(np.linalg.norm(high - low))
    if len(p) < 3 or tolerance == 0.0:
        raise _no_ground("its points do not span a plane")
    cameras = np.asarray([] if camera_centers is None else camera_centers, dtype=np.float64).reshape(-1, 3)
    try:
        return _fitted(p, cameras, up, well_seen, seed, tolerance)
    except ReconstructionError:
        if well_seen is None or up is None or well_seen.sum() < _LEAST_UNDER:
            raise
        return _fitted(p[well_seen], cameras, up, well_seen[well_seen], seed, tolerance / _FINER, _LEAST_UNDER)


def _fitted(
    p: FloatArray,
    cameras: FloatArray,
    up: ArrayLike | None,
    well_seen: BoolArray | None,
    seed: int,
    tolerance: float,
    least: int | None = None,
) -> Plane:
    """The ground among points (n, 3); ``least`` are to lie on it, `_LEAST_SHARE` and `_LEAST_SEEN` where not given."""
    middle = np.median(p, axis=0)
    cameras = cameras - middle
    rng = np.random.default_rng(seed)
    thinned = voxel_thin(Cloud(p - middle), 2.0 * tolerance).points
    normal, offset = _best_rated(thinned, cameras if len(cameras) else None, up, rng, tolerance)
    normal, offset = _refined(thinned, normal, offset, tolerance)
    if len(cameras) and np.mean(cameras @ normal > offset) < _CAMERAS_ABOVE:
        raise _no_ground("the flattest part of the cloud has cameras on both sides")
    if up is not None and normal @ _unit(up) < np.cos(np.radians(MAX_TILT_DEG)):
        raise _no_ground(f"the flattest part of the cloud is steeper than {MAX_TILT_DEG:.0f}°")
    heights = thinned @ normal - offset
    on, below = float(np.mean(np.abs(heights) <= tolerance)), float(np.mean(heights < -tolerance))
    if on < (0.0 if least else _LEAST_SHARE) or below > _MOST_BELOW * on:
        raise _no_ground("no plane below the plants holds a noticeable share of the points")
    seen = p if well_seen is None else p[well_seen]
    _check_seen((seen - middle) @ normal - offset, tolerance, least or _LEAST_SEEN, clean=well_seen is not None)
    offset += float(middle @ normal)
    distances = np.abs(p @ normal - offset)
    inliers = distances[distances <= tolerance]
    return Plane(
        vector(normal),
        float(offset),
        rms_m=float(np.sqrt(np.mean(inliers**2))) if len(inliers) else 0.0,
        inlier_share=len(inliers) / len(p),
        tolerance_m=tolerance,
    )


def _check_seen(heights: FloatArray, tolerance: float, least: int, *, clean: bool) -> None:
    """Refuse a plane that points (n,) at these heights do not stand out on, or, where they are clean, lie below."""
    layers = tolerance * np.array([-np.inf, -3.0, -2.0, -1.0, 1.0, 3.0])
    far, lower, low, on, high = np.diff(np.searchsorted(np.sort(heights), layers))
    if on < max(least, _STANDS_OUT * (lower + low + high) / 2.0):
        raise _no_ground("the flattest part of the cloud is as full of points as what is above and below it")
    if clean and far + lower > _SEEN_BELOW * on:
        raise _no_ground("well-seen points lie below the flattest part of the cloud")


def _best_rated(
    points: FloatArray,
    cameras: FloatArray | None,
    up: ArrayLike | None,
    rng: np.random.Generator,
    tolerance: float,
) -> tuple[FloatArray, float]:
    """Normal and offset of the best of many planes through random triples."""
    sample = points
    if len(sample) > _SCORED_POINTS:
        sample = sample[np.sort(rng.choice(len(sample), _SCORED_POINTS, replace=False))]
    normals, offsets = _hypotheses(sample, cameras, rng, _HYPOTHESES if up is None else 4 * _HYPOTHESES)
    if up is not None:
        upright = normals @ _unit(up) >= np.cos(np.radians(MAX_TILT_DEG))
        normals, offsets = normals[upright], offsets[upright]
    if not len(normals):
        raise _no_ground("its points lie on one line, or no plane is level enough with the cameras above it")
    best = int(np.argmax(_rate(np.ascontiguousarray(sample), normals, offsets, tolerance)))
    return normals[best], float(offsets[best])


def _no_ground(reason: str) -> ReconstructionError:
    return ReconstructionError(
        f"no ground plane was found: {reason}",
        remedy="Check that the photographs show soil between the plants, or give the bounds of the plot.",
    )


def _unit(vector: ArrayLike) -> FloatArray:
    v = np.asarray(vector, dtype=np.float64).reshape(3)
    return np.asarray(v / float(np.linalg.norm(v)))


def _hypotheses(
    sample: FloatArray, cameras: FloatArray | None, rng: np.random.Generator, count: int
) -> tuple[FloatArray, FloatArray]:
    """Upward normals (k, 3) and offsets (k,) of planes through random triples with the cameras above."""
    triples = rng.integers(0, len(sample), (count, 3))
    if cameras is not None:
        # Half of the triples come from the half of the points farthest from the cameras: more ground in them.
        depth = np.linalg.norm(sample - cameras.mean(axis=0), axis=1)
        far = np.argsort(depth, kind="stable")[len(sample) // 2 :]
        triples[::2] = far[rng.integers(0, len(far), (len(triples[::2]), 3))]
    a, b, c = (sample[triples[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    area = np.linalg.norm(cross, axis=1)
    scale = np.linalg.norm(b - a, axis=1) * np.linalg.norm(c - a, axis=1)
    usable = area > 1e-3 * np.maximum(scale, 1e-300)
    normals = cross[usable] / area[usable, None]
    offsets = np.einsum("ij,ij->i", normals, a[usable])
    seen = cameras if cameras is not None else sample
    share = np.concatenate(
        [
            (seen @ normals[k : k + _PLANES_AT_ONCE].T > offsets[k : k + _PLANES_AT_ONCE]).mean(axis=0)
            for k in range(0, len(normals), _PLANES_AT_ONCE)
        ]
        or [np.zeros(0)]
    )
    flip = np.where(share < 0.5, -1.0, 1.0)
    kept = np.ones(len(normals), dtype=np.bool_)
    if cameras is not None:
        kept = np.maximum(share, 1.0 - share) >= _CAMERAS_ABOVE
    return np.ascontiguousarray((normals * flip[:, None])[kept]), np.ascontiguousarray((offsets * flip)[kept])


@kernel
def _rate(points, normals, offsets, tolerance):  # type: ignore[no-untyped-def]
    ratings = np.zeros(len(normals))
    for k in range(len(normals)):
        nx, ny, nz, offset = normals[k, 0], normals[k, 1], normals[k, 2], offsets[k]
        on, below = 0.0, 0.0
        for i in range(len(points)):
            height = (nx * points[i, 0] + ny * points[i, 1] + nz * points[i, 2] - offset) / tolerance
            if height < -1.0:
                below += 1.0
            elif height <= 1.0:
                on += 1.0 - height * height
        if on > 0.0:
            ratings[k] = on / (1.0 + below / on) ** 4
    return ratings


def _refined(points: FloatArray, normal: FloatArray, offset: float, tolerance: float) -> tuple[FloatArray, float]:
    """Least squares on the inliers, again and again until they stay the same."""
    inliers = np.abs(points @ normal - offset) <= tolerance
    for _ in range(_REFINEMENTS):
        if inliers.sum() < 3:
            break
        mean = points[inliers].mean(axis=0)
        fitted = np.linalg.svd(points[inliers] - mean, full_matrices=False)[2][2]
        normal = fitted if fitted @ normal > 0 else -fitted
        offset = float(mean @ normal)
        before, inliers = inliers, np.abs(points @ normal - offset) <= tolerance
        if np.array_equal(before, inliers):
            break
    return normal, offset
