"""The result of one evaluation of the objective."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from fieldkit.vocabulary import DISTANCES_M


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
    """The cost to minimise, by the rule of `fieldkit.planning.objective.rule`; always finite."""
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
    """Seconds by stage."""

    @property
    def cpu_s(self) -> float:
        """CPU seconds of all stages."""
        return sum(stage.cpu_s for stage in self.times)

    def stage_cpu_s(self, name: str) -> float:
        """CPU seconds of one stage; 0 if it was not run."""
        return sum(stage.cpu_s for stage in self.times if stage.name == name)

    @classmethod
    def broken(cls, images: int, reason: str, worst_m: float) -> Evaluation:
        """An evaluation that broke twice; it says nothing about z."""
        return cls(
            worst_m,
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
