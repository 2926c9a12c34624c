"""The result of an evaluation, and its value r(z): the rule for poor, tiny and missing clouds (docs/planning.md)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from fieldkit.results.fields import Count, Length, Strict
from fieldkit.vocabulary import CAP_M, DISTANCES_M

SUPPORT = 0.25
"""Share of the reference that the cloud must reach for its accuracy to count in full."""
WORST_M = 2.0 * CAP_M
"""The largest value, that of an empty cloud."""


def f_score_table(f_scores: dict[float, float]) -> dict[str, float]:
    """F-scores by distance in metres as results hold them; 0 where there is none."""
    return {f"{distance:.3f}": f_scores.get(distance, 0.0) for distance in DISTANCES_M}


class Evaluation(Strict):
    """r(z) at one z. Lengths are metres."""

    value_m: Length
    """The cost to minimise, by the rule of `fieldkit.planning.objective.evaluation`."""
    chamfer_m: Length | None = None
    """Plain chamfer distance (eq. `r_func`); this and its directed terms are None without a cloud."""
    accuracy_m: Length | None = None
    """Mean distance from the cloud to the reference."""
    completeness_m: Length | None = None
    """Mean distance from the reference to the cloud."""
    f_score: dict[str, float] = Field(default_factory=lambda: f_score_table({}))
    """By distance in metres; 0 without a cloud."""
    registered: Count = 0
    """Images with a pose from the mapper."""
    right: Count = 0
    """Registered images whose pose agrees with the commanded one."""
    models: Count = 0
    """Number of the mapper's models; the largest is used."""
    points: Count = 0
    """Number of points of the cloud."""
    cloud_digest: str = ""
    """Of the cloud's positions: equal if the clouds are equal byte for byte."""
    views: tuple[str, ...] = ()
    """Names of the photographs (in a recorded set, of the chosen views), in the cameras' order."""
    failure: str = ""
    """Why there is no cloud; empty if there is one."""
    measured: bool = True
    """False if the evaluation itself broke (a crash, the time-out); ``value_m`` is then the rule's worst and says
    nothing about z.
    """
    cpu_s: Length = 0.0
    """Of the evaluation."""
    wall_s: Length = 0.0


def value_m(to_estimate: ArrayLike, to_reference: ArrayLike) -> float:
    """The cost of a cloud in metres: small is good.

    With every distance d capped at c = `CAP_M`, completeness C = mean(d of reference points), accuracy A = mean(d of
    the cloud's points) and the share reached s = 1 − C / c,

        value = C + w·A + (1 − w)·c,    w = min(1, s / SUPPORT).

    That is the chamfer distance itself where no distance exceeds the cap and the cloud reaches `SUPPORT` of the
    reference. It lies in [0, 2c]; it is 2c for an empty cloud and continuous in every distance. Adding a point no
    farther from the reference than the cloud's mean never raises it.

    Args:
        to_estimate: (n,) distances of the reference's points to the cloud; empty if the cloud is empty.
        to_reference: (m,) distances of the cloud's points to the reference.
    """
    to_cloud, to_truth = np.asarray(to_estimate, dtype=np.float64), np.asarray(to_reference, dtype=np.float64)
    if not to_truth.size or not to_cloud.size:
        return WORST_M
    completeness = float(np.minimum(to_cloud, CAP_M).mean())
    accuracy = float(np.minimum(to_truth, CAP_M).mean())
    weight = min(1.0, max(0.0, 1.0 - completeness / CAP_M) / SUPPORT)
    return min(completeness + weight * accuracy + (1.0 - weight) * CAP_M, WORST_M)
