"""What a search for cameras exchanges: the problem, trials, results, and the interface of the methods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np

from fieldkit.clouds.cloud import Cloud
from fieldkit.errors import UsageError
from fieldkit.geometry import Intrinsics
from fieldkit.planning.space.assignment import assign
from fieldkit.planning.space.cameras import Array, Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.planning.space.plots import Plot
from fieldkit.planning.space.projection import project
from fieldkit.planning.space.ranges import Ranges

_LEAST = 3
_SAMPLE_STREAM = 31


@dataclass(frozen=True, eq=False)
class PlanningProblem:
    """Which cameras are looked for, and what is known of the plot without taking photographs.

    Attributes:
        count: N.
        envelope: the feasible set Z.
        camera: of the photographs, without distortion.
        plots: that the cameras are for: one, or several of a kind. Z keeps clear of all of them.
        views: of a recorded set, the only cameras there are; None where any camera of the envelope can be had.
        blind: whether mapping must find the poses without commanded ones, so that sets may not register.
        exact: whether a set has the same value at every seed.
        unmet: further plots of the kind, numbered after ``plots``, on which finalists are confirmed. Nothing is
            optimised for them.

    Raises:
        UsageError: fewer than three cameras, or more than there are views, or matches of other views.
    """

    count: int
    envelope: Envelope
    camera: Intrinsics
    plots: tuple[Plot, ...]
    views: Cameras | None = None
    blind: bool = False
    exact: bool = False
    unmet: tuple[Plot, ...] = ()

    def __post_init__(self) -> None:
        views = 0 if self.views is None else len(self.views)
        for plot in self.plots:
            if plot.matches is not None and plot.matches.shape != (views, views):
                raise UsageError(f"matches are counted for {plot.matches.shape}, but there are {views} views")
        if self.count < _LEAST:
            raise UsageError(f"a plan needs at least {_LEAST} cameras, not {self.count}")
        if self.views is not None and len(self.views) < self.count:
            raise UsageError(
                f"{self.count} cameras are asked of a set of {len(self.views)} photographs",
                remedy="Ask for fewer cameras.",
            )

    @property
    def reference(self) -> Cloud:
        """PC_env of the first plot, which those methods go by that know one only."""
        return self.plots[0].reference

    @property
    def center(self) -> Array:
        """(3,) the middle of the volume of interest."""
        middle: Array = np.array(self.envelope.target.center)
        return middle

    @property
    def distance_m(self) -> float:
        """At which an angle between views counts as the length it spans: the recorded views' median to the middle."""
        assert self.views is not None
        return float(np.median(np.linalg.norm(self.views.positions - self.center, axis=1)))

    def nearest(self, cameras: Cameras) -> Cameras:
        """The feasible set that stands for any set: projected into the envelope, or the recorded views it means.

        A set that is feasible comes back as it is, but recorded views in their own order.
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

    def counted_matches(self, cameras: Cameras, plot: Plot) -> Array | None:
        """(n, n) of a plot's matches for a feasible set; None where they are not known."""
        if plot.matches is None:
            return None
        index = self.numbers(cameras)
        return plot.matches[np.ix_(index, index)]

    def numbers(self, cameras: Cameras) -> list[int]:
        """Of a feasible set's recorded views."""
        return [self._places[key] for key in cameras.row_keys()]

    @cached_property
    def _places(self) -> dict[bytes, int]:
        """The recorded views' numbers by their keys."""
        return {} if self.views is None else {key: k for k, key in enumerate(self.views.row_keys())}

    @cached_property
    def ranges(self) -> Ranges:
        """What methods look in."""
        return Ranges.of(self.envelope, self.camera)

    def sample(self, seed: int) -> Cameras:
        """A random feasible set of N from `ranges` (`Envelope.sample`); of a recorded set N distinct views, all alike
        likely.
        """
        if self.views is None:
            return self.envelope.sample(self.count, seed, radius_m=self.ranges.radius_m, aim_m=self.ranges.aim_m)
        rng = np.random.default_rng([seed, _SAMPLE_STREAM])
        return self.views.select(np.sort(rng.choice(len(self.views), self.count, replace=False)))


@dataclass(frozen=True)
class Gain:
    """What a search may still gain, as its method knows it.

    Attributes:
        bound_m: by how much the best set that was tried may be worse than the best there is, metres.
        noise_m: standard deviation of an evaluation of it, metres.
    """

    bound_m: float
    noise_m: float

    @property
    def negligible(self) -> bool:
        """Whether evaluations could not tell such a gain from their noise."""
        return self.bound_m < self.noise_m


@dataclass(frozen=True, eq=False)
class Trial:
    """One set of cameras that a method wants evaluated.

    Attributes:
        number: from 0, in the order of proposal.
        cameras: feasible.
        origin: what proposed it, for people: ``"circle 1.2 m at 0.9 m"``, ``"EI of matern"``.
        notes: plain values worth keeping: model weights, what is still to be gained.
        gain: that this trial and all later ones may bring; None where the method does not say. A search may end
            instead of evaluating a trial whose gain is negligible.
        plot: that it is evaluated on: the number of one of the problem's plots, or of an unmet one.
    """

    number: int
    cameras: Cameras
    origin: str
    notes: Mapping[str, Any] = field(default_factory=dict)
    gain: Gain | None = None
    plot: int = 0


@dataclass(frozen=True, eq=False)
class Result:
    """A trial and what came of it.

    Attributes:
        trial: as proposed.
        value_m: the cost, metres: small is good.
        measured: False where the evaluation broke: then the value says nothing about the cameras.
        right: photographs whose poses are right.
    """

    trial: Trial
    value_m: float
    measured: bool = True
    right: int = 0


def lowest(results: Iterable[Result], count: int) -> list[Trial]:
    """The trials of the lowest measured values, no set of cameras twice."""
    chosen: dict[Cameras, Trial] = {}
    measured = [result for result in results if result.measured]
    for result in sorted(measured, key=lambda r: (r.value_m, r.trial.number)):
        if len(chosen) == count:
            break
        chosen.setdefault(result.trial.cameras, result.trial)
    return list(chosen.values())


class Method(Protocol):
    """Proposes trials.

    A proposal is a function of its number and of what it is given, not of earlier calls: so a run that was killed goes
    on as it would have, and results are the same whoever computes them.
    """

    @property
    def name(self) -> str:
        """As `--method` takes it."""
        ...

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial | None:
        """The trial of that number, or None where the method has no more to try.

        Args:
            number: of the trial.
            results: of earlier trials, by number; those the method may know of.
            pending: earlier trials whose results it may not know yet, by number.
        """
        ...


@runtime_checkable
class Chooser(Protocol):
    """A method that needs no results: its sets are evaluated as finalists only, where photographs can be taken."""

    @property
    def name(self) -> str:
        """As `--method` takes it."""
        ...

    def choose(self, count: int, workers: int = 1) -> list[Trial]:
        """At most ``count`` trials, the best by what is expected first, no set of cameras twice.

        They do not depend on ``workers``, the number of processes.
        """
        ...


@runtime_checkable
class Judge(Protocol):
    """A method that knows better than by the lowest values which trials are the best."""

    def favourites(self, results: Sequence[Result], count: int) -> list[Trial]:
        """At most ``count`` trials for another look, no set of cameras twice; none where nothing was measured."""
        ...


@runtime_checkable
class Arbiter(Protocol):
    """A method that knows better than by the mean of few confirmations what sets are worth on plots of a kind."""

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Result]) -> list[float]:
        """Costs in the mean of the problem's plots, metres, after results on these and on unmet plots."""
        ...
