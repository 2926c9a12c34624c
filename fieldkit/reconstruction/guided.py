"""Guided matching: what two rough poses say about which features can match, used before and after the descriptors.

Before: only features within a band about the prior's epipolar lines are compared, so the ratio test has few
competitors and keeps matches that blind matching loses at wide baselines. After: a match must agree with the poses
in the rotation and the scale of its two features and, once poses are good, meet in front of both cameras inside the
region of interest. A band alone admits many matches by chance; these checks remove nine in ten of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, ByteArray, FloatArray, IntArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import cross_matrix
from fieldkit.reconstruction.features import Features
from fieldkit.runtime.kernels import kernel

_STRIP_PX = 64.0
"""Width of the strips that features are sorted into, pixels."""
_CELL_PX = 4.0
"""Height of the cells of a strip, pixels."""

_CONVERGING_DEG = 25.0
"""Angle from an optical axis within which a place is in the middle of the picture, degrees."""
_CONVERGING_SHARE = 0.8
"""Least share of converging cameras that have the place they look at there."""


@dataclass(frozen=True)
class Region:
    """The sphere that holds what the cameras look at: centre (3,), radius; metres in the priors' frame."""

    center: tuple[float, float, float]
    radius: float

    def contains(self, points: FloatArray) -> BoolArray:
        """(k,) for points (k, 3)."""
        inside: BoolArray = np.linalg.norm(points - np.array(self.center), axis=1) <= self.radius
        return inside


def region_of_interest(poses: Sequence[Pose]) -> Region | None:
    """The sphere about the point nearest to all optical axes; None where they are nearly parallel or do not converge.

    Most photographs of a flight over a field do not show its middle, in whatever direction they look.
    """
    normal = sum((np.eye(3) - np.outer(p.forward, p.forward) for p in poses), np.zeros((3, 3)))
    if len(poses) < 2 or np.linalg.eigvalsh(normal)[0] < 0.02 * len(poses):
        return None
    right = sum(((np.eye(3) - np.outer(p.forward, p.forward)) @ p.center for p in poses), np.zeros(3))
    center = np.linalg.solve(normal, right)
    distances = [float(np.linalg.norm(p.center - center)) for p in poses]
    shown = np.cos(np.radians(_CONVERGING_DEG)) * np.array(distances)
    if np.mean([(center - p.center) @ p.forward for p in poses] >= shown) < _CONVERGING_SHARE:
        return None
    return Region((float(center[0]), float(center[1]), float(center[2])), 0.8 * float(np.median(distances)))


@dataclass(frozen=True)
class Slab:
    """The heights between which a survey's scene lies: along ``up`` (3,), from ``low`` to ``high``, metres."""

    up: tuple[float, float, float]
    low: float
    high: float

    def contains(self, points: FloatArray) -> BoolArray:
        """(k,) for points (k, 3)."""
        height = points @ np.array(self.up)
        inside: BoolArray = (height >= self.low) & (height <= self.high)
        return inside


@dataclass(frozen=True)
class GuidedSettings:
    """How a match is accepted."""

    ratio: float = 0.85
    """Largest ratio of the best to the second best descriptor distance among the band's candidates."""
    max_rotation_deg: float = 35.0
    """Largest disagreement of the two features' orientations once each is measured against the image of the
    baseline's direction. Right matches 18–36° apart stay within 16° in the median."""
    max_scale_octaves: float = 0.75
    """Largest disagreement of the features' sizes, log2, after the cameras' distance to the region's centre is
    taken out. 95 % of right matches stay within 0.43."""


@dataclass(frozen=True)
class Band:
    """Where matches of two posed photographs are looked for."""

    px: float
    """Largest distance to either epipolar line, pixels."""
    region: Region | None = None
    """What the cameras look at, to predict the features' scale; None takes equal distances."""
    scene_bounds: Region | Slab | None = None
    """Where matches must triangulate, in front of both cameras; None asks nothing, which is what rough poses need (rays
    need not meet where the plant is)."""
    rule: GuidedSettings = GuidedSettings()
    """How a match is accepted."""


