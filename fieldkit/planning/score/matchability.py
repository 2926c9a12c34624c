"""Expected matches of pairs of views, and how firmly they hold a set of cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dtrtrs

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.geometry.similarity import similarity_motion
from fieldkit.runtime.kernels import fast_kernel
from fieldkit.vocabulary import BY_CHANCE, FREE_RAD

_OCTAVES = 0.5
"""Standard deviation of the ratio of scales at which features match, octaves."""


@dataclass(frozen=True)
class Matchability:
    """Expected matches of two views: matches · exp(−angle / decay).

    The default is the least-squares fit of log(1 + matches) to the medians of tuning-1 to tuning-5 in
    sim/README.md ("How realistic"): 309, 204, 104, 40, 16 and 9 matches at 6, 12, 18, 27, 36 and 48°. Of
    these 5 are chance matches at any angle and are left out here.
    """

    matches: float = 662.0
    """Of two views at the same angle."""
    decay_deg: float = 9.13
    """Angle at which 1/e of them is left."""

    def expected(self, angle_deg: ArrayLike) -> FloatArray:
        """Expected matches, of the angles' shape."""
        found: FloatArray = self.matches * np.exp(-np.asarray(angle_deg, dtype=np.float64) / self.decay_deg)
        return found


GUIDED = Matchability(1600.0, 25.0)
"""Of prior mapping, of views that show nothing but soil squarely from above: it matches soil as seen from above. Fitted
to the pairs of 40 sets about tuning-1 and tuning-2 in wind, at draft (docs/decisions.md)."""


def view_angles_deg(positions: FloatArray, center: FloatArray) -> FloatArray:
    """(n, n) angles between the directions from a plot's middle (3,) to cameras (n, 3), degrees."""
    direction = positions - center
    direction = direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
    angles: FloatArray = np.degrees(np.arccos(np.clip(direction @ direction.T, -1.0, 1.0)))
    return angles


def expected_matches(
    positions: FloatArray, center: FloatArray, shared: FloatArray, matchability: Matchability
) -> FloatArray:
    """(n, n) expected matches of each pair of views, symmetric, 0 on the diagonal.

    Matches at the pair's angle about the plot, times what their pictures share, times exp(−½ (o / 0.5)²) for o octaves
    between their distances: mapping takes no match beyond 0.75 (docs/mapping.md). ``shared`` (n, n) is the share that
    each pair's pictures have in common.
    """
    octave = np.log2(np.maximum(np.linalg.norm(positions - center, axis=1), 1e-9))
    scale = np.exp(-0.5 * ((octave[:, None] - octave[None]) / _OCTAVES) ** 2)
    found = matchability.expected(view_angles_deg(positions, center)) * shared * scale
    np.fill_diagonal(found, 0.0)
    symmetric: FloatArray = found
    return symmetric


def overlap(pictured: BoolArray) -> FloatArray:
    """(n, n) points of the plot in both pictures over those in the one with more; (n, t) says which are in each."""
    inside = pictured.astype(np.float64)
    count = inside.sum(axis=1)
    shared: FloatArray = inside @ inside.T / np.maximum(np.maximum(count[:, None], count[None]), 1.0)
    return shared


def camera_sigmas_m(
    positions: FloatArray,
    points: FloatArray,
    seen: FloatArray,
    variance: FloatArray,
    matches: FloatArray,
    prior_m: float,
) -> FloatArray:
    """(n,) standard deviation of each camera's centre against the others that prior mapping is expected to leave.

    It foretells `reconstruction.mapping.uncertainty`. A pair's matches lie on points that both views show, and say how
    far apart the two rays pass. Centres are known with ``prior_m``, rotations are free. The similarity that all centres
    have in common is the frame's and is taken off.

    Args:
        points: (t, 3) of the plot.
        seen: (n, t) how well each view shows them.
        variance: (n, t) of a ray beside a point, m².
        matches: (n, n) of pairs; those that a wrong relative pose has by chance, too, say nothing.
    """
    count, arms = 3 * len(positions), points - positions[:, None]
    shared = np.maximum(matches - BY_CHANCE, 0.0) / np.maximum(seen @ seen.T, 1e-12)
    each = shared[:, :, None] * seen[:, None] * seen
    normal = _information(arms, each / (variance[:, None] + variance)).reshape(2 * count, 2 * count)
    normal.flat[:: 2 * count + 1] += np.repeat([FREE_RAD**-2, prior_m**-2], count)
    # Rotations come first: of Cholesky's factor the centres' block is that of the centres' own information.
    half = np.linalg.cholesky(normal)[count:, count:]
    motion = similarity_motion(positions - positions.mean(axis=0)).swapaxes(0, 1).reshape(-1, 7)
    own = np.eye(count) - motion @ np.linalg.solve(motion.T @ motion + 1e-9 * np.eye(7), motion.T)
    sigmas: FloatArray = np.sqrt((dtrtrs(half, own, lower=True)[0] ** 2).sum(axis=0).reshape(3, -1).sum(axis=0))
    return sigmas


@fast_kernel
def _information(arms, weight):  # type: ignore[no-untyped-def]
    """(6, n, 6, n) information of cameras' rotations, radians, and centres from how far apart rays pass.

    Takes the arms (n, t, 3) from cameras to points, and what each pair's rays weigh there (n, n, t), 1/m².
    """
    count, points = arms.shape[:2]
    found, rows = np.zeros((6, count, 6, count)), np.empty((2, 6, points))
    for i in range(count):
        for j in range(i):
            for k in range(points):
                (ax, ay, az), (bx, by, bz) = arms[i, k], arms[j, k]
                x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
                size = np.sqrt(weight[i, j, k] / max(x * x + y * y + z * z, 1e-18))
                x, y, z = size * x, size * y, size * z
                one, other = rows[0, :, k], rows[1, :, k]
                one[0], one[1], one[2] = ay * z - az * y, az * x - ax * z, ax * y - ay * x
                other[0], other[1], other[2] = bz * y - by * z, bx * z - bz * x, by * x - bx * y
                one[3], one[4], one[5], other[3], other[4], other[5] = x, y, z, -x, -y, -z
            for a in range(6):
                for b in range(6):
                    first, second, both = 0.0, 0.0, 0.0
                    for k in range(points):
                        first += rows[0, a, k] * rows[0, b, k]
                        second += rows[1, a, k] * rows[1, b, k]
                        both += rows[0, a, k] * rows[1, b, k]
                    found[a, i, b, i] += first
                    found[a, j, b, j] += second
                    found[a, i, b, j] = found[b, j, a, i] = both
    return found


def connectivity(matches: FloatArray) -> float:
    """Algebraic connectivity of a view graph: the second smallest eigenvalue of its Laplacian, in matches.

    It is small if any two groups of views have few matches between them, and 0 if they have none (Fiedler, "Algebraic
    connectivity of graphs", 1973). A view tied by one strong pair is less well connected than one tied by several:
    incremental mapping needs points that two views have triangulated. ``matches`` (n, n) are symmetric, of pairs of at
    least two views.
    """
    return max(0.0, float(np.linalg.eigvalsh(np.diag(matches.sum(axis=1)) - matches)[1]))
