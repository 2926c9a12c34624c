"""Fine alignment of two clouds that are nearly in the same frame: iterative closest points (ICP).

small_gicp does the work: it is small, built for one thread as well as many, and its generalised ICP (Segal et al.
2009) weighs each pair by the local shape on both sides, which suits leaves and stems better than planes alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.clouds.cells import voxel_thin
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.metrics import ReferenceIndex
from fieldkit.clouds.neighbors import PointIndex
from fieldkit.clouds.volume import Volume, crop
from fieldkit.errors import EmptyCloudError
from fieldkit.geometry import Similarity
from fieldkit.geometry.pose import rotation_angle_deg, rotation_from_vector

REFERENCE_REACH_M = 0.05
"""From how far a plot's cloud, placed by its photographs' positions, is moved onto the plot's reference."""
_LEVELS = 3
"""Number of levels, each with half the reach of the one before."""
_SHAPE_NEIGHBORS = 12
"""Number of neighbours that a point's normal and covariance are taken from."""
_ITERATIONS = 60
"""Most iterations of a level, after which it counts as not converged."""
_LEAST_PAIRS = 10
"""Least number of paired points; of fewer no motion is taken."""
_MOST_POINTS = 600_000
"""Of the thinned target: more align no better, and each takes some 400 bytes of memory."""
_SCALE_ROUNDS = 40
"""Most steps of a fit with scale, after which it counts as not converged."""
_SCALE_SETTLED = 5e-5
"""Change of the scale below which a fit has settled, as a share: 0.1 mm over 2 m."""
_MAX_SCALE_STEP = 0.2
"""Largest change of the scale in a step, as a share; a larger one is a failure."""
_OVERLAP = 0.5
"""Least share of points with a partner within reach for a motion to fit."""
_NO_WORSE = 1.05
"""Most by which the distance may grow for a motion to fit, as a factor."""


@dataclass(frozen=True)
class AlignmentStats:
    """How an alignment went and how large its correction is."""

    converged: bool
    """The last and finest level settled before it ran out of iterations. Over leaves that swayed it wanders about the
    right place: `fits` says whether that was found."""
    overlap: float
    """Share of the source's points that end up within ``pair_distance_m`` of the target."""
    before_m: float
    """Mean distance of the source's points to the target before it, each at most ``max_distance_m``."""
    after_m: float
    """The same after it."""
    rms_m: float
    """Root mean square distance of those points to their nearest neighbours, NaN where there are none."""
    pair_distance_m: float
    """The largest distance of a pair at the finest level."""
    shift_m: float
    """How far the correction moves the source's centroid."""
    rotation_deg: float
    """The angle it turns by."""
    scale: float
    """The factor it scales by, 1 unless asked for."""

    @property
    def fits(self) -> bool:
        """Whether half of the source ends up at the target, and the source no farther from it than before."""
        return self.overlap >= _OVERLAP and self.after_m <= _NO_WORSE * self.before_m


def icp(
    source: Cloud, target: Cloud | ReferenceIndex, *, max_distance_m: float = 0.02, with_scale: bool = False
) -> tuple[Similarity, AlignmentStats]:
    """Align ``source`` to ``target``, which it should already match to within ``max_distance_m``.

    Coarse to fine: pairs up to ``max_distance_m`` apart on clouds thinned to a quarter of that, then half of both,
    twice. A target that has more than 600,000 points then is thinned further, and the source alike. What lies farther
    from the target than the pair distance takes no part, so the clouds may overlap partially.
    One thread; the same input gives the same bits.

    Args:
        source: the cloud to move.
        target: the cloud that stays; a `ReferenceIndex` saves the work of indexing it again.
        max_distance_m: pair distance of the coarsest level: more than the misalignment, less than the gaps between
            leaves.
        with_scale: estimate a scale too, by point-to-plane ICP with seven unknowns after each level's rigid one. Only
            where the source's scale is in doubt: thin plants determine it poorly.

    Returns:
        The transform from the source's frame to the target's, and how it went. Where fewer than 10 points of the
        source come within reach of the target, that is the identity with ``converged`` false.
    """
    for name, cloud in (("source", source), ("target", target)):
        if not len(cloud):
            raise EmptyCloudError(f"the {name} cloud has no points to align", remedy="Check the volume of interest.")
    kept = target if isinstance(target, ReferenceIndex) else ReferenceIndex(target)
    # Around the target's middle rotations and translations are nearly independent and coordinates are small.
    middle = kept.cloud.points.mean(axis=0)
    fixed, moving = Cloud(kept.cloud.points), Cloud(source.points)
    transform = Similarity(1.0, np.eye(3), -middle)
    converged = False
    distance = max_distance_m
    for level in range(_LEVELS):
        distance = max_distance_m / 2**level
        edge = distance / 4
        while len(coarse_fixed := voxel_thin(fixed, edge, origin=middle)) > _MOST_POINTS:
            edge *= max(1.05, np.sqrt(len(coarse_fixed) / _MOST_POINTS))  # leaves' cells go by the square
        coarse_moving = voxel_thin(moving, edge)
        transform, converged = _align_level(coarse_moving.points, coarse_fixed.points, transform, distance, with_scale)
    result = Similarity(1.0, np.eye(3), middle).after(transform)
    before, _ = kept.index.nearest(source.points)
    distances, _ = kept.index.nearest(result.apply(source.points))
    paired = distances[distances <= distance]
    centroid = source.points.mean(axis=0)
    return result, AlignmentStats(
        converged=converged,
        overlap=len(paired) / len(distances),
        before_m=float(np.minimum(before, max_distance_m).mean()),
        after_m=float(np.minimum(distances, max_distance_m).mean()),
        rms_m=float(np.sqrt(np.mean(paired**2))) if len(paired) else float("nan"),
        pair_distance_m=distance,
        shift_m=float(np.linalg.norm(result.apply(centroid) - centroid)),
        rotation_deg=rotation_angle_deg(result.rotation, np.eye(3)),
        scale=result.scale,
    )


