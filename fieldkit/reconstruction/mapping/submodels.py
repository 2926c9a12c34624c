"""Sub-models that no verified pair ties together, and how they fit one another.

Between two sub-models no single pair may have matches enough for a relative pose of its own, while all pairs across
have them together. A sub-model is good in itself, so that only one similarity is unknown, and the poses known before
say how far it can be off. Candidate matches are looked for in bands as wide as that; the similarity is the one that
most of them agree with, found from many starts by least squares under a robust loss whose scale falls (graduated
non-convexity), and believed where as many matches without meaning would agree with none so well.

Bundle adjustment with known positions only leaves a sub-model that stands on an arc free to roll by ten degrees: in
bands of pixels the other's features are then out of reach.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.geometry import Pose
from fieldkit.geometry.pose import cross_matrix
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.guided import Band, PosedFeatures, Region, match_guided
from fieldkit.reconstruction.mapping.view_graph import Pair

_COARSE_PX = (24.0, 16.0, 16.0)
"""Scales of the loss of the steps from all starts, pixels."""
_FINE_PX = (8.0, 8.0, 4.0, 4.0, 2.0, 2.0)
"""Scales of the loss of the steps from the best starts, pixels."""
_NOISE_PX = 2.0
"""Standard deviation of an epipolar distance, pixels."""
_LEAST_WORTH = 0.5
"""Least logarithm by which a match that agrees speaks for a motion."""
_WIDTH_PX = 1600.0
"""Width of the photograph that pixels here are of."""
_PLACING_STEPS = 4
"""Number of Gauss-Newton steps that place a sub-model."""
_WITHIN_PX = 4.0
"""Largest epipolar distance of a match that agrees with a motion, pixels."""
_STARTS = 400
"""Number of starts of the search for a motion."""
_REFINED = 32
"""Number of starts that are followed to the end."""
_BAND_SIGMAS = 2.5
"""Half width of the bands, in standard deviations of what is unknown."""
_NULL_FACTOR = 1.5
"""Least ratio of a motion's inliers to those of randomised matches."""
_SCALE_SIGMA = 0.1  # of what the positions of one or two cameras leave open


@dataclass(frozen=True, eq=False)
class Placed:
    """A sub-model where its known poses want it."""

    poses: list[Pose]
    pivot: FloatArray
    """(3,) mean of its camera centres."""
    covariance: FloatArray
    """(7, 7) of its place: rotation vector about the pivot (radians), translation (metres), logarithm of the
    scale."""

    def about(self, pivot: FloatArray) -> FloatArray:
        """The covariance (7, 7) of the same motion, stated about another point (3,)."""
        change = np.eye(7)
        change[3:6, :3] = -cross_matrix(pivot - self.pivot)
        change[3:6, 6] = pivot - self.pivot
        elsewhere: FloatArray = change @ self.covariance @ change.T
        return elsewhere


def moved(pose: Pose, motion: FloatArray, pivot: FloatArray) -> Pose:
    """A pose after a similarity (7,): rotation vector about ``pivot`` (3,), translation, logarithm of the scale."""
    turn = Rotation.from_rotvec(motion[:3]).as_matrix()
    return Pose(pose.rotation @ turn.T, np.exp(motion[6]) * turn @ (pose.center - pivot) + pivot + motion[3:6])


def place_submodel(poses: Sequence[Pose], part: Sequence[int], priors: Sequence[PosePrior]) -> Placed:
    """Where known poses want a sub-model (least squares), and what they leave open.

    ``part`` (m,) says which of the n images of ``priors`` the poses are of.
    """
    pivot = np.mean([pose.center for pose in poses], axis=0)
    motion = np.zeros(7)
    for _ in range(_PLACING_STEPS):
        information = np.diag([*np.zeros(6), _SCALE_SIGMA**-2])
        gradient = information @ -motion
        for k, pose in zip(part, (moved(pose, motion, pivot) for pose in poses), strict=True):
            known, sigma, angle = priors[k].pose, priors[k].position_sigma_m, np.radians(priors[k].angle_sigma_deg)
            arm = pose.center - pivot - motion[3:6]
            moves = np.hstack([-cross_matrix(arm), np.eye(3), arm[:, None]]) / sigma
            turn = Rotation.from_matrix(known.rotation.T @ pose.rotation).as_rotvec()
            information += moves.T @ moves
            information[:3, :3] += np.eye(3) / angle**2
            gradient += moves.T @ ((known.center - pose.center) / sigma)
            gradient[:3] += turn / angle**2
        step = np.linalg.solve(information, gradient)
        turned = Rotation.from_rotvec(step[:3]) * Rotation.from_rotvec(motion[:3])
        motion = np.concatenate([turned.as_rotvec(), motion[3:] + step[3:]])
    placed = [moved(pose, motion, pivot) for pose in poses]
    return Placed(placed, pivot + motion[3:6], np.linalg.inv(information))


