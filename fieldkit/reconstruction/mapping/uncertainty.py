"""How well cameras are known: the covariance of their poses from the normal equations of the last bundle adjustment.

Positions known before count with their errors, observations with their residuals. What a match says of two cameras
counts as far as it is above chance: a narrow band gives every pair matches, and bundle adjustment bends a model until
some of them fit. Right ones lie within half a pixel of their epipolar lines and chance ones anywhere in the band, so
the information of a pair is that of an M-estimator of all matches in a band (`pair_information`). Points are seen by
such pairs alone: a track that only chance continues is cut there.

What all cameras have in common, a similarity, is the frame's error and is taken off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from fieldkit.arrays import BoolArray, FloatArray, IntArray
from fieldkit.geometry.priors import PosePrior
from fieldkit.geometry.similarity import similarity_motion
from fieldkit.reconstruction.colmap_model import pose_of
from fieldkit.runtime.colmap import pycolmap
from fieldkit.vocabulary import BY_CHANCE, FREE_RAD

Pair = tuple[int, int]
TIE_BAND_PX = 6.0
"""Half width of the band whose matches tell a pair's information, pixels of what features are found in: at most 1600
wide."""
_TIE_SCALE_PX = 0.75
"""Scale of Cauchy's loss of epipolar distances, pixels."""
_TIE_NOISE_PX = 0.5
"""Standard deviation of a right match's epipolar distance, pixels."""
_FAR_PX = 100.0
"""Distance beyond which distances are alike, pixels."""
_INFLATION = 1.25
"""Of observations' errors: matches of one surface err alike, and lenses are no models. Calibrated on the rigs."""
_FLOOR = 0.0015
"""Standard deviation of a centre that nothing lowers, as a share of the distance to what is seen."""
_LEAST_SLOPE = 0.2
"""Least mean slope of the loss's derivative, which bounds the variance."""
_MOST_OBSERVATIONS = 400_000
"""Of more, those of every k-th point stand for all and count k times: those of 500 photographs would take gigabytes."""
_FREE_EXTENTS = 3.0
"""Standard deviation of an unknown position, in extents of the cameras."""
_FOCAL_SIGMA = 0.3
"""Relative standard deviation of a focal length before it is refined."""
_ROUNDS = 10
"""Number of rounds of reweighting."""
_MOVING = 0.5
"""Share of the largest motion from which a camera moves with it."""


def pair_information(distances_px: FloatArray) -> float:
    """What a pair's matches say of its relative pose, in 1/px²: Cauchy's loss as an M-estimator.

    ``distances_px`` (n,) are of all matches in a band to their epipolar lines, in pixels of what features are found in.
    """
    distances_px = np.minimum(np.nan_to_num(distances_px, nan=_FAR_PX), _FAR_PX)
    ratio = (distances_px / _TIE_SCALE_PX) ** 2
    slope = float(((1.0 - ratio) / (1.0 + ratio) ** 2).sum())
    pull = float((distances_px**2 / (1.0 + ratio) ** 2).sum())
    return max(0.0, slope - BY_CHANCE) ** 2 / pull if pull > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Of the poses of a model's n photographs, against one another."""

    names: tuple[str, ...]
    centers: FloatArray
    """(n, 3)."""
    covariance: FloatArray
    """(3 n, 3 n) of the centres, without the similarity that they have in common."""
    part: NDArray[np.int32]
    """(n,) which of the groups that pairs join each is in."""
    distance: float
    """To the points that are seen, median over photographs; in the model's unit, as all lengths here."""
    reprojection_px: FloatArray
    """(n,) mean error of each photograph's observations."""

    @property
    def sigma(self) -> FloatArray:
        """(n,) root mean square error expected of each centre."""
        own = np.diag(self.covariance).reshape(-1, 3).sum(axis=1)
        sigma: FloatArray = np.sqrt(np.maximum(own, 0.0) + (_FLOOR * self.distance) ** 2)
        return sigma

    def weakest(self) -> tuple[list[str], float, FloatArray]:
        """Which k photographs could move together against the others most easily, their root mean square error then,
        and how (k, 3).

        A group that no pair joins to the largest. Where there is none, those that the covariance's largest principal
        axis moves, less the similarity that leaves most centres where they are.
        """
        largest = int(np.argmax(np.bincount(self.part)))
        groups = [self.part == label for label in np.unique(self.part) if label != largest] or [self._bent()]
        sigmas = [float(np.sqrt((self.sigma[group] ** 2).mean())) if group.any() else 0.0 for group in groups]
        chosen = groups[int(np.argmax(sigmas))]
        rows = np.repeat(chosen, 3)
        axes = np.linalg.eigh(self.covariance[np.ix_(rows, rows)])[1] if rows.any() else np.zeros((0, 1))
        names = [name for name, moving in zip(self.names, chosen, strict=True) if moving]
        return names, max(sigmas), max(sigmas) * np.sqrt(len(names)) * axes[:, -1].reshape(-1, 3)

    def _bent(self) -> BoolArray:
        """(n,) which centres the largest principal axis moves: no more than half of them."""
        moves = np.linalg.eigh(self.covariance)[1][:, -1].reshape(-1, 3)
        motion, weight = similarity_motion(self.centers - self.centers.mean(axis=0)), np.ones(len(moves))
        for _ in range(_ROUNDS):
            fitted = np.linalg.pinv((weight[:, None, None] * motion).reshape(-1, 7)) @ (weight[:, None] * moves).ravel()
            length = np.linalg.norm(moves - motion @ fitted, axis=1)
            weight = 1.0 / np.sqrt(np.maximum(length, 1e-3 * length.max() + 1e-12))
        away: BoolArray = length > _MOVING * length.max()
        return away if 2 * away.sum() <= len(away) else ~away


