"""Whose tags contradict what the photographs show.

Ties say how cameras stand to each other, tags where each stands. First the tags are laid aside, one by one, that
contradict most of their ties; then every tag is compared with the pose that its photograph has by its ties and the
others' tags, and laid aside or taken back, until nothing changes.

That pose is of least squares on relative rotations, directions and lengths' ratios. Unknown are each photograph's
rotation and centre. A tie gives the rotation and the direction between two cameras, two ties of a camera the ratio of
their lengths, a tag a pose. Blocks that do not fit weigh less (Cauchy, by reweighting), so that a wrong tie does no
harm.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.fieldcheck.settings import CheckSettings
from fieldkit.fieldcheck.ties import TieGraph, tie_errors_deg
from fieldkit.geometry import Pose
from fieldkit.geometry.priors import PosePrior

_TURN_DEG = 12.0
"""Largest turn between two tags and their tie for these to agree, degrees."""
_DIRECTION_DEG = 20.0
"""Largest angle between two tags' direction and their tie's, beside what positions blur, degrees."""
_DIRECTION_SIGMAS = 3.7
"""Standard deviations of positions that blur a direction."""
_CONTRADICTS = 4.0
"""Excess over what was asked for from which photographs contradict a tag."""
_AGREES = 3.0
"""Excess below which a tag that was laid aside agrees again."""
_CERTAIN_MATCHES = 40
"""Matches of a tie from which it is certain: on simulated plots ties of up to 34 called sound photographs wrong in
wind."""
_GROSS = 16.0
"""Excess from which a photograph with uncertain ties alone is off: sound ones were up to 11.4 off by such ties,
exchanged ones 24 and more."""
_MOST_ROUNDS = 30
"""Most tags that are laid aside or taken back."""
_ROTATION_DEG = 0.8
"""Least standard deviation of a tie's rotation, degrees."""
_ROTATION_PER_ROOT_DEG = 8.0
"""Standard deviation of a tie's rotation times the root of its matches, degrees."""
_DIRECTION_SIGMA_DEG = 2.0
"""Least standard deviation of a tie's direction, degrees."""
_DIRECTION_PER_ROOT_DEG = 20.0
"""Standard deviation of a tie's direction times the root of its matches, degrees."""
_CAUCHY = 3.0
"""Scale of the loss, in standard deviations."""
_LOOSE_M = 1.5
"""Standard deviation of positions that are not believed, metres: nothing stays undetermined."""
_LOOSE_DEG = 60.0
"""Standard deviation of angles that are not believed, degrees."""
_STEP = 1e-6
"""Step of numeric derivatives, radians and metres."""
_SETTLED = 3e-4
"""Step below which a solution has settled, radians and metres."""
_AGAIN = 6
"""Iterations from all tags' solution to the one without a tag."""

Block = tuple[IntArray, Callable[[list[FloatArray]], FloatArray], FloatArray]
"""(m, k) indices of m blocks' cameras; their residuals (m, r) from the k cameras' parameters (m, 6) each; the
residuals' standard deviations (m, r)."""