@dataclass(frozen=True, eq=False)
class Across:
    """Candidate matches between two sub-models: n pairs of viewing rays, world frame."""

    center: FloatArray
    direction: FloatArray
    """(n, 3) camera centres and unit rays of the sub-model that stays."""
    moved_center: FloatArray
    moved_direction: FloatArray
    """(n, 3) of the one that is moved."""
    focal_px: FloatArray
    """(n,) pixels per radian, of a photograph 1600 pixels wide as all pixels here."""

    def __len__(self) -> int:
        return len(self.focal_px)

    def without_meaning(self, band: float, rng: np.random.Generator) -> Across:
        """The same matches at epipolar distances drawn uniformly from ±``band``, radians."""
        normal = np.cross(self.direction, self.center - self.moved_center)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        along = (self.moved_direction * normal).sum(axis=1)
        offset = rng.uniform(-band, band, len(self))
        turned = self.moved_direction + (offset - along)[:, None] * normal
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        return replace(self, moved_direction=turned)


def best_motion(
    across: Across, pivot: FloatArray, covariance: FloatArray, band: float, rng: np.random.Generator
) -> tuple[FloatArray, BoolArray]:
    """The small similarity about ``pivot`` that is likeliest after what is known and the matches that agree.

    A match that agrees says ln(band / width) more for a motion than one that is anywhere in the band. Gives the motion
    (7,) as `moved` takes it, and which matches agree (n,).

    Args:
        pivot: (3,).
        covariance: (7, 7) of the motion, known before.
        band: half width of what the matches were looked for in, radians.
    """
    motions = rng.multivariate_normal(np.zeros(7), covariance, _STARTS)
    motions[0] = 0.0
    information = np.asarray(np.linalg.inv(covariance), np.float64)
    motions = _refined(across, pivot, motions, information, _COARSE_PX)
    likelihood, _ = _likelihood(across, pivot, motions, information, band, _COARSE_PX[-1])
    motions = motions[np.argsort(-likelihood, kind="stable")[:_REFINED]]
    motions = _refined(across, pivot, motions, information, _FINE_PX)
    likelihood, residual = _likelihood(across, pivot, motions, information, band, _WITHIN_PX)
    best = int(np.argmax(likelihood))
    agrees: BoolArray = np.abs(residual[best]) <= _WITHIN_PX
    return motions[best], agrees


def _refined(
    across: Across, pivot: FloatArray, motions: FloatArray, information: FloatArray, scales_px: Sequence[float]
) -> FloatArray:
    """Motions (s, 7) after a Gauss-Newton step at each scale of a Geman-McClure loss."""
    for scale in scales_px:
        residual, jacobian = epipolar_residuals(across, pivot, motions)
        weighted = jacobian / (_NOISE_PX * (1.0 + (residual / scale) ** 2))[..., None] ** 2
        normal = np.einsum("sni,snj->sij", weighted, jacobian) + information
        gradient = np.einsum("sni,sn->si", weighted, residual) + motions @ information
        try:
            step = np.linalg.solve(normal, gradient[..., None])
        except np.linalg.LinAlgError:  # a start so far off that a camera lies on another's ray
            step = np.linalg.pinv(normal, hermitian=True) @ gradient[..., None]
        motions = motions - step[..., 0]
    return motions


def _likelihood(
    across: Across, pivot: FloatArray, motions: FloatArray, information: FloatArray, band: float, within_px: float
) -> tuple[FloatArray, FloatArray]:
    """(s,) logarithms of motions' (s, 7) likelihoods, up to a constant, and their residuals (s, n)."""
    residual, _ = epipolar_residuals(across, pivot, motions)
    worth = np.maximum(np.log(band * across.focal_px / within_px), _LEAST_WORTH)
    agreeing = np.maximum(0.0, 1.0 - (residual / within_px) ** 2) @ worth
    known = 0.5 * np.einsum("si,ij,sj->s", motions, information, motions)
    return agreeing - known, residual


