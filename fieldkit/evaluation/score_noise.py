"""How much scores differ by chance alone.

Distances of neighbouring points to a reference are alike: they lie on one leaf, from the same photographs. So not
points are drawn anew but cubes of the plot with all their points, those of both clouds and of the reference together
(spatial block bootstrap after Hall 1985, paired). How far errors are alike is not known, so cubes of several sizes are
drawn and the largest deviation counts: on simulated leaves that are off as a whole, 5 % of equal pairs are then called
different, against 10 % by cubes of 0.05 or 0.1 m alone. It tells whether a difference holds for the plot's surface or
stems from a few spots. It knows nothing of what another flight would have given: repeats of the flight do, or of the
plan's objective.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from fieldkit.clouds import Cloud, PointIndex
from fieldkit.results.evaluation import distance_key

EDGES_M = (0.05, 0.10, 0.20, 0.40)
"""Of the cubes: as wide as a leaf, up to as large as a plant."""
LEAST_BLOCKS = 30
RESAMPLES = 2000
_NORMAL_95 = 1.959964

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BlockSums:
    """A cloud's distances, added up by cubes that all clouds of a plot share.

    Attributes:
        own: (b, 2 + d) per cube: number of the cloud's points, sum of their distances to the reference, number within
            each of d distances.
        back: (b, 2 + d) the same of the reference's points to the cloud.
    """

    own: Array
    back: Array


@dataclass(frozen=True, eq=False)
class Blocks:
    """Cubes of a plot with the sums of several clouds, by several sizes.

    Attributes:
        distances_m: of F-scores.
        levels: edge of the cubes and sums per cloud; at least one, by growing edges.
    """

    distances_m: tuple[float, ...]
    levels: tuple[tuple[float, tuple[BlockSums, ...]], ...]

    @property
    def edge_m(self) -> float:
        """Of the largest cubes."""
        return self.levels[-1][0]

    @property
    def fewest(self) -> int:
        """Number of the largest cubes."""
        return len(self.levels[-1][1][0].own)

    def difference_sd(self, a: int, b: int, *, seed: int, resamples: int = RESAMPLES) -> dict[str, float]:
        """Standard deviation of the differences between two clouds' scores, by figure: the largest over all sizes.

        Args:
            a, b: indices of the clouds.
            seed: of the draws.
            resamples: draws.
        """
        rng = np.random.default_rng(seed)
        largest: dict[str, float] = {}
        for _, sums in self.levels:
            count = len(sums[0].own)
            draws = rng.multinomial(count, np.full(count, 1.0 / count), size=resamples).astype(np.float64)
            first, second = self._scores(draws, sums[a]), self._scores(draws, sums[b])
            for name, values in first.items():
                sd = float(np.nanstd(values - second[name], ddof=1))
                largest[name] = max(sd, largest.get(name, 0.0))
        return largest

    def _scores(self, draws: Array, sums: BlockSums) -> dict[str, Array]:
        own, back = draws @ sums.own, draws @ sums.back
        with np.errstate(divide="ignore", invalid="ignore"):
            accuracy, completeness = own[:, 1] / own[:, 0], back[:, 1] / back[:, 0]
            scores = {
                "chamfer_m": accuracy + completeness, "accuracy_m": accuracy, "completeness_m": completeness,
            }  # fmt: skip
            for k, distance in enumerate(self.distances_m, 2):
                precision, recall = own[:, k] / own[:, 0], back[:, k] / back[:, 0]
                total = precision + recall
                scores[f"f_score_{distance_key(distance)}"] = np.where(total > 0, 2 * precision * recall / total, 0.0)
        return scores


def block_sums(reference: Cloud, clouds: Sequence[Cloud], distances_m: Sequence[float]) -> Blocks | None:
    """Distances between clouds and their reference by cubes; None where the plot is too small for `LEAST_BLOCKS`.

    Args:
        reference: n ≥ 1 points, metres.
        clouds: each with points, in the same frame.
        distances_m: of F-scores.
    """
    index = PointIndex(reference.points)
    own = [index.nearest(cloud.points)[0] for cloud in clouds]
    back = [PointIndex(cloud.points).nearest(reference.points)[0] for cloud in clouds]
    points = np.concatenate([reference.points, *(cloud.points for cloud in clouds)]) - reference.points.min(axis=0)
    ends = np.cumsum([len(reference), *(len(cloud) for cloud in clouds)])
    thresholds = tuple(float(d) for d in distances_m)
    levels = []
    for edge in EDGES_M:
        # Strays at any distance share the outermost cubes.
        cells = np.clip(np.floor(points / edge), -1e6, 1e6).astype(np.int64)
        _, block = np.unique(cells, axis=0, return_inverse=True)
        block = block.reshape(-1)
        count = int(block.max()) + 1
        if count < LEAST_BLOCKS:
            break
        parts = np.split(block, ends[:-1])
        sums = tuple(
            BlockSums(_sums(parts[k + 1], own[k], thresholds, count), _sums(parts[0], back[k], thresholds, count))
            for k in range(len(clouds))
        )
        levels.append((edge, sums))
    return Blocks(thresholds, tuple(levels)) if levels else None


def _sums(block: NDArray[np.int64], distances: Array, thresholds: Sequence[float], count: int) -> Array:
    columns = [np.bincount(block, minlength=count), np.bincount(block, weights=distances, minlength=count)]
    columns += [np.bincount(block[distances <= d], minlength=count) for d in thresholds]
    return np.stack(columns, axis=1).astype(np.float64)


def pooled_spread(groups: Sequence[Sequence[float]]) -> tuple[float, int] | None:
    """Standard deviation within groups of repeats, and its degrees of freedom; None without a repeat."""
    squares, freedom = 0.0, 0
    for group in groups:
        if len(group) > 1:
            values = np.asarray(group, dtype=np.float64)
            squares += float(((values - values.mean()) ** 2).sum())
            freedom += len(values) - 1
    return (float(np.sqrt(squares / freedom)), freedom) if freedom else None


def quantile_95(freedom: int | None = None) -> float:
    """Half a 95 % interval in standard deviations; Student's t where these come from few values."""
    return _NORMAL_95 if freedom is None else float(stdtrit(freedom, 0.975))


def log_sd(low: float, high: float) -> float:
    """Standard deviation of a logarithm, of the interval that nine in ten fall into."""
    return float((np.log(high) - np.log(low)) / (2.0 * 1.644854))