def icp_onto_reference(
    cloud: Cloud, reference: Cloud | ReferenceIndex, *, with_scale: bool = False
) -> tuple[Similarity, AlignmentStats]:
    """`icp` of a plot's cloud, placed by its photographs' positions, onto the plot's reference: within 5 cm.

    Only what of the cloud lies within that of the reference's box takes part. A scale that does not settle is left out,
    since noise shrinks clouds. Where the motion does not fit (`AlignmentStats.fits`) it is the identity.
    """
    kept = reference if isinstance(reference, ReferenceIndex) else ReferenceIndex(reference)
    near = crop(cloud, Volume.around(kept.cloud.points, margin_m=REFERENCE_REACH_M)) if len(kept.cloud) else cloud
    near = near if len(near) else cloud
    motion, stats = icp(near, kept, max_distance_m=REFERENCE_REACH_M, with_scale=with_scale)
    if with_scale and not (stats.converged and stats.fits):
        motion, stats = icp(near, kept, max_distance_m=REFERENCE_REACH_M)
    return motion if stats.fits else Similarity.identity(), stats


def _align_level(
    source: FloatArray, target: FloatArray, transform: Similarity, distance: float, with_scale: bool
) -> tuple[Similarity, bool]:
    shape = _TargetShape(target)
    transform, converged = shape.align(source, transform, distance)
    if not (with_scale and converged):
        return transform, converged
    index, normals = PointIndex(target), shape.normals()
    for _ in range(_SCALE_ROUNDS):
        step = _scaling_step(transform.apply(source), target, normals, index, distance)
        if step is None:
            return transform, False
        transform = step.after(transform)
        if abs(step.scale - 1.0) < _SCALE_SETTLED:
            return shape.align(source, transform, distance)
    return transform, False


class _TargetShape:
    """A target with its tree and local covariances, to align several times to."""

    def __init__(self, points: FloatArray) -> None:
        import small_gicp

        self._gicp = small_gicp
        self._cloud = small_gicp.PointCloud(points)
        self._tree = small_gicp.KdTree(self._cloud, num_threads=1)
        small_gicp.estimate_normals_covariances(self._cloud, self._tree, num_neighbors=_SHAPE_NEIGHBORS, num_threads=1)

    def normals(self) -> FloatArray:
        """(n, 3) unit normals of the target's points, zero where there are too few neighbours."""
        return np.asarray(self._cloud.normals())[:, :3]

    def align(self, source: FloatArray, transform: Similarity, distance: float) -> tuple[Similarity, bool]:
        """``transform`` refined by a rigid motion; unchanged and False where there is too little within reach."""
        moved = transform.apply(source)
        cloud = self._gicp.PointCloud(moved)
        tree = self._gicp.KdTree(cloud, num_threads=1)
        self._gicp.estimate_covariances(cloud, tree, num_neighbors=_SHAPE_NEIGHBORS, num_threads=1)
        result = self._gicp.align(
            self._cloud,
            cloud,
            self._tree,
            registration_type="GICP",
            max_correspondence_distance=distance,
            num_threads=1,
            max_iterations=_ITERATIONS,
            rotation_epsilon=1e-6,
            translation_epsilon=1e-4 * distance,
        )
        matrix = np.asarray(result.T_target_source)
        if result.num_inliers < _LEAST_PAIRS or not np.isfinite(matrix).all():
            return transform, False
        # The product of many small rotations is a rotation only to rounding: take the nearest one.
        u, _, vt = np.linalg.svd(matrix[:3, :3])
        return Similarity(1.0, u @ vt, matrix[:3, 3]).after(transform), bool(result.converged)


def _scaling_step(
    moved: FloatArray,
    target: FloatArray,
    normals: FloatArray,
    index: PointIndex,
    distance: float,
) -> Similarity | None:
    """One Gauss-Newton step of point-to-plane ICP (Chen and Medioni 1992) with a scale as seventh unknown."""
    distances, nearest = index.nearest(moved)
    # Where only one cloud goes on, its points pair with the other's edge and pull at the scale. Such pairs are longer
    # than most and not mutual.
    mutual = PointIndex(moved).nearest(target)[1][nearest] == np.arange(len(moved))
    paired = mutual & (distances <= min(distance, 3.0 * float(np.median(distances))))
    if paired.sum() < _LEAST_PAIRS:
        return None
    p, q, n = moved[paired], target[nearest[paired]], normals[nearest[paired]]
    middle = p.mean(axis=0)
    local = p - middle
    # n · (p + ω × p + t + σ p − q) = 0, linear in ω, t and σ.
    jacobian = np.column_stack([np.cross(local, n), n, np.einsum("ij,ij->i", local, n)])
    residual = np.einsum("ij,ij->i", n, q - p)
    # Cauchy weights: noise and pairs across a leaf's edge count less.
    weight = 1.0 / (1.0 + (residual / max(float(np.median(np.abs(residual))), 1e-12)) ** 2)
    weighted = jacobian * weight[:, None]
    normal_matrix = jacobian.T @ weighted
    if np.linalg.matrix_rank(normal_matrix) < 7:
        return None
    solution = np.linalg.solve(normal_matrix, weighted.T @ residual)
    if not -_MAX_SCALE_STEP < solution[6] < _MAX_SCALE_STEP:
        return None
    about_middle = Similarity(1.0 + float(solution[6]), rotation_from_vector(solution[:3]), solution[3:6])
    back = Similarity(1.0, np.eye(3), middle)
    return back.after(about_middle).after(back.inverse())
