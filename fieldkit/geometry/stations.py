"""Which photograph was taken at which station: by where and whither, never by order.

What all photographs have in common is found and taken out first: a receiver's offset, the datum of heights, a compass's
error. What is left is the shape, which tells a photograph that is not where the others say it should be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fieldkit.arrays import FloatArray
from fieldkit.geometry.pose import wrapped_deg

REACH_M = 3.0
"""A photograph that costs more (`pose_costs`) does not belong to a station: those that come late are up to 1.8 m off,
and those in passing up to 62°."""
METRES_PER_DEGREE = 1.0 / 30.0
"""Weight of angles: stations on a ring of 13 differ by 28° and 1.2 m."""
MOST_OFFSET_M = 10.0
"""Horizontally: beyond what a receiver without corrections is off, the photographs are of another plot."""
_OFFSET_PRICE = 0.02
"""Of a metre of common horizontal offset: of those that fit alike, as on a grid of stations, the smallest counts."""
_APART_M = 0.25
"""Distance between offsets that are tried, metres."""
_BEST = 12
"""Most offsets that are refined."""
_ROUNDS = 4
"""Most rounds of pairing and fitting in turn."""
_MOST_CANDIDATES = 4000
"""Most offsets that are looked at."""
_LEAST = 3
"""Pairs that tell a common error of headings, or a turn of the frame."""


@dataclass(frozen=True, eq=False)
class PoseArray:
    """n poses: positions (n, 3) metres, z up; yaws (clockwise from +y) and pitches (n,) degrees; NaN: not known.

    A pose without x and y has no place; one without z is compared by x and y alone.
    """

    positions: FloatArray
    yaws: FloatArray
    pitches: FloatArray

    @classmethod
    def of(cls, poses: Sequence[tuple[Sequence[float], float | None, float | None]]) -> PoseArray:
        """From positions, yaws and pitches; None where an angle is not known."""
        return cls(
            np.array([p for p, _, _ in poses], dtype=np.float64).reshape(-1, 3),
            np.array([np.nan if y is None else y for _, y, _ in poses], dtype=np.float64),
            np.array([np.nan if p is None else p for _, _, p in poses], dtype=np.float64),
        )

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, index: Any) -> PoseArray:
        """As of an array (n,): ``poses[:, None]`` has a second axis."""
        return PoseArray(self.positions[index], self.yaws[index], self.pitches[index])

    def moved(self, turn_deg: float, shift_m: FloatArray | float = 0.0, heading_deg: float = 0.0) -> PoseArray:
        """Turned clockwise about z, then shifted (3,); headings turn along, and by ``heading_deg`` besides."""
        c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
        x, y, z = self.positions.T
        turned = np.stack([c * x + s * y, c * y - s * x, z], axis=1)
        return PoseArray(turned + shift_m, self.yaws + turn_deg + heading_deg, self.pitches)


@dataclass(frozen=True, eq=False)
class Association:
    """Photographs and their stations."""

    station_of: Mapping[int, int] = field(default_factory=dict)
    """Station by photograph, both by index."""
    offset_m: FloatArray = field(default_factory=lambda: np.full(3, np.nan))
    """(3,) photographs less stations, median over the pairs; NaN where not known."""
    heading_deg: float = 0.0
    """Of photographs less stations: what all headings have in common."""
    mean_cost_m: float = float("inf")
    """Over all photographs with a place, those without a station at `REACH_M`."""


def pose_costs(a: PoseArray, b: PoseArray) -> FloatArray:
    """Metres between poses, angles weighed in where both are known; shapes broadcast, NaN without a place."""
    yaw = np.nan_to_num(wrapped_deg(a.yaws - b.yaws))
    pitch = np.nan_to_num(a.pitches - b.pitches)
    return _lengths(a.positions - b.positions) + (np.abs(yaw) + np.abs(pitch)) * METRES_PER_DEGREE


def _lengths(apart: FloatArray) -> FloatArray:
    """Of differences (…, 3); horizontal ones where no height is known."""
    up = np.nan_to_num(apart[..., 2])
    lengths: FloatArray = np.sqrt(apart[..., 0] ** 2 + apart[..., 1] ** 2 + up**2)
    return lengths


def associate(
    photographs: PoseArray,
    stations: PoseArray,
    *,
    offset_m: FloatArray | None = None,
    most_offset_m: float = MOST_OFFSET_M,
) -> Association:
    """Assign photographs to stations by their poses, whatever error all of them have in common.

    The assignment is the one with the least sum of costs (Hungarian method); a pair that costs more than `REACH_M` is
    none, and leaving a photograph alone costs as much, so that one of each does not shift all the others. Candidates
    for the offset are 0 and the differences of all pairs; the most promising are refined in turns with the assignment,
    and so is the error of headings. There are no pairs where none is near enough.

    Args:
        photographs: n poses.
        stations: m poses, in the same frame.
        offset_m: (3,) the offset, photographs less stations, where it is known; then nothing else is taken out.
        most_offset_m: horizontally, where it is not known.
    """
    placed = np.flatnonzero(np.isfinite(photographs.positions[:, :2]).all(axis=1))
    if not len(placed) or not len(stations):
        return Association()
    these = photographs[placed]
    if offset_m is not None:
        best = _settled(these, stations, offset_m, rounds=1)
    else:
        found = [
            _settled(these, stations, candidate, rounds=_ROUNDS)
            for candidate in _candidates(these, stations, most_offset_m)
        ]
        best = min(found, key=lambda each: round(_price(each), 9))
    return replace(best, station_of={int(placed[a]): b for a, b in best.station_of.items()})


def _price(found: Association) -> float:
    return found.mean_cost_m + _OFFSET_PRICE * float(np.hypot(*np.nan_to_num(found.offset_m[:2])))


def _candidates(photographs: PoseArray, stations: PoseArray, most_offset_m: float) -> list[FloatArray]:
    """(3,) each: the offsets under which photographs lie nearest to some station, the best first."""
    apart = photographs.positions[:, None] - stations.positions
    offsets = apart.reshape(-1, 3)
    offsets = offsets[np.hypot(offsets[:, 0], offsets[:, 1]) <= most_offset_m]
    offsets = np.concatenate([np.zeros((1, 3)), offsets[:: -(-len(offsets) // _MOST_CANDIDATES) or 1]])
    turns = pose_costs(_in_place(photographs)[:, None], _in_place(stations))
    prices = np.empty(len(offsets))
    for k, offset in enumerate(offsets):
        costs = _lengths(apart - offset) + turns
        prices[k] = np.minimum(costs.min(axis=1), REACH_M).mean() + _OFFSET_PRICE * np.hypot(offset[0], offset[1])
    chosen: list[FloatArray] = []
    for offset in offsets[np.argsort(prices, kind="stable")]:
        if all(np.linalg.norm(np.nan_to_num(offset - other)) > _APART_M for other in chosen):
            chosen.append(offset)
            if len(chosen) == _BEST:
                break
    return chosen


def _in_place(poses: PoseArray) -> PoseArray:
    return PoseArray(np.zeros_like(poses.positions), poses.yaws, poses.pitches)


def _settled(photographs: PoseArray, stations: PoseArray, offset: FloatArray, *, rounds: int) -> Association:
    """Assign, and take out what is common to the assigned, a few times."""
    heading = 0.0
    pairs: dict[int, int] = {}
    for _ in range(rounds):
        found = _assigned(photographs.moved(0.0, -offset, -heading), stations)
        if not found:
            return Association()
        if found == pairs:
            break
        pairs = found
        mine, theirs = photographs[list(pairs)], stations[list(pairs.values())]
        offset = _medians(mine.positions - theirs.positions)
        if rounds > 1:
            errors = wrapped_deg(mine.yaws - theirs.yaws)
            errors = errors[np.isfinite(errors)]
            heading = float(np.median(errors)) if len(errors) >= _LEAST else 0.0
    costs = pose_costs(photographs.moved(0.0, -offset, -heading)[list(pairs)], stations[list(pairs.values())])
    mean = (float(costs.sum()) + REACH_M * (len(photographs) - len(pairs))) / len(photographs)
    return Association(pairs, offset, heading, mean)


def _assigned(photographs: PoseArray, stations: PoseArray) -> dict[int, int]:
    """Pairs of the least sum of costs; groups that are out of each other's reach are assigned by themselves."""
    trees = (cKDTree(poses.positions[:, :2]) for poses in (photographs, stations))
    near = next(trees).sparse_distance_matrix(next(trees), REACH_M, output_type="ndarray")
    a, b = near["i"], near["j"]
    worth = pose_costs(photographs[a], stations[b]) - REACH_M
    a, b, worth = a[worth < 0.0], b[worth < 0.0], worth[worth < 0.0]
    size = len(photographs) + len(stations)
    links = coo_array((np.ones(len(a)), (a, b + len(photographs))), shape=(size, size))
    _, group_of = connected_components(links, directed=False)
    pairs = {}
    for group in np.unique(group_of[a]):
        here = group_of[a] == group
        rows, row = np.unique(a[here], return_inverse=True)
        columns, column = np.unique(b[here], return_inverse=True)
        table = np.zeros((len(rows), len(columns)))
        table[row, column] = worth[here]
        for i, j in zip(*linear_sum_assignment(table), strict=True):
            if table[i, j] < 0.0:
                pairs[int(rows[i])] = int(columns[j])
    return dict(sorted(pairs.items()))


def _medians(apart: FloatArray) -> FloatArray:
    """(3,) of those that are known."""
    known = [column[np.isfinite(column)] for column in apart.T]
    return np.array([np.median(column) if len(column) else np.nan for column in known])


def turn_between(source: FloatArray, target: FloatArray) -> float:
    """Clockwise turn about z, degrees, that brings points (k, 3) nearest to others, shifts left out."""
    a, b = (p[:, :2] - np.median(p[:, :2], axis=0) for p in (source, target))
    return float(np.degrees(np.arctan2((a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]).sum(), (a * b).sum())))
