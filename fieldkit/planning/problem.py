"""The data of a search for cameras: the problem, trials and results; and the interface of the methods."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.clouds.cloud import Cloud
from fieldkit.errors import UsageError
from fieldkit.geometry import Intrinsics
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.planning.space.cameras import Cameras, assign
from fieldkit.planning.space.envelope import Envelope, Ranges, project
from fieldkit.planning.space.plots import Plot

POSE_NOISE_M = 0.010
"""Least standard deviation that the score expects of a commanded position, metres: what evaluations claim of exact
ones, and RTK's error (docs/planning.md)."""
_LEAST = 3
"""Least number of cameras of a plan."""
_SAMPLE_STREAM = 31
"""Seed's part for random sets."""


@dataclass(frozen=True, eq=False)
class PlanningProblem:
    """The cameras to find, and what is known about the plots without photographs."""

    count: int
    """N, the number of cameras."""
    envelope: Envelope
    """The feasible set Z."""
    camera: Intrinsics
    """Of the photographs, without distortion."""
    plots: tuple[Plot, ...]
    """The plots to photograph: one, or several of a kind. Z keeps clear of all of them."""
    views: Cameras | None = None
    """The cameras of a recorded set, the only ones to choose from; None if any camera of the envelope will do."""
    exact: bool = False
    """Whether a set has the same value at every seed."""
    unseen: tuple[Plot, ...] = ()
    """Further plots of the kind, numbered after ``plots``, on which finalists are only confirmed."""
    noise: NoiseSettings = field(default_factory=NoiseSettings)
    """Noise that the plan must survive. The score goes by positions, wind and wash: a camera that is turned about its
    centre sees the same plants from the same place."""

    def __post_init__(self) -> None:
        if self.count < _LEAST:
            raise UsageError(f"a plan needs at least {_LEAST} cameras, not {self.count}")
        if self.views is not None and len(self.views) < self.count:
            raise UsageError(
                f"{self.count} cameras are asked for, but the set has {len(self.views)} photographs",
                remedy="Ask for fewer cameras.",
            )

    @property
    def reference(self) -> Cloud:
        """PC_env of the first plot, for methods that use only one plot."""
        return self.plots[0].reference

    @property
    def center(self) -> FloatArray:
        """(3,) the middle of the volume of interest."""
        middle: FloatArray = np.array(self.envelope.target.center)
        return middle

    @property
    def distance_m(self) -> float:
        """The recorded views' median distance to the middle, metres: at it, angles between views count as lengths."""
        assert self.views is not None
        return float(np.median(np.linalg.norm(self.views.positions - self.center, axis=1)))

    def nearest(self, cameras: Cameras) -> Cameras:
        """The feasible set near any set: projected into the envelope, or the recorded views assigned to it.

        A feasible set is returned unchanged, except that recorded views come in their own order.
        """
        if self.views is None:
            return project(cameras, self.envelope)
        return self.views.select(np.sort(assign(cameras, self.views, self.distance_m)))

    def contains(self, cameras: Cameras) -> bool:
        """Whether a set is feasible."""
        if self.views is None:
            return self.envelope.contains(cameras)
        keys = set(cameras.row_keys())
        return len(keys) == len(cameras) and keys <= self._places.keys()

    def counted_matches(self, cameras: Cameras, plot: Plot) -> FloatArray | None:
        """(n, n) a plot's matches between the cameras of a feasible set; None if unknown."""
        if plot.matches is None:
            return None
        index = self.numbers(cameras)
        return plot.matches[np.ix_(index, index)]

    def numbers(self, cameras: Cameras) -> list[int]:
        """Numbers of a feasible set's recorded views."""
        return [self._places[key] for key in cameras.row_keys()]

    @cached_property
    def _places(self) -> dict[bytes, int]:
        """Numbers of the recorded views by their keys."""
        return {} if self.views is None else {key: k for k, key in enumerate(self.views.row_keys())}

    @cached_property
    def ranges(self) -> Ranges:
        """The ranges that methods search."""
        return Ranges.of(self.envelope, self.camera)

    def sample(self, seed: int) -> Cameras:
        """A random feasible set from `ranges` (`Envelope.sample`), or N distinct recorded views, all equally likely."""
        if self.views is None:
            return self.envelope.sample(self.count, seed, radius_m=self.ranges.radius_m, aim_m=self.ranges.aim_m)
        rng = np.random.default_rng([seed, _SAMPLE_STREAM])
        return self.views.select(np.sort(rng.choice(len(self.views), self.count, replace=False)))