@dataclass(frozen=True, eq=False)
class IndexedFeatures:
    """The features of one photograph, undistorted and sorted for looking up; whatever its pose, so made once."""

    features: Features
    points: FloatArray
    """(n, 2) undistorted pixels."""
    camera: Intrinsics
    """PINHOLE intrinsics."""

    @classmethod
    def of(cls, features: Features, camera: Intrinsics) -> IndexedFeatures:
        return cls(features, camera.undistort(features.points), camera.without_distortion())

    @cached_property
    def parts(self) -> tuple[IndexedFeatures, ...]:
        """The photograph's own features, learned ones, and those of the ground."""
        return tuple(
            IndexedFeatures(self.features.subset(part), self.points[part], self.camera) for part in self.features.parts
        )

    @cached_property
    def across(self) -> _Strips:
        """Strips that lines nearer to level cross."""
        return _Strips.of(self.points, self.features)

    @cached_property
    def down(self) -> _Strips:
        """Strips, x and y exchanged, that steeper lines cross."""
        return _Strips.of(self.points[:, ::-1], self.features)


@dataclass(frozen=True, eq=False)
class PosedFeatures:
    """The features of one photograph with its prior or current pose."""

    indexed: IndexedFeatures
    pose: Pose

    @property
    def features(self) -> Features:
        return self.indexed.features

    @property
    def points(self) -> FloatArray:
        """(n, 2) undistorted pixels."""
        return self.indexed.points

    @property
    def camera(self) -> Intrinsics:
        """PINHOLE intrinsics."""
        return self.indexed.camera

    def rays(self, index: NDArray[np.integer]) -> FloatArray:
        """(k, 3) unit viewing rays of chosen features in the world."""
        pixels = self.points[index]
        focal, principal = (self.camera.fx, self.camera.fy), (self.camera.cx, self.camera.cy)
        rays = homogeneous((pixels - principal) / focal) @ self.pose.rotation
        unit: FloatArray = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return unit


def relative_pose(a: Pose, b: Pose) -> tuple[FloatArray, FloatArray]:
    """Rotation (3, 3) and translation (3,) of camera b from camera a."""
    return b.rotation @ a.rotation.T, b.rotation @ (a.center - b.center)


def fundamental_matrix(a: Pose, b: Pose, camera_a: Intrinsics, camera_b: Intrinsics) -> FloatArray:
    """(3, 3) F with x_bᵀ F x_a = 0 for undistorted pixels (Hartley & Zisserman, eq. 9.2)."""
    rotation, t = relative_pose(a, b)
    essential = cross_matrix(t) @ rotation
    fundamental: FloatArray = np.linalg.inv(camera_b.matrix()).T @ essential @ np.linalg.inv(camera_a.matrix())
    return fundamental


def homogeneous(points: FloatArray) -> FloatArray:
    """Floats (n, d) with a 1 behind their coordinates, (n, d + 1)."""
    return np.concatenate([points, np.ones((len(points), 1))], axis=1)