@dataclass(frozen=True, eq=False)
class SeenPose:
    """A photograph's pose by its ties and the other photographs' tags, without its own."""

    pose: Pose
    """In the plan's frame."""
    covariance: FloatArray
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
            float(np.linalg.norm(shift)),
            float(np.sqrt(shift @ np.linalg.solve(spread_shift, shift))),
            float(np.degrees(np.linalg.norm(turn))),
            float(np.sqrt(turn @ np.linalg.solve(spread_turn, turn))),
        )


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
        doubts: how far tags are from what was planned, metres: of two that contradict each other, and nothing else,
            the one that is farther off is to blame.
    """
    aside = _laid_aside(tags, graph, doubts or {})
    tried: set[frozenset[int]] = set()
    seen: dict[int, SeenPose] = {}
    excess: dict[int, float] = {}
    for _ in range(_MOST_ROUNDS):
        seen = _seen(tags, graph, aside)
        excess = {
            k: s.compare(tags[k].pose, tags[k].position_sigma_m, tags[k].angle_sigma_deg).excess(settings)
            for k, s in seen.items()
            if k in tags
        }
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
    bad = {
        pair: not _agrees(tags[pair[0]], tags[pair[1]], graph, pair)
        for pair in graph.ties
        if pair[0] in tags and pair[1] in tags
    }
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
        for i, j in graph.ties
        if i in believed and j in believed
    ]
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


@dataclass(frozen=True, eq=False)
class Solution:
    """Adjusted poses."""

    poses: Mapping[int, Pose]
    index: Mapping[int, int]
    """Of a photograph among the unknowns."""
    information: FloatArray
    """(6n, 6n) inverse of the covariance; six unknowns each: a rotation vector in the camera's axes, radians, and the
    centre, metres."""

    def covariance(self, k: int) -> FloatArray:
        """(6, 6) of one photograph."""
        at = 6 * self.index[k]
        columns = np.zeros((len(self.information), 6))
        columns[at : at + 6] = np.eye(6)
        return np.asarray(np.linalg.solve(self.information, columns)[at : at + 6])


def solve(
    start: Mapping[int, Pose],
    graph: TieGraph,
    tags: Mapping[int, PosePrior],
    believed: Collection[int],
    *,
    iterations: int = 12,
) -> Solution:
    """Adjust the poses of the photographs in ``start``.

    Ties of photographs without a start are left out. Tags that are not ``believed`` are held so loosely that nothing
    stays undetermined.
    """
    order = sorted(start)
    index = {k: n for n, k in enumerate(order)}
    rotations = np.array([start[k].rotation for k in order])
    centers = np.array([start[k].center for k in order])
    targets = [tags[k].pose if k in believed else start[k] for k in order]
    sigmas = np.array(
        [
            [np.radians(tags[k].angle_sigma_deg)] * 3 + [tags[k].position_sigma_m] * 3
            if k in believed
            else [np.radians(_LOOSE_DEG)] * 3 + [_LOOSE_M] * 3
            for k in order
        ]
    )
    blocks = _blocks(graph, index, targets, sigmas)
    information = np.eye(6 * len(order))
    damping = 1e-4
    for _ in range(iterations):
        information, gradient = _normal(blocks(rotations), centers)
        step = np.linalg.solve(information + damping * np.diag(np.diag(information)), -gradient).reshape(-1, 6)
        rotations = Rotation.from_rotvec(np.clip(step[:, :3], -0.5, 0.5)).as_matrix() @ rotations
        centers = np.asarray(centers + np.clip(step[:, 3:], -1.0, 1.0), np.float64)
        if np.abs(step).max() < _SETTLED:
            break
    poses = {k: Pose(rotations[n], centers[n]) for k, n in index.items()}
    return Solution(poses, index, information)


def spread_from(known: Mapping[int, Pose], graph: TieGraph, length_m: float) -> dict[int, Pose]:
    """Poses of the photographs that ties reach from known ones, the strongest tie first; the known ones are in it."""
    found = dict(known)
    while True:
        reach = [(tie.matches, pair) for pair, tie in graph.ties.items() if (pair[0] in found) != (pair[1] in found)]
        if not reach:
            return found
        _, (i, j) = max(reach)
        tie = graph.ties[i, j]
        if i in found:
            rotation = tie.rotation @ found[i].rotation
            found[j] = Pose(rotation, found[i].center - length_m * rotation.T @ tie.translation)
        else:
            along = found[j].rotation.T @ tie.translation
            found[i] = Pose(tie.rotation.T @ found[j].rotation, found[j].center + length_m * along)


def _blocks(
    graph: TieGraph, index: Mapping[int, int], targets: Sequence[Pose], sigmas: FloatArray
) -> Callable[[FloatArray], list[Block]]:
    """The blocks of ties, ratios and tags about rotations (n, 3, 3), which steps are counted from."""
    pairs = [pair for pair in sorted(graph.ties) if pair[0] in index and pair[1] in index]
    ties = [graph.ties[pair] for pair in pairs]
    kept = [r for r in graph.ratios if r.middle in index and r.a in index and r.b in index]
    ends = np.array([[index[i], index[j]] for i, j in pairs], dtype=np.int64).reshape(-1, 2)
    tied = np.array([tie.rotation for tie in ties]).reshape(-1, 3, 3)
    translations = np.array([tie.translation for tie in ties]).reshape(-1, 3)
    root = np.maximum(np.sqrt(np.array([tie.matches for tie in ties], dtype=np.float64)), 1.0)
    of_turn = np.radians(np.maximum(_ROTATION_DEG, _ROTATION_PER_ROOT_DEG / root))
    of_direction = np.radians(np.maximum(_DIRECTION_SIGMA_DEG, _DIRECTION_PER_ROOT_DEG / root))
    thirds = np.array([[index[r.middle], index[r.a], index[r.b]] for r in kept], dtype=np.int64).reshape(-1, 3)
    logs, of_ratio = np.array([[r.log_ratio] for r in kept]).reshape(-1, 1), np.array([[r.sigma] for r in kept])
    wanted = np.array([pose.rotation for pose in targets])
    places = np.array([pose.center for pose in targets])

    def about(rotations: FloatArray) -> list[Block]:
        of_i, of_j = (rotations[ends[:, n]] for n in (0, 1))

        def turn(p: list[FloatArray]) -> FloatArray:
            i, j = _turned(p[0], of_i), _turned(p[1], of_j)
            return _log(np.swapaxes(tied, 1, 2) @ j @ np.swapaxes(i, 1, 2))

        def direction(p: list[FloatArray]) -> FloatArray:
            apart = np.einsum("nij,nj->ni", _turned(p[1], of_j), p[0][:, 3:] - p[1][:, 3:])
            unit = apart / np.maximum(np.linalg.norm(apart, axis=1, keepdims=True), 1e-9)
            return np.asarray(unit - translations)

        def ratio(p: list[FloatArray]) -> FloatArray:
            first, second = (
                np.maximum(np.linalg.norm(p[0][:, 3:] - other[:, 3:], axis=1, keepdims=True), 1e-6) for other in p[1:]
            )
            return np.asarray(np.log(first) - np.log(second) - logs)

        def prior(p: list[FloatArray]) -> FloatArray:
            return np.concatenate(
                [_log(_turned(p[0], rotations) @ np.swapaxes(wanted, 1, 2)), p[0][:, 3:] - places], axis=1
            )

        blocks: list[Block] = [
            (ends, turn, np.repeat(of_turn[:, None], 3, axis=1)),
            (ends, direction, np.repeat(of_direction[:, None], 3, axis=1)),
            (thirds, ratio, of_ratio),
            (np.arange(len(targets))[:, None], prior, sigmas),
        ]
        return [block for block in blocks if len(block[0])]

    return about


def _turned(parameters: FloatArray, rotations: FloatArray) -> FloatArray:
    return np.asarray(Rotation.from_rotvec(parameters[:, :3]).as_matrix() @ rotations)


def _log(matrices: FloatArray) -> FloatArray:
    return np.asarray(Rotation.from_matrix(matrices).as_rotvec())


def _normal(blocks: Sequence[Block], centers: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Information matrix and gradient of all blocks, reweighted; parameters are 0 for rotations."""
    count = len(centers)
    information, gradient = np.zeros((6 * count, 6 * count)), np.zeros(6 * count)
    zero = np.concatenate([np.zeros((count, 3)), centers], axis=1)
    for ends, function, sigmas in blocks:
        parameters = [zero[ends[:, n]] for n in range(ends.shape[1])]
        residual = function(parameters) / sigmas
        jacobian = np.zeros((*residual.shape, 6 * ends.shape[1]))
        for n in range(ends.shape[1]):
            for q in range(6):
                moved = [p.copy() for p in parameters]
                moved[n][:, q] += _STEP
                jacobian[:, :, 6 * n + q] = (function(moved) / sigmas - residual) / _STEP
        weight = 1.0 / (1.0 + (residual**2).sum(axis=1) / (_CAUCHY**2 * residual.shape[1]))
        columns = (6 * ends[:, :, None] + np.arange(6)).reshape(len(ends), -1)
        weighted = weight[:, None, None] * np.swapaxes(jacobian, 1, 2)
        np.add.at(information, (columns[:, :, None], columns[:, None, :]), weighted @ jacobian)
        np.add.at(gradient, columns, (weighted @ residual[:, :, None])[:, :, 0])
    return information, gradient
