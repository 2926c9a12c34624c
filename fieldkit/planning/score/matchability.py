"""Expected matches of pairs of views, and how firmly they tie a set of cameras together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.planning.problem import POSE_NOISE_M
from fieldkit.planning.space.cameras import Array

MATCH_M = 0.010
"""Standard deviation of two cameras' relative position by a single match. A pixel at 1.5 m is about 1.1 mm in a picture
1600 wide, and turning a camera compensates about nine tenths of a move in a small plot.
"""
_OCTAVES = 0.5


@dataclass(frozen=True)
class Matchability:
    """Expected matches of two views: matches · exp(−angle / decay).

    The default is the least-squares fit of log(1 + matches) to the medians of tuning-1 to tuning-5 in
    docs/simulated-scenes.md ("How realistic"): 309, 204, 104, 40, 16 and 9 matches at 6, 12, 18, 27, 36 and 48°. Of
    these 5 are chance matches at any angle and are left out here.
    """

    matches: float = 662.0
    """Of two views at the same angle."""
    decay_deg: float = 9.13
    """Angle at which 1/e of them is left."""

    def expected(self, angle_deg: ArrayLike) -> Array:
        """Expected matches, of the angles' shape."""
        found: Array = self.matches * np.exp(-np.asarray(angle_deg, dtype=np.float64) / self.decay_deg)
        return found


def view_angles_deg(positions: Array, center: Array) -> Array:
    """(n, n) angles between the directions from a plot's middle (3,) to cameras (n, 3), degrees."""
    direction = positions - center
    direction = direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
    angles: Array = np.degrees(np.arccos(np.clip(direction @ direction.T, -1.0, 1.0)))
    return angles


def expected_matches(
    positions: Array, center: Array, pictured: NDArray[np.bool_], matchability: Matchability
) -> Array:  # fmt: skip
    """(n, n) expected matches of each pair of views, symmetric, 0 on the diagonal.

    Matches at the pair's angle about the plot, times the pictures' overlap (points in both over those of the one with
    more), times exp(−½ (o / 0.5)²) for o octaves between their distances: mapping takes no match beyond 0.75
    (docs/mapping.md).

    Args:
        pictured: (n, t) whether points of the plot, ground included, lie in each picture.
    """
    inside = pictured.astype(np.float64)
    count = inside.sum(axis=1)
    shared = inside @ inside.T / np.maximum(np.maximum(count[:, None], count[None]), 1.0)
    octave = np.log2(np.maximum(np.linalg.norm(positions - center, axis=1), 1e-9))
    scale = np.exp(-0.5 * ((octave[:, None] - octave[None]) / _OCTAVES) ** 2)
    found = matchability.expected(view_angles_deg(positions, center)) * shared * scale
    np.fill_diagonal(found, 0.0)
    symmetric: Array = found
    return symmetric


def looseness_m(matches: Array, *, prior_m: float = POSE_NOISE_M, match_m: float = MATCH_M) -> Array:
    """(n,) standard deviation of each camera's position against all cameras' mean, metres.

    Cameras are points on springs: each is tied to its command with ``prior_m``, and each pair with n matches to each
    other with ``match_m`` / √n. The precision is the view graph's Laplacian, weighted by matches, plus the prior's; its
    inverse is the covariance, without the common shift, which bends nothing. Groups tied by few matches, and long
    chains, are loose.
    """
    count = len(matches)
    weight = matches / match_m**2
    precision = _laplacian(weight) + prior_m**-2 * np.eye(count)
    middle = np.eye(count) - 1.0 / count
    covariance = middle @ np.linalg.inv(precision) @ middle
    loose: Array = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return loose


def connectivity(matches: Array) -> float:
    """Algebraic connectivity of a view graph: the second smallest eigenvalue of its Laplacian, in matches.

    It is small if any two groups of views have few matches between them, and 0 if they have none (Fiedler, "Algebraic
    connectivity of graphs", 1973). A view tied by one strong pair is less well connected than one tied by several:
    incremental mapping needs points that two views have triangulated.

    Args:
        matches: (n, n) symmetric, of pairs of at least two views.
    """
    return max(0.0, float(np.linalg.eigvalsh(_laplacian(matches))[1]))


def _laplacian(weights: Array) -> Array:
    """(n, n) of a graph with symmetric weights (n, n), 0 on the diagonal."""
    found: Array = np.diag(weights.sum(axis=1)) - weights
    return found