def epipolar_distance(fundamental: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """(n,) the larger of the two point-to-epipolar-line distances of pairs a, b (n, 2), pixels."""
    ha, hb = homogeneous(a), homogeneous(b)
    in_b, in_a = ha @ fundamental.T, hb @ fundamental
    residual = np.abs((hb * in_b).sum(axis=1))
    lengths = np.minimum(np.hypot(in_b[:, 0], in_b[:, 1]), np.hypot(in_a[:, 0], in_a[:, 1]))
    distance: FloatArray = residual / np.maximum(lengths, 1e-12)
    return distance


def epipolar_distances(a: PosedFeatures, b: PosedFeatures, matches: NDArray[np.uint32]) -> FloatArray:
    """(k,) `epipolar_distance` of matches (k, 2) at the photographs' poses, pixels."""
    fundamental = fundamental_matrix(a.pose, b.pose, a.camera, b.camera)
    return epipolar_distance(fundamental, a.points[matches[:, 0]], b.points[matches[:, 1]])


def match_guided(a: PosedFeatures, b: PosedFeatures, band: Band, *, shift_px: float = 0.0) -> NDArray[np.uint32]:
    """Mutual best matches within a band about the epipolar lines of two poses, in agreement with the poses.

    ``shift_px`` displaces image b across its epipolar lines; the matches that remain are chance. Gives (k, 2) feature
    indices, sorted by the first.
    """
    found, before = [np.zeros((0, 2), np.int64)], np.zeros(2, np.int64)
    for part_a, part_b in zip(a.indexed.parts, b.indexed.parts, strict=True):
        if len(part_a.features) and len(part_b.features):
            matches = _match_alike(PosedFeatures(part_a, a.pose), PosedFeatures(part_b, b.pose), band, shift_px)
            found.append(matches + before)
        before += (len(part_a.features), len(part_b.features))
    return np.concatenate(found).astype(np.uint32)


def _match_alike(a: PosedFeatures, b: PosedFeatures, band: Band, shift_px: float) -> IntArray:
    """`match_guided` among features of one kind; at least one of each."""
    fundamental = fundamental_matrix(a.pose, b.pose, a.camera, b.camera)
    lines_in_b = _unit_lines(homogeneous(a.points) @ fundamental.T)
    shift = shift_px * _mean_normal(lines_in_b) if shift_px else np.zeros(2)
    if a.features.partners is not None:
        matches = a.features.partners_in(b.features)
        off = epipolar_distance(fundamental, a.points[matches[:, 0]], b.points[matches[:, 1]] + shift)
        matches = matches[off <= band.px]
        return matches[_in_bounds(a, b, matches, band)]
    lines_in_a = _unit_lines(homogeneous(b.points + shift) @ fundamental)
    rows, columns = _best_in_band(a, b, shift, lines_in_b, lines_in_a, band.px, band.rule.ratio)
    first = np.flatnonzero(rows >= 0)
    mutual = first[columns[rows[first]] == first]
    matches = np.stack([mutual, rows[mutual]], axis=1)
    return matches[_agrees(a, b, matches, band)]


def midpoints(
    a: PosedFeatures, b: PosedFeatures, matches: NDArray[np.integer]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where the rays of matches come closest: points (k, 3) and the signed distances (k,) along both rays."""
    ray_a, ray_b = a.rays(matches[:, 0]), b.rays(matches[:, 1])
    baseline = b.pose.center - a.pose.center
    cosine = (ray_a * ray_b).sum(axis=1)
    denominator = np.maximum(1.0 - cosine**2, 1e-12)
    along_a, along_b = ray_a @ baseline, ray_b @ baseline
    s = (along_a - along_b * cosine) / denominator
    t = (along_a * cosine - along_b) / denominator
    points = 0.5 * (a.pose.center + s[:, None] * ray_a + b.pose.center + t[:, None] * ray_b)
    return points, s, t


def _agrees(a: PosedFeatures, b: PosedFeatures, matches: IntArray, band: Band) -> BoolArray:
    of_a, of_b = a.features.keypoints[matches[:, 0]], b.features.keypoints[matches[:, 1]]
    octaves = np.log2(of_a[:, 2]) - np.log2(of_b[:, 2])
    if a.features.ground:
        difference = of_a[:, 3] - of_b[:, 3]
        octaves += np.log2(_above(a, band.region)) - np.log2(_above(b, band.region))
    else:
        difference = _turn_from_baseline(a, b, matches[:, 0]) - _turn_from_baseline(b, a, matches[:, 1], reverse=True)
        octaves += np.log2(_metres_per_pixel(a, band.region)) - np.log2(_metres_per_pixel(b, band.region))
    rotation = np.abs((difference + np.pi) % (2 * np.pi) - np.pi)
    rule = band.rule
    good = (rotation <= np.radians(rule.max_rotation_deg)) & (np.abs(octaves) <= rule.max_scale_octaves)
    agreed: BoolArray = good & _in_bounds(a, b, matches, band)
    return agreed


def _in_bounds(a: PosedFeatures, b: PosedFeatures, matches: IntArray, band: Band) -> BoolArray:
    if band.scene_bounds is None:
        return np.ones(len(matches), np.bool_)
    points, s, t = midpoints(a, b, matches)
    return band.scene_bounds.contains(points) & (s > 0) & (t > 0)


def _turn_from_baseline(
    a: PosedFeatures, b: PosedFeatures, index: NDArray[np.integer], *, reverse: bool = False
) -> FloatArray:
    """(k,) chosen features' orientation against the image of the baseline's direction at its place, radians.

    Moving a scene point by ε·v moves its pixel x by ε/Z · (q[:2] − q[2] x) with q = K R v; with v along the
    baseline this is the epipolar line's direction, with a sign that both images share.
    """
    baseline = b.pose.center - a.pose.center
    q = a.camera.matrix() @ a.pose.rotation @ (-baseline if reverse else baseline)
    direction = q[:2] - q[2] * a.points[index]
    turn: FloatArray = a.features.keypoints[index, 3] - np.arctan2(direction[:, 1], direction[:, 0])
    return turn


def _metres_per_pixel(a: PosedFeatures, region: Region | None) -> float:
    distance = 1.0
    if region is not None:
        distance = float(np.linalg.norm(np.array(region.center) - a.pose.center))
    return distance / a.camera.fx


def _above(a: PosedFeatures, region: Region | None) -> float:
    """Height of a camera above what it looks at, metres, at least a tenth of its distance."""
    if region is None:
        return 1.0
    away = a.pose.center - np.array(region.center)
    return max(float(away[2]), 0.1 * float(np.linalg.norm(away)))


def _unit_lines(lines: FloatArray) -> FloatArray:
    unit: FloatArray = lines / np.maximum(np.hypot(lines[:, 0], lines[:, 1]), 1e-12)[:, None]
    return unit


def _mean_normal(lines: FloatArray) -> FloatArray:
    """(2,) the direction most across unit lines (n, 3), whatever their signs."""
    normals = lines[:, :2]
    direction: FloatArray = np.linalg.eigh(normals.T @ normals)[1][:, 1]
    return direction


def _best_in_band(
    a: PosedFeatures,
    b: PosedFeatures,
    shift: FloatArray,
    lines_in_b: FloatArray,
    lines_in_a: FloatArray,
    band_px: float,
    ratio: float,
) -> tuple[IntArray, IntArray]:
    """Per feature of either image, the best partner within the band that passes the ratio test, else −1."""
    of_a, of_b = _Best.none(len(a.features)), _Best.none(len(b.features))
    level = np.abs(lines_in_b[:, 1]) >= np.abs(lines_in_b[:, 0])
    for chosen, axes, strips in ((level, [0, 1], b.indexed.across), (~level, [1, 0], b.indexed.down)):
        if chosen.any():
            moved, line = shift[axes], [*axes, 2]
            lined = _Lined(a.points[:, axes], lines_in_b[:, line], a.features.descriptors, a.features.squares)
            placed = strips._replace(corner=strips.corner + moved, points=strips.points + moved)
            _compare(np.flatnonzero(chosen), lined, placed, lines_in_a[strips.order][:, line], band_px, of_a, of_b)
    return of_a.passing(ratio), of_b.passing(ratio)


class _Lined(NamedTuple):
    """Features with their epipolar lines (n, 3) in the other image."""

    points: FloatArray
    lines: FloatArray
    descriptors: ByteArray
    squares: NDArray[np.int32]


class _Best(NamedTuple):
    """Per feature the squared distances of the best and the second best partner and which the best is; filled in."""

    distance: NDArray[np.int32]
    second: NDArray[np.int32]
    partner: IntArray

    @classmethod
    def none(cls, count: int) -> _Best:
        far = np.iinfo(np.int32).max
        return cls(np.full(count, far, np.int32), np.full(count, far, np.int32), np.full(count, -1, np.int64))

    def passing(self, ratio: float) -> IntArray:
        """(n,) the best partner where it passes the ratio test, else −1."""
        good = (self.distance <= ratio * ratio * self.second) & (self.second > 0)
        return np.where(good, self.partner, -1)


class _Strips(NamedTuple):
    """Features sorted into strips across the first axis, and in each into cells along the second."""

    corner: FloatArray
    """(2,) least coordinates."""
    strips: int
    cells: int
    """How many, and how many cells in each."""
    order: IntArray
    """(n,) the features in this order; `order[starts[k] : starts[k + 1]]` are those of cell k, and those of a
    strip follow one another."""
    starts: IntArray
    """(strips · cells + 1,)."""
    points: FloatArray
    descriptors: ByteArray
    squares: NDArray[np.int32]
    """In this order."""

    @classmethod
    def of(cls, points: FloatArray, features: Features) -> _Strips:
        corner = points.min(axis=0)
        place = np.floor((points - corner) / (_STRIP_PX, _CELL_PX)).astype(np.int64)
        count, cells = place.max(axis=0) + 1
        index = place[:, 0] * cells + place[:, 1]
        order = np.argsort(index, kind="stable")
        starts = np.searchsorted(index[order], np.arange(count * cells + 1))
        descriptors, squares = features.descriptors[order], features.squares[order]
        return cls(corner, int(count), int(cells), order, starts, points[order], descriptors, squares)


@kernel
def _compare(chosen, a, b, lines_in_a, band, of_a, of_b):  # type: ignore[no-untyped-def]
    """Compare the ``chosen`` features of a (`_Lined`), whose lines are flat, with b's (`_Strips`) within the band.

    Those in the band are listed first, without a branch: whether a feature is, no processor can foresee. A squared
    distance is |a|² + |b|² − 2 a·b in whole numbers, for a product takes half the time of a squared difference.
    """
    points_a, lines_in_b, descriptors_a, squares_a = a
    points_b, descriptors_b, squares_b = b.points, b.descriptors, b.squares
    cells, order, starts = b.cells, b.order, b.starts
    left, top = b.corner
    nearest_a, second_a, partner_a = of_a
    nearest_b, second_b, partner_b = of_b
    listed = np.empty(len(points_b), np.int64)
    for i in chosen:
        l0, l1, l2 = lines_in_b[i, 0], lines_in_b[i, 1], lines_in_b[i, 2]
        if l1 == 0.0:
            continue
        x, y = points_a[i, 0], points_a[i, 1]
        margin = band / abs(l1) / _CELL_PX
        enters = -(l0 * left + l2) / l1 / _CELL_PX - top / _CELL_PX
        step = -l0 / l1 * _STRIP_PX / _CELL_PX
        down, up = min(step, 0.0) - margin, max(step, 0.0) + margin
        count = 0
        for strip in range(b.strips):
            at = enters + strip * step
            if at + up < 0.0 or at + down >= cells:
                continue
            low, high = max(int(np.floor(at + down)), 0), min(int(np.floor(at + up)), cells - 1)
            for k in range(starts[strip * cells + low], starts[strip * cells + high + 1]):
                listed[count] = k
                near_b = abs(l0 * points_b[k, 0] + l1 * points_b[k, 1] + l2) <= band
                near_a = abs(lines_in_a[k, 0] * x + lines_in_a[k, 1] * y + lines_in_a[k, 2]) <= band
                count += near_b & near_a
        for n in range(count):
            k = listed[n]
            product = np.int32(0)
            for d in range(128):
                product = np.int32(product + np.int32(np.int32(descriptors_a[i, d]) * np.int32(descriptors_b[k, d])))
            distance = np.int32(squares_a[i] + squares_b[k] - np.int32(2 * product))
            j = order[k]
            if distance < second_a[i]:
                if distance < nearest_a[i]:
                    second_a[i] = nearest_a[i]
                    nearest_a[i] = distance
                    partner_a[i] = j
                else:
                    second_a[i] = distance
            if distance < second_b[j]:
                if distance < nearest_b[j]:
                    second_b[j] = nearest_b[j]
                    nearest_b[j] = distance
                    partner_b[j] = i
                else:
                    second_b[j] = distance
