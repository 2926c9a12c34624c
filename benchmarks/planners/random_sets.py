"""The methods `random` and `bosfm-tuned`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.planning.methods.bosfm import Bosfm, Coding, EncodedSpace, sample_seed
from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.score.cost_model import LEAST_M, NOISE
from fieldkit.planning.space.cameras import PER_CAMERA, Cameras


@dataclass(frozen=True, eq=False)
class Random:
    """Trial k is `PlanningProblem.sample` for the seed and k; results have no influence."""

    problem: PlanningProblem
    """The planning problem."""
    seed: int = 0
    """Of all trials."""

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial:
        return Trial(number, self.problem.sample(sample_seed(self.seed, number)), "random")


@dataclass(frozen=True, eq=False)
class TunedBosfm(Bosfm):
    """`bosfm` with three things changed, as a practitioner would change them.

    Cameras are given by azimuth, radius and height about the plot's middle and sorted by azimuth, so that similar sets
    have similar codes (`CylindricalCoding`). The models see y = −ln(value), so that the cap for sets that do not
    register no longer makes up most of the variance. The models' noise is at least 5 % of a value, like that of
    evaluations.
    """

    _least_noise: ClassVar[float] = NOISE

    def _worth(self, values_m: FloatArray) -> FloatArray:
        worth: FloatArray = -np.log(np.maximum(values_m, LEAST_M))
        return worth

    @cached_property
    def _space(self) -> EncodedSpace:
        return CylindricalSpace(self.problem)


class CylindricalCoding(Coding):
    """The same with azimuth, clockwise from north, and radius about the target's middle in place of x and y.

    Cameras come sorted by azimuth, so that their order tells nothing. Radii reach to the box's farthest corner; places
    beyond its sides are cut to them.
    """

    def encode(self, cameras: Cameras) -> FloatArray:
        """The code u (5n,) of n cameras by azimuth; values beyond the limits are cut to them."""
        azimuth, radius = self._polar(cameras.positions)
        order = np.argsort(azimuth, kind="stable")
        code = super().encode(cameras.select(order)).reshape(-1, PER_CAMERA)
        code[:, 0], code[:, 1] = azimuth[order] / 360.0, np.minimum(radius[order] / self._widest_m, 1.0)
        return code.reshape(-1)

    def decode(self, code: FloatArray) -> Cameras:
        """The cameras of a code u (5n,); see `Coding.decode`."""
        share = np.clip(np.array(code, dtype=np.float64).reshape(-1, PER_CAMERA), 0.0, 1.0)
        turn, radius = 2.0 * np.pi * share[:, 0], self._widest_m * share[:, 1]
        places = self.center[:2] + radius[:, None] * np.column_stack([np.sin(turn), np.cos(turn)])
        span = self.high[:2] - self.low[:2]
        share[:, :2] = (places - self.low[:2]) / np.where(span > 0, span, 1.0)
        return super().decode(share.reshape(-1))

    def _polar(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        east, north = (positions[:, :2] - self.center[:2]).T
        return np.degrees(np.arctan2(east, north)) % 360.0, np.hypot(east, north)

    @property
    def _widest_m(self) -> float:
        away = np.maximum(np.abs(self.low[:2] - self.center[:2]), np.abs(self.high[:2] - self.center[:2]))
        return float(np.hypot(*away))


class CylindricalSpace(EncodedSpace):
    """`EncodedSpace` whose codes are those of `CylindricalCoding`."""

    _coding: ClassVar[type[Coding]] = CylindricalCoding