def pose_uncertainty(
    model: pycolmap.Reconstruction,
    priors: Mapping[str, PosePrior],
    pair_values: Mapping[Pair, float],
    names: Sequence[str],
    *,
    loss_px: float,
    refined: bool,
) -> Uncertainty:
    """How well a model's poses are known.

    Args:
        model: at the optimum of its bundle adjustment.
        priors: by name, in the model's frame; none where it is not metric.
        pair_values: information of the pairs (`pair_information`), by indices into ``names``.
        loss_px: scale of the bundle adjustment's Cauchy loss.
        refined: whether it adjusted focal lengths and distortion.
    """
    seen = _observations(model)
    index = {name: k for k, name in enumerate(names)}
    row = {index[name]: k for k, name in enumerate(seen.names)}
    information = np.zeros((len(row), len(row)))
    for (i, j), value in pair_values.items():
        if i in row and j in row:
            information[row[i], row[j]] = information[row[j], row[i]] = value
    joined, weight = _joined(seen, information)
    squares = (seen.residual**2).sum(axis=1)
    total = np.bincount(seen.image, np.sqrt(squares), len(row))
    mean = total / np.maximum(1, np.bincount(seen.image, minlength=len(row)))
    variance = _variance(squares[joined.chosen], loss_px, joined.points, len(row))
    normal = _normal_equations(joined, seen.every * weight / (_INFLATION**2 * variance), refined=refined)
    extent = _FREE_EXTENTS * float(np.linalg.norm(np.ptp(seen.centers, axis=0)))
    for k, name in enumerate(seen.names):
        known, at = priors.get(name, PosePrior()), 6 * k
        position = extent if known.position is None else known.position_sigma_m
        normal[range(at, at + 3), range(at, at + 3)] += FREE_RAD**-2
        normal[range(at + 3, at + 6), range(at + 3, at + 6)] += position**-2
    covariance = np.linalg.inv(normal)[: 6 * len(row), : 6 * len(row)].reshape(len(row), 6, len(row), 6)
    motion = similarity_motion(seen.centers - seen.centers.mean(axis=0)).reshape(-1, 7)
    off = np.eye(len(motion)) - motion @ np.linalg.pinv(motion, rcond=1e-6)
    part = connected_components(coo_array(information > 0.0), directed=False)[1]
    of_centers = off @ covariance[:, 3:, :, 3:].reshape(off.shape) @ off.T
    return Uncertainty(seen.names, seen.centers, of_centers, part, seen.distance, mean)


