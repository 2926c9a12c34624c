"""What one evaluation of the objective gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from fieldkit.clouds.metrics import DISTANCES_M


@dataclass(frozen=True)
class StageCost:
    """Seconds of one stage on one thread."""

    name: str
    cpu_s: float
    wall_s: float


@dataclass(frozen=True)
class Evaluation:
    """r(z) at one z. Lengths are metres.

    Attributes:
        value_m: the cost to minimise, by the rule of `fieldkit.planning.objective.rule`; always finite.
        chamfer_m: plain chamfer distance (eq. `r_func`), its directed terms, None where there is no cloud.
        accuracy_m: mean distance from the cloud to the reference.
        completeness_m: mean distance from the reference to the cloud.
        f_scores: by distance; 0 without a cloud.
        images: asked for.
        registered: images the mapper gave a pose.
        right: of these, not in contradiction to the commanded poses.
        models: the mapper's models; the largest is used.
        points: of the cloud.
        cloud_digest: of the cloud's positions: equal where the clouds are, byte for byte.
        views: the photographs' names (of a recorded set: the views that were chosen), in the cameras' order.
        failure: why there is no cloud; empty where there is one.
        measured: False where the evaluation itself broke (a crash, the time-out): then ``value_m`` is the rule's worst
            but says nothing about z.
        times: seconds by stage.
    """

    value_m: float
    chamfer_m: float | None
    accuracy_m: float | None
    completeness_m: float | None
    f_scores: Mapping[float, float]
    images: int
    registered: int
    right: int
    models: int
    points: int
    cloud_digest: str
    views: tuple[str, ...]
    failure: str = ""
    measured: bool = True
    times: tuple[StageCost, ...] = field(default=(), compare=False)

    @property
    def cpu_s(self) -> float:
        """CPU seconds of all stages."""
        return sum(stage.cpu_s for stage in self.times)

    def stage_cpu_s(self, name: str) -> float:
        """CPU seconds of one stage; 0 where it was not run."""
        return sum(stage.cpu_s for stage in self.times if stage.name == name)

    @classmethod
    def broken(cls, images: int, reason: str, worst_m: float) -> Evaluation:
        """An evaluation that broke twice and tells nothing of z."""
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
        """Plain values of everything but the times: the same wherever and however often z is evaluated."""
        plain = asdict(self)
        del plain["times"]
        plain["f_scores"] = {f"{distance:.3f}": score for distance, score in self.f_scores.items()}
        plain["views"] = list(self.views)
        return plain
