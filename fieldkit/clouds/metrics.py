"""How close an estimated cloud is to its reference.

Both directions are measured in one nearest-neighbour pass each, and everything is derived from those two arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.neighbors import PointIndex
from fieldkit.errors import EmptyCloudError
from fieldkit.vocabulary import DISTANCES_M


@dataclass(frozen=True)
class Chamfer:
    """Symmetric chamfer distance with its two directed terms, metres."""

    chamfer_m: float
    """Accuracy_m + completeness_m (eq. r_func of BOSfM; the same as point-cloud-utils')."""
    accuracy_m: float
    """Mean distance from the estimate's points to the reference: what is there but should not be."""
    completeness_m: float
    """Mean distance from the reference's points to the estimate: what should be there but is not."""


@dataclass(frozen=True)
class FScore:
    """Precision, recall and their harmonic mean at one distance (Knapitsch et al. 2017), each in [0, 1]."""

    precision: float
    """Share of the estimate's points within the distance of the reference."""
    recall: float
    """Share of the reference's points within the distance of the estimate."""
    f_score: float
    """2 · precision · recall / (precision + recall), 0 where both are 0."""


@dataclass(frozen=True)
class CloudScore:
    """An estimate's score against a reference."""

    chamfer: Chamfer
    """The symmetric distance and its directed terms."""
    f_scores: dict[float, FScore]
    """By distance in metres, ascending."""


class ReferenceIndex:
    """A reference cloud made ready to score many estimates against: sorted and indexed once.

    Args:
        reference: what completeness and recall are means over.
        surface: the same surfaces sampled more densely, where they are known: what accuracy and precision are measured
            to. The distance from a point on a surface to points scattered over it, λ per square metre, is 0.5 / √λ on
            average and not zero, and so is part of every accuracy. Completeness has no such part.
    """

    def __init__(self, reference: Cloud, surface: Cloud | None = None) -> None:
        self.cloud = reference
        self.index = _index(reference, "reference")
        self.surface = self.index if surface is None else _index(surface, "surface's")

    def __len__(self) -> int:
        return len(self.cloud)


def score(reference: Cloud | ReferenceIndex, estimate: Cloud, distances_m: Sequence[float] = DISTANCES_M) -> CloudScore:
    """Chamfer distance and F-scores of an estimate, from one nearest-neighbour pass in each direction.

    Args:
        reference: metres in the plot frame; a `ReferenceIndex` saves the work of indexing it again.
        estimate: metres in the same frame.
        distances_m: positive thresholds for the F-scores.
    """
    return score_distances(*nearest_distances(reference, estimate), distances_m)


def score_distances(
    to_reference: FloatArray, to_estimate: FloatArray, distances_m: Sequence[float] = DISTANCES_M
) -> CloudScore:
    """`score` from what `nearest_distances` gave.

    Args:
        to_reference: (m,) metres, m ≥ 1.
        to_estimate: (n,) metres, n ≥ 1.
        distances_m: positive thresholds for the F-scores.
    """
    thresholds = sorted({float(d) for d in distances_m})
    if not all(np.isfinite(d) and d > 0 for d in thresholds):
        raise ValueError(f"distances must be positive numbers of metres, not {list(distances_m)}")
    return CloudScore(
        chamfer=_chamfer(to_reference, to_estimate),
        f_scores={d: _f_score(to_reference, to_estimate, d) for d in thresholds},
    )


def _index(cloud: Cloud, name: str) -> PointIndex:
    if not len(cloud):
        raise EmptyCloudError(
            f"the {name} cloud has no points, so there is nothing to measure distances to",
            remedy="Check the volume of interest and the ground clearance, or whether the photographs registered.",
        )
    return PointIndex(cloud.points)


def nearest_distances(reference: Cloud | ReferenceIndex, estimate: Cloud) -> tuple[FloatArray, FloatArray]:
    """Distances estimate → reference (m,) and reference → estimate (n,), metres, each in its own cloud's Z-order.

    The first are to the reference's surface where the `ReferenceIndex` has one.
    """
    kept = reference if isinstance(reference, ReferenceIndex) else ReferenceIndex(reference)
    own = _index(estimate, "estimated")
    return kept.surface.distances_from(own), own.distances_from(kept.index)


def _chamfer(to_reference: FloatArray, to_estimate: FloatArray) -> Chamfer:
    accuracy, completeness = float(to_reference.mean()), float(to_estimate.mean())
    return Chamfer(accuracy + completeness, accuracy, completeness)


def _f_score(to_reference: FloatArray, to_estimate: FloatArray, distance_m: float) -> FScore:
    precision = float(np.count_nonzero(to_reference <= distance_m) / len(to_reference))
    recall = float(np.count_nonzero(to_estimate <= distance_m) / len(to_estimate))
    total = precision + recall
    return FScore(precision, recall, 2.0 * precision * recall / total if total > 0 else 0.0)
