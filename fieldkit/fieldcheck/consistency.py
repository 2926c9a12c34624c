"""Whose tags contradict what the photographs show.

Ties say how cameras stand to each other, tags where each stands. First the tags are laid aside, one by one, that
contradict most of their ties; then every tag is compared with the pose that its photograph has by its ties and the
others' tags, and laid aside or taken back, until nothing changes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldkit.fieldcheck.model import CheckSettings
from fieldkit.fieldcheck.pose_graph import Solution, solve, spread_from
from fieldkit.fieldcheck.ties import TieGraph, tie_errors_deg
from fieldkit.geometry import Pose
from fieldkit.geometry.priors import PosePrior

_TURN_DEG, _DIRECTION_DEG = 12.0, 20.0
_DIRECTION_SIGMAS = 3.7
_CONTRADICTS, _AGREES = 4.0, 3.0
_CERTAIN_MATCHES, _GROSS = 25, 10.0
"""On simulated plots ties of fewer matches called sound photographs wrong, by up to 7 standard deviations; exchanged
ones were 24 and more off by such ties."""
_MOST_ROUNDS = 30
_AGAIN = 6
"""Iterations from all tags' solution to the one without a tag."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SeenPose:
    """A photograph's pose by its ties and the other photographs' tags, without its own."""

    pose: Pose
    """In the plan's frame."""
    covariance: Array
    """(6, 6), as `Solution` has it."""
    matches: int
    """Of its ties."""

    @property
    def sigma_m(self) -> float:
        """Of the position along its least known direction."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[3:, 3:])[-1]))

    def compare(self, other: Pose, sigma_m: float, sigma_deg: float) -> Difference:
        """This pose against one that is known to ``sigma_m`` and ``sigma_deg`` about each axis."""
        turn = Rotation.from_matrix(self.pose.rotation @ other.rotation.T).as_rotvec()
        shift = self.pose.center - other.center
        spread_turn = self.covariance[:3, :3] + np.radians(sigma_deg) ** 2 * np.eye(3)
        spread_shift = self.covariance[3:, 3:] + sigma_m**2 * np.eye(3)
        return Difference(
            float(np.linalg.norm(shift)), float(np.sqrt(shift @ np.linalg.solve(spread_shift, shift))),
            float(np.degrees(np.linalg.norm(turn))), float(np.sqrt(turn @ np.linalg.solve(spread_turn, turn))),
        )  # fmt: skip


@dataclass(frozen=True)
class Difference:
    """Between two poses: metres and degrees, and both in standard deviations."""

    shift_m: float
    shift_sigmas: float
    turn_deg: float
    turn_sigmas: float

    def excess(self, settings: CheckSettings) -> float:
        """Standard deviations of what is beyond the limits; 0 where nothing is."""
        shift = self.shift_sigmas if self.shift_m > settings.position_m else 0.0
        turn = self.turn_sigmas if self.turn_deg > settings.angle_deg else 0.0
        return max(shift, turn)


@dataclass(frozen=True, eq=False)
class Consistency:
    """What photographs say of tags."""

    seen: Mapping[int, SeenPose]
    """Poses by index, of the photographs that ties reach."""
    contradicted: frozenset[int]
    """Photographs with tags that the photographs contradict."""
    untagged: frozenset[int]
    """Photographs whose pose is known by their ties only."""


def check_tags(
    tags: Mapping[int, PosePrior], graph: TieGraph, settings: CheckSettings, doubts: Mapping[int, float] | None = None
) -> Consistency:
    """Compare tags with ties.

    Args:
        tags: by photograph, in the plan's frame; photographs without one are missing.
        graph: of all photographs.
        doubts: how far tags are from what was planned, metres: of two that contradict each other, and nothing else,
            the one that is farther off is to blame.
        settings: limits.
    """
    aside = _laid_aside(tags, graph, doubts or {})
    tried: set[frozenset[int]] = set()
    seen: dict[int, SeenPose] = {}
    excess: dict[int, float] = {}
    for _ in range(_MOST_ROUNDS):
        seen = _seen(tags, graph, aside)
        excess = {k: s.compare(tags[k].pose, tags[k].position_sigma_m, tags[k].angle_sigma_deg).excess(settings)
                  for k, s in seen.items() if k in tags}  # fmt: skip
        tried.add(frozenset(aside))
        worst = max((k for k in excess if k not in aside), key=lambda k: excess[k], default=None)
        if worst is not None and excess[worst] > _CONTRADICTS and frozenset(aside | {worst}) not in tried:
            aside = aside | {worst}
            continue
        best = min((k for k in aside if k in excess), key=lambda k: excess[k], default=None)
        if best is not None and excess[best] < _AGREES and frozenset(aside - {best}) not in tried:
            aside = aside - {best}
            continue
        break
    # A tag that some of its matches contradict, but that is where all of them together put the photograph, is right.
    off = frozenset(k for k in aside if excess.get(k, 0.0) > (_GROSS if _weakly_tied(k, graph) else 0.0))
    return Consistency(seen, off, frozenset(k for k in seen if k not in tags))


def _weakly_tied(k: int, graph: TieGraph) -> bool:
    """Whether all ties of a photograph are of so few matches that they may be chance."""
    return all(tie.matches < _CERTAIN_MATCHES for pair, tie in graph.ties.items() if k in pair)


def _laid_aside(tags: Mapping[int, PosePrior], graph: TieGraph, doubts: Mapping[int, float]) -> set[int]:
    """Photographs whose tags contradict at least half of their matches, the worst first and one by one."""
    bad = {pair: not _agrees(tags[pair[0]], tags[pair[1]], graph, pair)
           for pair in graph.ties if pair[0] in tags and pair[1] in tags}  # fmt: skip
    aside: set[int] = set()
    while True:
        blame: dict[int, tuple[float, float, int]] = {}
        for k in sorted(set(tags) - aside):
            mine = {pair: graph.ties[pair].matches for pair in bad if k in pair and not aside & set(pair)}
            against = sum(n for pair, n in mine.items() if bad[pair])
            if against and 2 * against >= sum(mine.values()):
                blame[k] = (round(against / sum(mine.values()), 3), round(doubts.get(k, 0.0), 1), against)
        if not blame:
            return aside
        aside.add(max(blame, key=lambda k: blame[k]))


def _agrees(a: PosePrior, b: PosePrior, graph: TieGraph, pair: tuple[int, int]) -> bool:
    tie = graph.ties[pair]
    turn, direction = tie_errors_deg(a.pose, b.pose, tie.rotation, tie.translation)
    length = max(float(np.linalg.norm(a.pose.center - b.pose.center)), 1e-9)
    blur = np.degrees(np.arctan(_DIRECTION_SIGMAS * float(np.hypot(a.position_sigma_m, b.position_sigma_m)) / length))
    return turn <= _TURN_DEG and direction <= _DIRECTION_DEG + blur


def _seen(tags: Mapping[int, PosePrior], graph: TieGraph, aside: set[int]) -> dict[int, SeenPose]:
    """Each photograph's pose without its own tag."""
    believed = {k for k in tags if k not in aside}
    tied = {k for pair in graph.ties for k in pair}
    lengths = [
        float(np.linalg.norm(tags[i].pose.center - tags[j].pose.center))
        for i, j in graph.ties if i in believed and j in believed
    ]  # fmt: skip
    length = float(np.median(lengths)) if lengths else 1.0
    start = spread_from({k: tags[k].pose for k in believed if k in tied}, graph, length)
    if len(start) < 2:
        return {}
    everything = solve(start, graph, tags, believed & set(start))
    matches = {k: sum(tie.matches for pair, tie in graph.ties.items() if k in pair) for k in start}
    found = {}
    for k in sorted(start):
        others = believed & set(start) - {k}
        if not _reached(k, others, graph):
            continue  # nothing but its own tag says where it is
        own: Solution = (
            everything if k not in believed else solve(everything.poses, graph, tags, others, iterations=_AGAIN)
        )
        found[k] = SeenPose(own.poses[k], own.covariance(k), matches[k])
    return found


def _reached(k: int, others: set[int], graph: TieGraph) -> bool:
    """Whether ties lead from a photograph to one whose tag is believed."""
    reached, new = {k}, {k}
    while new:
        new = {n for pair in graph.ties if set(pair) & reached for n in pair} - reached
        if new & others:
            return True
        reached |= new
    return False
