"""The value of r(z): the chamfer distance, and the rule for poor, tiny and missing clouds.

docs/objective.md explains it with examples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Rule:
    """The constants of the rule."""

    cap_m: float = 0.10
    """Upper limit of every distance, metres; a reference point that the cloud does not reach counts this much."""
    support: float = 0.25
    """Share of the reference that the cloud must reach for its accuracy to count in full."""

    def __post_init__(self) -> None:
        if not (self.cap_m > 0 and 0 < self.support <= 1):
            raise ValueError("the cap must be positive, and the support lie in (0, 1]")

    @property
    def worst_m(self) -> float:
        """The largest value, that of an empty cloud."""
        return 2.0 * self.cap_m


def value_m(to_estimate: ArrayLike, to_reference: ArrayLike, rule: Rule) -> float:
    """The cost of a cloud in metres: small is good.

    With every distance d capped at c, completeness C = mean(d of reference points), accuracy A = mean(d of the
    cloud's points) and the share reached s = 1 − C / c,

        value = C + w·A + (1 − w)·c,    w = min(1, s / support).

    That is the chamfer distance itself where no distance exceeds the cap and the cloud reaches ``support`` of the
    reference. It lies in [0, 2c]; it is 2c for an empty cloud and continuous in every distance. Adding a point no
    farther from the reference than the cloud's mean never raises it.

    Args:
        to_estimate: (n,) distances of the reference's points to the cloud; empty if the cloud is empty.
        to_reference: (m,) distances of the cloud's points to the reference.
        rule: cap and support.
    """
    to_cloud, to_truth = np.asarray(to_estimate, dtype=np.float64), np.asarray(to_reference, dtype=np.float64)
    if not to_truth.size or not to_cloud.size:
        return rule.worst_m
    completeness = float(np.minimum(to_cloud, rule.cap_m).mean())
    accuracy = float(np.minimum(to_truth, rule.cap_m).mean())
    weight = min(1.0, max(0.0, 1.0 - completeness / rule.cap_m) / rule.support)
    return min(completeness + weight * accuracy + (1.0 - weight) * rule.cap_m, rule.worst_m)