@dataclass(frozen=True)
class Gain:
    """The gain that a method still expects of its search."""

    bound_m: float
    """Bound on how much worse the best tried set is than the best possible one, metres."""
    noise_m: float
    """Standard deviation of an evaluation of the best tried set, metres."""

    @property
    def negligible(self) -> bool:
        """Whether the gain is below the noise of evaluations."""
        return self.bound_m < self.noise_m


@dataclass(frozen=True, eq=False)
class Trial:
    """A set of cameras that a method proposes for evaluation, and what came of it."""

    number: int
    """From 0, in the order of proposal."""
    cameras: Cameras
    """Feasible."""
    origin: str
    """What proposed it, for people: ``"circle 1.2 m at 0.9 m"``, ``"EI of matern"``."""
    notes: Mapping[str, Any] = field(default_factory=dict)
    """Plain values to keep, such as model weights."""
    gain: Gain | None = None
    """Expected of this trial and all later ones; None if the method does not say. A search may end instead of
    evaluating a trial whose gain is negligible.
    """
    plot: int = 0
    """Number of the plot that it is evaluated on: one of the problem's plots or an unseen one."""
    value_m: float = np.nan
    """Its result, the cost in metres: small is good. NaN before its evaluation, and where that broke."""

    @property
    def measured(self) -> bool:
        """Whether its cost is known."""
        return not np.isnan(self.value_m)


def lowest(results: Iterable[Trial], count: int) -> list[Trial]:
    """The trials of the lowest measured values, without repeated sets of cameras."""
    chosen: dict[Cameras, Trial] = {}
    for trial in sorted((r for r in results if r.measured), key=lambda r: (r.value_m, r.number)):
        chosen.setdefault(trial.cameras, trial)
    return list(chosen.values())[:count]


class Method(Protocol):
    """Proposes trials.

    A proposal depends only on the arguments, not on earlier calls. So a killed run can go on as it would have, and the
    results do not depend on who computes them. A method with a fixed number of trials has it as ``trials``.
    """

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        """The trial of the given number, or None if the method has no more to try.

        Args:
            number: of the trial.
            results: the known results of earlier trials, by number.
            pending: earlier trials without a known result, by number.
        """
        ...


@runtime_checkable
class FixedDesign(Protocol):
    """A method that needs no results. Its sets are evaluated only as finalists, if photographs can be taken."""

    def choose(self, count: int, workers: int = 1, advance: Callable[[int], None] = lambda _: None) -> list[Trial]:
        """At most ``count`` trials, the best expected first, without repeated sets of cameras.

        They do not depend on ``workers``, the number of processes. ``advance`` is called with 1 as each is found.
        """
        ...


@runtime_checkable
class FinalistSelector(Protocol):
    """A method that chooses the finalists itself; else those of the lowest values are taken."""

    def favourites(self, results: Sequence[Trial], count: int) -> list[Trial]:
        """At most ``count`` finalists, without repeated sets of cameras; none if nothing was measured."""
        ...


@runtime_checkable
class FinalistCosts(Protocol):
    """A method that estimates costs of finalists on plots of a kind, instead of the mean of their confirmations."""

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Trial]) -> list[float]:
        """Mean costs over the problem's plots, metres, after results on these and on unseen plots."""
        ...
