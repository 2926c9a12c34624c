"""The result of an evaluation, and its value r(z): the rule for poor, tiny and missing clouds (docs/planning.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.vocabulary import CAP_M, DISTANCES_M

SUPPORT = 0.25
"""Share of the reference that the cloud must reach for its accuracy to count in full."""
WORST_M = 2.0 * CAP_M
"""The largest value, that of an empty cloud."""


@dataclass(frozen=True)
class StageCost:
    """Wall and CPU seconds of one stage on one thread."""

    name: str
    cpu_s: float
    wall_s: float


@dataclass(frozen=True)
class Evaluation:
    """r(z) at one z. Lengths are metres."""

    value_m: float
    """The cost to minimise, by the rule of `fieldkit.planning.objective.evaluation`; always finite."""
    chamfer_m: float | None
    """Plain chamfer distance (eq. `r_func`); this and its directed terms are None without a cloud."""
    accuracy_m: float | None
    """Mean distance from the cloud to the reference."""
    completeness_m: float | None
    """Mean distance from the reference to the cloud."""
    f_scores: Mapping[float, float]
    """F-score by distance in metres; 0 without a cloud."""
    images: int
    """Photographs asked for."""
    registered: int
    """Images with a pose from the mapper."""
    right: int
    """Registered images whose pose agrees with the commanded one."""
    models: int
    """Number of the mapper's models; the largest is used."""
    points: int
    """Number of points of the cloud."""
    cloud_digest: str
    """Of the cloud's positions: equal if the clouds are equal byte for byte."""
    views: tuple[str, ...]
    """Names of the photographs (in a recorded set, of the chosen views), in the cameras' order."""
    failure: str = ""
    """Why there is no cloud; empty if there is one."""
    measured: bool = True
    """False if the evaluation itself broke (a crash, the time-out); ``value_m`` is then the rule's worst and says
    nothing about z.
    """
    times: tuple[StageCost, ...] = field(default=(), compare=False)

    @property
    def cpu_s(self) -> float:
        """CPU seconds of all stages."""
        return sum(stage.cpu_s for stage in self.times)

    @classmethod
    def broken(cls, images: int, reason: str) -> Evaluation:
        """An evaluation that broke twice; it says nothing about z."""
        return cls(
            WORST_M,
            None,
            None,
            None,
            dict.fromkeys(DISTANCES_M, 0.0),
            images,
            0,
            0,
            0,
            0,
            "",
            (),
            reason,
            measured=False,
        )

    def figures(self) -> dict[str, Any]:
        """Plain values of everything but the times; equal for every evaluation of z."""
        plain = asdict(self)
        del plain["times"]
        plain["f_scores"] = {f"{distance:.3f}": score for distance, score in self.f_scores.items()}
        plain["views"] = list(self.views)
        return plain


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