def epipolar_residuals(across: Across, pivot: FloatArray, motions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Signed epipolar distances (s, n) in pixels after motions (s, 7), and their derivatives (s, n, 7).

    The larger of a match's two distances, as angles. The derivatives hold the epipolar plane's normal at its length.
    """
    turn = Rotation.from_rotvec(motions[:, :3]).as_matrix()
    arm = np.exp(motions[:, 6])[:, None, None] * np.einsum("sij,nj->sni", turn, across.moved_center - pivot)
    ray = np.einsum("sij,nj->sni", turn, across.moved_direction)
    baseline = across.center - (arm + pivot + motions[:, None, 3:6])
    normal = np.cross(across.direction[None], baseline)
    length = np.minimum(np.linalg.norm(normal, axis=2), np.linalg.norm(np.cross(ray, baseline), axis=2))
    factor = across.focal_px / np.maximum(length, 1e-9)
    both = np.cross(ray, across.direction[None])
    turning = np.cross(ray, normal) - np.cross(arm, both)
    growing = -(arm * both).sum(axis=2, keepdims=True)
    jacobian = factor[..., None] * np.concatenate([turning, -both, growing], axis=2)
    return factor * (normal * ray).sum(axis=2), jacobian


@dataclass(frozen=True, eq=False)
class Joined:
    """Sub-models put together."""

    poses: list[Pose]
    """Of all images; every part where the known poses want it."""
    matches: dict[Pair, NDArray[np.uint32]]
    """Across sub-models, by pairs of images: those that agree."""
    parts: list[list[int]]
    """Image indices of each sub-model that is left, the largest first."""


@dataclass(frozen=True, eq=False)
class Joiner:
    """What sub-models of n images are put together by."""

    priors: Sequence[PosePrior]
    """Of the images: positions and orientations."""
    pairs: Collection[Pair]
    """Of images that can see the same."""
    region: Region
    """What the cameras look at."""
    distance_m: float
    """From cameras to it."""
    seed: int
    min_agreeing: int
    """Least number of a motion's inliers."""

    def join(self, images: Sequence[PosedFeatures], parts: Sequence[Sequence[int]]) -> Joined:
        """Put those two sub-models together that fit best, until no two fit.

        ``images`` are n, at poses that are good within each sub-model; ``parts`` the image indices of each.
        """
        images, left = list(images), [sorted(part) for part in parts]
        matches: dict[Pair, NDArray[np.uint32]] = {}
        tried: dict[tuple[tuple[int, ...], tuple[int, ...]], _Fit | None] = {}
        while True:
            left.sort(key=lambda part: (-len(part), part))
            two = [(tuple(still), tuple(other)) for k, other in enumerate(left) for still in left[:k]]
            for key in two:
                if key not in tried:
                    tried[key] = self._fit(images, *key)
            fits = [(key, fit) for key in two if (fit := tried[key]) is not None]
            if not fits:
                break
            (still, other), fit = max(fits, key=lambda each: each[1].margin)
            images = _at(images, fit.poses)
            matches |= fit.matches
            left = [part for part in left if tuple(part) not in (still, other)] + [sorted(still + other)]
        poses = {k: pose for part in left for k, pose in self._place(images, part)[1].items()}
        return Joined([poses[k] for k in range(len(images))], matches, left)

    def _place(self, images: Sequence[PosedFeatures], part: Sequence[int]) -> tuple[Placed, dict[int, Pose]]:
        placed = place_submodel([images[k].pose for k in part], part, self.priors)
        return placed, dict(zip(part, placed.poses, strict=True))

    def _fit(self, images: Sequence[PosedFeatures], still: Sequence[int], other: Sequence[int]) -> _Fit | None:
        (standing, poses), (moving, before) = self._place(images, still), self._place(images, other)
        images = _at(images, poses | before)
        covariance = standing.about(moving.pivot) + moving.covariance
        angle, shift = (np.sqrt(np.linalg.eigvalsh(covariance[k, k])[-1]) for k in (slice(0, 3), slice(3, 6)))
        band = _BAND_SIGMAS * float(np.hypot(angle, shift / self.distance_m))
        found: dict[Pair, NDArray[np.uint32]] = {}
        rays = []
        for i, j in sorted(self.pairs):
            if (i in still and j in other) or (i in other and j in still):
                found[i, j] = match_guided(images[i], images[j], Band(band * images[j].camera.fx, self.region))
                ends = ((i, found[i, j][:, 0]), (j, found[i, j][:, 1]))
                rays.append(_rays(images, *(ends if i in still else ends[::-1])))
        if sum(map(len, found.values())) < self.min_agreeing:
            return None
        across = Across(*(np.concatenate(column) for column in zip(*rays, strict=True)))
        rng = np.random.default_rng((self.seed, *still, len(images), *other))
        motion, agrees = best_motion(across, moving.pivot, covariance, band, rng)
        meaningless = across.without_meaning(band, rng)
        _, by_chance = best_motion(meaningless, moving.pivot, covariance, band, rng)
        margin = float(agrees.sum() / max(1, by_chance.sum()))
        if agrees.sum() < self.min_agreeing or margin < _NULL_FACTOR:
            return None
        own = np.split(agrees, np.cumsum([len(matches) for matches in found.values()])[:-1])
        kept = {pair: found[pair][mask] for pair, mask in zip(found, own, strict=True) if mask.any()}
        return _Fit(poses | {k: moved(pose, motion, moving.pivot) for k, pose in before.items()}, kept, margin)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Two sub-models as one: poses, the matches that agree, and how many times those by chance they are."""

    poses: Mapping[int, Pose]
    matches: dict[Pair, NDArray[np.uint32]]
    margin: float


def _at(images: Sequence[PosedFeatures], poses: Mapping[int, Pose]) -> list[PosedFeatures]:
    return [replace(image, pose=poses[k]) if k in poses else image for k, image in enumerate(images)]


def _rays(
    images: Sequence[PosedFeatures], still: tuple[int, NDArray[np.uint32]], other: tuple[int, NDArray[np.uint32]]
) -> tuple[FloatArray, ...]:
    """The columns of `Across` for the matched features of two images."""
    columns: list[FloatArray] = []
    for k, index in (still, other):
        columns += [np.tile(images[k].pose.center, (len(index), 1)), images[k].rays(index)]
    camera = images[other[0]].camera
    return (*columns, np.full(len(other[1]), camera.fx * _WIDTH_PX / camera.width))