@dataclass(frozen=True, eq=False)
class _Observations:
    """m observations of a model's points, with derivatives of pixels."""

    names: tuple[str, ...]
    centers: FloatArray
    """(n, 3)."""
    distance: float
    chosen: IntArray
    """(m,) which of all observations these are."""
    image: IntArray
    point: IntArray
    """(m,) counted from 0."""
    points: int
    residual: FloatArray
    """(m, 2) pixels."""
    by_pose: FloatArray
    """(m, 2, 6): the camera's rotation in the world, radians, and its centre."""
    by_point: FloatArray
    """(m, 2, 3)."""
    by_lens: FloatArray
    """(m, 2, 2): relative focal length, and one coefficient of radial distortion."""
    every: int
    """How many of the model's points each stands for."""


def _observations(model: pycolmap.Reconstruction) -> _Observations:
    images = sorted((model.image(i) for i in model.reg_image_ids()), key=lambda image: str(image.name))
    row = {image.image_id: k for k, image in enumerate(images)}
    every = max(1, -(-model.compute_num_observations() // _MOST_OBSERVATIONS))
    keys = sorted(model.point3D_ids())[::every]
    places = np.array([model.points3D[key].xyz for key in keys]).reshape(-1, 3)
    tracks = [
        (k, row[element.image_id], element.point2D_idx)
        for k, key in enumerate(keys)
        for element in model.points3D[key].track.elements
        if element.image_id in row
    ]
    point, image, feature = np.array(tracks, np.int64).reshape(-1, 3).T
    count = len(tracks)
    residual, by_pose = np.zeros((count, 2)), np.zeros((count, 2, 6))
    by_point, by_lens = np.zeros((count, 2, 3)), np.zeros((count, 2, 2))
    poses = [pose_of(each) for each in images]
    depths = []
    for k, (each, pose) in enumerate(zip(images, poses, strict=True)):
        mine = np.flatnonzero(image == k)
        if not len(mine):
            continue
        camera = model.camera(each.camera_id)
        arm = places[point[mine]] - pose.center
        x, y, z = (arm @ pose.rotation.T).T
        pixels = np.array([each.points2D[int(n)].xy for n in feature[mine]])
        residual[mine] = np.array(camera.img_from_cam(np.stack([x, y, z], axis=1))).reshape(-1, 2) - pixels
        focal = camera.mean_focal_length()
        by_ray = np.zeros((len(mine), 2, 3))
        by_ray[:, 0, 0], by_ray[:, 0, 2] = focal / z, -focal * x / z**2
        by_ray[:, 1, 1], by_ray[:, 1, 2] = focal / z, -focal * y / z**2
        by_point[mine] = by_ray @ pose.rotation
        by_pose[mine, :, :3] = np.cross(by_point[mine], arm[:, None, :])
        by_pose[mine, :, 3:] = -by_point[mine]
        ray = np.stack([x / z, y / z], axis=1)
        by_lens[mine] = focal * np.stack([ray, ray * (ray**2).sum(axis=1, keepdims=True)], axis=2)
        depths.append(float(np.median(np.linalg.norm(arm, axis=1))))
    seen = np.isfinite(residual).all(axis=1)  # a point behind a camera has no pixel
    return _Observations(
        tuple(str(each.name) for each in images),
        np.array([pose.center for pose in poses]),
        float(np.median(depths)) if depths else 0.0,
        np.arange(int(seen.sum())),
        image[seen],
        point[seen],
        len(keys),
        residual[seen],
        by_pose[seen],
        by_point[seen],
        by_lens[seen],
        every,
    )


def _joined(seen: _Observations, information: FloatArray) -> tuple[_Observations, FloatArray]:
    """The observations that pairs with information join to others of their points, cut where none does; and weights.

    ``information`` (n, n) is of pairs of images. Also the share (m,) that each has of what it would have with right
    matches only: its best pair's.
    """
    order = np.argsort(seen.point, kind="stable")
    image, point = seen.image[order], seen.point[order]
    longest = int(np.bincount(point).max()) if len(point) else 0
    steps = range(1, longest)
    first = [np.flatnonzero(point[step:] == point[:-step]) for step in steps]
    one = np.concatenate([np.zeros(0, np.int64), *first])
    other = np.concatenate([np.zeros(0, np.int64), *(each + step for each, step in zip(first, steps, strict=True))])
    connected = information[image[one], image[other]] > 0.0
    one, other = one[connected], other[connected]
    shared = np.zeros_like(information)
    np.add.at(shared, (image[one], image[other]), 1.0)
    shared = seen.every * (shared + shared.T)
    share = np.minimum(1.0, _TIE_NOISE_PX**2 * information / np.maximum(shared, 1.0))
    weight = np.zeros(len(point))
    for mine, theirs in ((one, other), (other, one)):
        np.maximum.at(weight, mine, share[image[mine], image[theirs]])
    links = coo_array((np.ones(len(one), np.int8), (one, other)), shape=(len(point),) * 2)
    label = connected_components(links, directed=False)[1]
    kept = np.bincount(label, minlength=len(point))[label] > 1
    chosen = order[kept]
    points, new = np.unique(label[kept], return_inverse=True)
    fields = ("image", "residual", "by_pose", "by_point", "by_lens")
    of_chosen: dict[str, Any] = {name: getattr(seen, name)[chosen] for name in fields}
    return replace(seen, chosen=chosen, point=new.astype(np.int64), points=len(points), **of_chosen), weight[kept]


def _variance(squares: FloatArray, loss_px: float, points: int, images: int) -> float:
    """Of an observation's pixels under Cauchy's loss: Σψ² / (degrees of freedom) / (mean ψ′)², after Huber."""
    if not len(squares):
        return loss_px**2
    ratio = squares / loss_px**2
    slope = max(_LEAST_SLOPE, float((1.0 / (1.0 + ratio) ** 2).mean()))
    free = max(2 * len(squares) - 3 * points - 6 * images, 0.1 * 2 * len(squares))
    return float((squares / (1.0 + ratio) ** 2).sum()) / free / slope**2


def _normal_equations(seen: _Observations, weight: FloatArray, *, refined: bool) -> FloatArray:
    """(6 n, 6 n) information of poses, points eliminated (Schur's complement); two more rows of a ``refined`` lens."""
    count, points = len(seen.names), seen.points
    if not len(weight):
        return np.zeros((6 * count, 6 * count))
    by_pose, by_point, by_lens = seen.by_pose, seen.by_point, seen.by_lens
    rows = 6 * seen.image[:, None] + np.arange(6)
    columns = 3 * seen.point[:, None] + np.arange(3)
    lens = np.tile(6 * count + np.arange(2), (len(weight), 1))
    size = 6 * count + 2
    own = np.concatenate([by_pose, by_lens], axis=2)
    places = np.concatenate([rows, lens], axis=1)
    kept = _summed(places, places, np.einsum("mki,mkj,m->mij", own, own, weight), (size, size))
    cross = _summed(places, columns, np.einsum("mki,mkj,m->mij", own, by_point, weight), (size, 3 * points))
    of_points = np.zeros((points, 3, 3))
    np.add.at(of_points, seen.point, np.einsum("mki,mkj,m->mij", by_point, by_point, weight))
    of_points += 1e-13 * np.trace(of_points, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    each = np.arange(3 * points).reshape(-1, 3)
    inverse = _summed(each, each, np.asarray(np.linalg.inv(of_points), np.float64), (3 * points, 3 * points))
    reduced: FloatArray = (kept - cross @ inverse @ cross.T).toarray()
    if not refined:
        return reduced[:-2, :-2]
    reduced[range(size - 2, size), range(size - 2, size)] += _FOCAL_SIGMA**-2
    return reduced


def _summed(rows: IntArray, columns: IntArray, blocks: FloatArray, shape: tuple[int, int]) -> csr_array:
    """The sparse matrix that sums blocks (m, a, b) at rows (m, a) and columns (m, b)."""
    at = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
    return csr_array((blocks.ravel(), (at[0].ravel(), at[1].ravel())), shape=shape)
