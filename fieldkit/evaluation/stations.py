"""Which photograph was taken at which planned station: by where and whither, never by order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from fieldkit.captures.flight_logs.adherence import REACH_M
from fieldkit.geometry.angles import wrapped_deg

_METRES_PER_DEGREE = 1.0 / 30.0
"""Weight of yaw and pitch, as of headings in `fieldkit.captures.flight_logs.adherence`."""
_SHIFT_PRICE = 0.02
"""Of a metre of common horizontal shift: of those that fit alike, as on a grid of stations, the smallest counts."""
_MOST_SHIFT_M = 10.0
"""Horizontally: beyond what a receiver without corrections is off, the photographs are of another plot."""
_BEST = 8
_ROUNDS = 4
_MOST_SHIFTS = 4000

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PoseArray:
    """n poses: positions (n, 3) metres, yaws and pitches (n,) degrees; NaN where an angle is not known."""

    positions: Array
    yaws: Array
    pitches: Array

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


def match_stations(
    photographs: PoseArray, stations: PoseArray, *, shift_m: Array | None = None
) -> tuple[Mapping[int, int], Array]:
    """Assign photographs to stations, whatever offset all their positions have in common.

    Candidates for the offset are 0 and the differences of all pairs, up to 10 m horizontally; the most promising are
    refined in turns with the assignment of the least sum of distances and angles (Hungarian method). A pair that costs
    more than `REACH_M` is none.

    Args:
        photographs: n poses.
        stations: m poses in the same frame.
        shift_m: (3,) the offset, photographs less stations, where it is known.

    Returns:
        Station by photograph, both by index, and the offset (3,): photographs less stations, median over the pairs;
        NaN without a pair.
    """
    if not len(photographs) or not len(stations):
        return {}, np.full(3, np.nan)
    if shift_m is not None:
        return _settled(photographs, stations, shift_m, rounds=1)
    best: tuple[float, Mapping[int, int], Array] = (np.inf, {}, np.full(3, np.nan))
    for candidate in _candidates(photographs, stations):
        pairs, shift = _settled(photographs, stations, candidate, rounds=_ROUNDS)
        price = _price(photographs, stations, pairs, shift)
        if price < best[0] - 1e-9:
            best = (price, pairs, shift)
    return best[1], best[2]


def _candidates(photographs: PoseArray, stations: PoseArray) -> Array:
    """(k, 3): the offsets under which photographs lie nearest to some station each."""
    differences = (photographs.positions[:, None] - stations.positions[None]).reshape(-1, 3)
    step = -(-len(differences) // _MOST_SHIFTS)
    shifts = np.concatenate([np.zeros((1, 3)), differences[::step]])
    shifts = shifts[np.hypot(shifts[:, 0], shifts[:, 1]) <= _MOST_SHIFT_M]
    prices = [
        np.minimum(_costs(photographs, stations, shift).min(axis=1), REACH_M).mean()
        + _SHIFT_PRICE * float(np.hypot(shift[0], shift[1]))
        for shift in shifts
    ]
    return np.asarray(shifts[np.argsort(prices, kind="stable")[:_BEST]])


def _settled(
    photographs: PoseArray, stations: PoseArray, shift: Array, *, rounds: int
) -> tuple[Mapping[int, int], Array]:
    pairs: Mapping[int, int] = {}
    for _ in range(rounds):
        worth = np.minimum(_costs(photographs, stations, shift) - REACH_M, 0.0)
        found = {int(a): int(b) for a, b in zip(*linear_sum_assignment(worth), strict=True) if worth[a, b] < 0.0}
        if not found:
            return {}, np.full(3, np.nan)
        apart = photographs.positions[list(found)] - stations.positions[list(found.values())]
        shift = np.median(apart, axis=0)
        if found == pairs:
            break
        pairs = found
    return pairs, shift


def _price(photographs: PoseArray, stations: PoseArray, pairs: Mapping[int, int], shift: Array) -> float:
    if not pairs:
        return float("inf")
    costs = _costs(photographs, stations, shift)
    total = sum(float(costs[a, b]) for a, b in pairs.items()) + REACH_M * (len(photographs) - len(pairs))
    return total / len(photographs) + _SHIFT_PRICE * float(np.hypot(shift[0], shift[1]))


def _costs(photographs: PoseArray, stations: PoseArray, shift: Array) -> Array:
    """(n, m) metres, angles weighed in where both are known."""
    distance = np.linalg.norm(photographs.positions[:, None] - shift - stations.positions[None], axis=2)
    yaw = wrapped_deg(photographs.yaws[:, None] - stations.yaws[None])
    pitch = photographs.pitches[:, None] - stations.pitches[None]
    turned = np.abs(np.nan_to_num(yaw)) + np.abs(np.nan_to_num(pitch))
    costs: Array = distance + turned * _METRES_PER_DEGREE
    return costs
