"""Sets of cameras that the method `field` chooses from."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.planning.methods.optimise import Effort, near, optimise
from fieldkit.planning.methods.subsets import MatchGraph, Uniform
from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.score.cost_model import CostModel, Weights
from fieldkit.planning.score.registration import Registration
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import Circle, circles, families

_MEMBERS, _MOVES = 12, 48
_STEPS = (0.02, 0.4)
"""Least and largest step of moves, in D of `SetEmbedding`."""
_ANYWHERE = 4
"""If this divides a trial's number, the score's optimum is searched everywhere, else about one of the best sets."""
_EVERYWHERE, _NEARBY = Effort(), Effort(moves=300)
_RANDOM_DRAWS = 100


class Candidate(NamedTuple):
    """A set that may be tried, and its origin."""

    cameras: Cameras
    origin: str


@dataclass(frozen=True, eq=False)
class Turn:
    """What the candidates of a trial depend on."""

    number: int
    """The trial's."""
    known: Set[Cameras]
    """Sets that were tried or are pending."""
    registration: Registration | None
    """What is known about registering whole; None if mapping is not blind."""
    rng: np.random.Generator

    @property
    def anywhere(self) -> bool:
        """Whether the fitted score's optimum is searched everywhere, not just near a set."""
        return self.number % _ANYWHERE == 0

    def new(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """The candidates that are not known."""
        return [each for each in candidates if each.cameras not in self.known]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Draws candidates for a trial."""

    problem: PlanningProblem
    cost_model: CostModel
    """Expects costs by the geometric score."""
    weights: Weights
    """Of the score's terms, before there are results."""
    initial: int
    """Trials before the surrogate."""

    def first(self, turn: Turn) -> Candidate | None:
        """Sets known to be good, in turn; then the random structured set that the score ranks first, else any set."""
        for choices in (self._known_to_be_good(turn), self._members(2 * _MEMBERS, turn, turn.number)):
            new = turn.new(choices)
            if new:
                return min(new, key=lambda c: self.cost_model.cost_m(c.cameras, self.weights, turn.registration))
        for attempt in range(_RANDOM_DRAWS):
            cameras = self.problem.sample(int(turn.rng.integers(2**31)) + attempt)
            if cameras not in turn.known:
                return Candidate(cameras, "random")
        return None

    def pool(self, turn: Turn, best: Sequence[Trial], slopes: ArrayLike, distance_m: float) -> list[Candidate]:
        """The fitted score's optimum, anywhere or about one of the best sets, structured sets, and moves from the best.

        Args:
            turn: its known sets are left out.
            slopes: (3,) fitted weights of the score's terms.
            distance_m: D of `SetEmbedding`.
        """
        rng = turn.rng
        found = self._members(_MEMBERS, turn)
        if self.problem.views is None:
            about = None if turn.anywhere else best[int(rng.integers(len(best)))]
            origin = "optimum of the fitted score" + ("" if about is None else f" near {about.number}")
            found.append(self._optimum(slopes, origin, turn, about))
        least, most = (share * distance_m for share in _STEPS)
        for k in range(_MOVES):
            center, size_m = best[k % len(best)], least * (most / least) ** rng.random()
            found.append(Candidate(near(center.cameras, self.problem, size_m, rng), f"near {center.number}"))
        return turn.new(found)

    def _known_to_be_good(self, turn: Turn) -> list[Candidate]:
        """On a plot the score's optima and the circles it ranks first.

        In a recorded set uniform subsets and greedy choices by matches, since the score has poor optima where all views
        stand on rings.
        """
        number = turn.number
        if self.problem.views is not None:
            made = (MatchGraph if number % 2 else Uniform)(self.problem).propose(number // 2, (), ())
            return [] if made is None else [Candidate(made.cameras, made.origin)]
        if number in (0, 2) or (self.problem.blind and number % 2 and number >= self.initial):
            return [self._optimum(self.weights, "optimum of the geometric score", turn)]
        return [self._circle(circle) for circle in self._circles] if number in (1, 4) else []

    def _members(self, count: int, turn: Turn, first: int = 0) -> list[Candidate]:
        """Random members of the structured families, in turn."""
        kinds = families(self.problem)
        chosen = [kinds[k % len(kinds)] for k in range(first, first + count)]
        return [Candidate(self.problem.nearest(kind.decode(turn.rng.random(len(kind)))), kind.name) for kind in chosen]

    @cached_property
    def _circles(self) -> tuple[Circle, ...]:
        return circles(self.problem, altitudes=3, radii=2, inner=True)

    def _circle(self, circle: Circle) -> Candidate:
        origin = f"circle {circle.radius_m:.2f} m at {circle.altitude_m:.2f} m"
        return Candidate(self.problem.nearest(circle.cameras(self.problem)), origin)

    def _optimum(self, slopes: ArrayLike, origin: str, turn: Turn, about: Trial | None = None) -> Candidate:
        """The set of the largest prior mean, searched about a given set, else anywhere."""

        def cost(cameras: Cameras) -> float:
            return self.cost_model.cost_m(cameras, slopes, turn.registration)

        effort, known = (_EVERYWHERE, []) if about is None else (_NEARBY, [about.cameras])
        cameras = optimise(self.problem, cost, int(turn.rng.integers(2**31)), effort, known)
        return Candidate(self.problem.nearest(cameras), origin)
