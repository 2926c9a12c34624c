"""How likely an assignment of photographs to triggers is. Pure functions; `matching` says what the model is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.special import log_ndtr, ndtr

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.vocabulary import SIGMA_OF_MEDIAN

_RARE = math.log(20.0)
"""Of 20 triggers one gives no photograph, of 20 photographs one is an extra: the price of either."""
_JITTERS_S = (0.01, 0.02, 0.05, 0.1, 0.2)
"""Standard deviations that shutter lag may have."""
_START_GATE_S = 0.6
"""Time to a trigger within which a photograph may be its own before the clock offset is refined, seconds."""
_GATE_SIGMAS = 4.0
"""Time to a trigger within which a photograph may be its own afterwards, in standard deviations of the lag."""
_PLACE_START_M = 3.0
"""Standard deviation of positions before anything is known of it, metres: that of consumer GPS."""
_PLACE_RANGE_M = (0.02, 10.0)
"""Least and largest standard deviation that positions may have, metres."""
_LEAST_AREA_M2 = 400.0
"""Least ground on which an extra photograph may have been taken, square metres."""
_LEAST_SPAN_S = 60.0
"""Least time in which an extra photograph may have been taken, seconds."""
_DRIFT_PAIRS = 8
"""Least number of pairs of which a clock's drift is fitted."""
_DRIFT_SPAN_S = 300.0
"""Least time over which a clock's drift is fitted, seconds."""
_DRIFT_LIMIT = 5e-4
"""Largest drift of a camera's clock, seconds per second: 43 s a day."""
_WORST = 1e6
"""Cost of a pair beyond the gates, above any other."""


@dataclass(frozen=True, eq=False)
class Observed:
    """What photographs and triggers say."""

    photo_time: FloatArray
    """(n,) seconds on the camera's clock; NaN where unknown."""
    trigger_time: FloatArray
    """(m,) seconds on the log's."""
    photo_place: FloatArray
    """(n, 2) metres, NaN where unknown."""
    trigger_place: FloatArray
    """(m, 2)."""
    burst: NDArray[np.int_]
    """(m,) which burst a trigger is of: a photograph's own is the one by the order within it."""
    whole_seconds: bool = field(init=False)
    """Whether the camera counts whole seconds only."""
    located: BoolArray = field(init=False)
    """(n,) whether a photograph says where it was taken."""

    def __post_init__(self) -> None:
        times = self.photo_time[np.isfinite(self.photo_time)]
        object.__setattr__(self, "whole_seconds", bool(len(times)) and bool((times == np.round(times)).all()))
        object.__setattr__(self, "located", np.isfinite(self.photo_place).all(axis=1))

    @property
    def start_gate_s(self) -> float:
        """How far off a photograph may be at an offset that nothing has refined yet."""
        return _START_GATE_S + 0.5 * self.whole_seconds

    @property
    def span_s(self) -> float:
        """Of time in which an extra photograph may have been taken."""
        times = self.photo_time[np.isfinite(self.photo_time)]
        return max(_LEAST_SPAN_S, float(np.ptp(times)) if len(times) else 0.0)

    @property
    def area_m2(self) -> float:
        """Of the ground on which an extra photograph may have been taken."""
        known = self.trigger_place[np.isfinite(self.trigger_place).all(axis=1)]
        return max(_LEAST_AREA_M2, float(np.prod(np.ptp(known, axis=0) + 10.0))) if len(known) else _LEAST_AREA_M2

    def places_agree(self, pairs: dict[int, int]) -> bool:
        """Whether the places confirm these pairs: known for all, and within metres."""
        if not pairs:
            return False
        apart = np.linalg.norm(self.photo_place[list(pairs)] - self.trigger_place[list(pairs.values())], axis=1)
        return bool(np.isfinite(apart).all()) and float(np.median(apart)) < 2.0 * _PLACE_START_M

    def only_places(self, photographs: Sequence[int], triggers: Sequence[int]) -> Observed | None:
        """Some photographs and triggers, without their times; None where there are no places to compare."""
        i, j = np.array(photographs, dtype=int), np.array(triggers, dtype=int)
        if not len(i) or not len(j) or not self.located[i].any():
            return None
        times = np.full(len(i), np.nan)
        return Observed(times, self.trigger_time[j], self.photo_place[i], self.trigger_place[j], self.burst[j])


@dataclass(frozen=True, eq=False)
class Fit:
    """How the camera's clock and positions relate to the log's."""

    offset_s: float
    """Camera's clock less the log's at ``zero_s``; NaN where times are not compared."""
    rate: float
    """How much faster the camera's clock runs."""
    zero_s: float
    """On the log's clock."""
    jitter_s: float
    """Standard deviation of the times, beside the rounding to whole seconds."""
    gate_s: float
    """Photographs farther off belong to no trigger."""
    shift_m: FloatArray
    """(2,) camera's positions less the log's."""
    place_m: float
    """Standard deviation of the positions, per axis."""

    @classmethod
    def start(cls, observed: Observed, offset_s: float | None) -> Fit:
        """Before anything is known beside a clock offset."""
        zero = float(observed.trigger_time.min())
        offset = float("nan") if offset_s is None else offset_s
        return cls(offset, 0.0, zero, _JITTERS_S[-1], observed.start_gate_s, np.zeros(2), _PLACE_START_M)

    def residual(self, photo_s: FloatArray | float, trigger_s: FloatArray | float) -> FloatArray:
        """Of times, seconds."""
        return np.asarray(photo_s - trigger_s - self.offset_s - self.rate * (np.asarray(trigger_s) - self.zero_s))

    def pair_costs(self, observed: Observed, i: NDArray[np.int_], j: NDArray[np.int_]) -> FloatArray:
        """(k,) negative log-likelihoods of pairs, infinite beyond the gates."""
        cost = np.zeros(len(i))
        if math.isfinite(self.offset_s):
            residual = self.residual(observed.photo_time[i], observed.trigger_time[j])
            known = np.isfinite(residual)
            cost[known] += _time_cost(residual[known], self.jitter_s, observed.whole_seconds)
            cost[~known] = np.inf
            cost[known & (np.abs(residual) > self.gate_s)] = np.inf
        apart = observed.photo_place[i] - observed.trigger_place[j] - self.shift_m
        square = (apart**2).sum(axis=1)
        known = np.isfinite(square)
        cost[known] += square[known] / (2.0 * self.place_m**2) + math.log(2.0 * math.pi * self.place_m**2)
        # What says nothing of its place is as likely here as anywhere.
        cost[~known] += np.where(math.isfinite(self.offset_s), 0.0, np.inf) if (~known).any() else 0.0
        cost[~known & observed.located[i]] += math.log(observed.area_m2)
        return cost

    def extra_costs(self, observed: Observed) -> FloatArray:
        """(n,) negative log-likelihood of each photograph as an extra one, over its timed and located parts."""
        cost = np.full(len(observed.photo_time), _RARE)
        if math.isfinite(self.offset_s):
            cost += math.log(observed.span_s)
        return np.asarray(cost + np.where(observed.located, math.log(observed.area_m2), 0.0))

    def cost(self, observed: Observed, pairs: dict[int, int]) -> float:
        """Negative log-likelihood of an assignment of all photographs and triggers."""
        i, j = _indices(pairs)
        extra = self.extra_costs(observed)
        total = float(self.pair_costs(observed, i, j).sum()) + float(np.delete(extra, i).sum())
        return total + _RARE * (len(observed.trigger_time) - len(pairs))

    def evidence(self, observed: Observed, pairs: dict[int, int]) -> float:
        """How much likelier the photographs' times are with these triggers than at any times at all, as a logarithm.

        Triggers before the first and after the last photograph count for nothing: they may be of another plot.
        """
        timed = np.isfinite(observed.photo_time)
        i, j = _indices(pairs)
        residual = self.residual(observed.photo_time[i], observed.trigger_time[j])
        gain = len(i) * math.log(observed.span_s) - _time_cost(residual, self.jitter_s, observed.whole_seconds).sum()
        at = self.residual(np.zeros(1), observed.trigger_time)  # less each trigger's time on the camera's clock
        times = observed.photo_time[timed]
        between = int(((-at >= times.min()) & (-at <= times.max())).sum())
        lone = max(0, between - len(i)) + int(timed.sum()) - len(i)
        return float(gain) - _RARE * lone

    def handicap(self, observed: Observed, own: dict[int, int], others: dict[int, int]) -> float:
        """What another assignment pays for the one photograph missing and one extra that it has more than this one.

        One of each happens on many flights; more than that counts against an assignment in full.
        """
        most = min(int(np.isfinite(observed.photo_time).sum()), len(observed.trigger_time))
        if not most - 1 <= len(others) < len(own):
            return 0.0
        return _RARE + float(self.extra_costs(observed).max(initial=0.0))


def fit_to(observed: Observed, before: Fit, pairs: dict[int, int]) -> Fit:
    """The clock, jitter and positions at which these pairs are likeliest."""
    i, j = _indices(pairs)
    if len(i) == 0:
        return before
    fit = before
    photo, trigger = observed.photo_time[i], observed.trigger_time[j]
    timed = np.isfinite(photo)
    if math.isfinite(before.offset_s) and timed.any():
        offset, rate = _line(photo[timed] - trigger[timed], trigger[timed] - before.zero_s, observed.whole_seconds)
        fit = replace(fit, offset_s=offset, rate=rate)
        residual = fit.residual(photo[timed], trigger[timed])
        costs = [float(_time_cost(residual, s, observed.whole_seconds).sum()) for s in _JITTERS_S]
        jitter = _JITTERS_S[int(np.argmin(costs))]
        gate = _GATE_SIGMAS * max(jitter, 0.05) + 0.5 * observed.whole_seconds
        fit = replace(fit, jitter_s=jitter, gate_s=gate)
    apart = observed.photo_place[i] - observed.trigger_place[j]
    apart = apart[np.isfinite(apart).all(axis=1)]
    if len(apart) >= 3:
        shift = np.median(apart, axis=0)
        spread = SIGMA_OF_MEDIAN * float(np.median(np.abs(apart - shift)))
        fit = replace(fit, shift_m=shift, place_m=float(np.clip(spread, *_PLACE_RANGE_M)))
    return fit


def _indices(pairs: dict[int, int]) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """(k,) photographs and (k,) triggers."""
    return np.array(list(pairs), dtype=int), np.array(list(pairs.values()), dtype=int)


def assign(observed: Observed, fit: Fit, doubt: float) -> tuple[dict[int, int], set[int]]:
    """The likeliest assignment, and the photographs left out because another is nearly as likely.

    A photograph whose next best partner costs less than ``doubt`` more is left out.
    """
    extra = fit.extra_costs(observed)
    pairs: dict[int, int] = {}
    doubtful: set[int] = set()
    blocks = _blocks(observed, fit)
    lone = [(i[0], j[0]) for i, j in blocks if len(i) == len(j) == 1]
    if lone:  # most of them, at once
        one, other = np.array(lone).T
        worth = fit.pair_costs(observed, one, other) < extra[one] + _RARE
        pairs |= {int(i): int(j) for i, j in zip(one[worth], other[worth], strict=True)}
    for photos, triggers in blocks:
        if len(photos) == len(triggers) == 1:
            continue
        i, j = np.meshgrid(photos, triggers, indexing="ij")
        # Relative to leaving both alone: a pair is worth it where this is negative.
        cost = fit.pair_costs(observed, i.ravel(), j.ravel()).reshape(i.shape) - extra[photos][:, None] - _RARE
        cost = np.minimum(np.where(np.isfinite(cost), cost, _WORST), _WORST)
        rows, columns, total = _solve(cost)
        for a, b in zip(rows, columns, strict=True):
            rivals = [int(photos[k]) for k in np.flatnonzero(cost[:, b] < 0.0) if k != a]
            alike = observed.burst[triggers] == observed.burst[triggers[b]]
            if (rivals or (cost[a, ~alike] < 0.0).any()) and _without(cost, a, alike) - total < doubt:
                doubtful |= {int(photos[a]), *rivals}
            else:
                pairs[int(photos[a])] = int(triggers[b])
    return _in_order(observed, pairs), doubtful - pairs.keys()


def _in_order(observed: Observed, pairs: dict[int, int]) -> dict[int, int]:
    """Pairs whose photographs follow each other within a burst as its triggers do; of one time as they are numbered."""
    photos = sorted(pairs, key=lambda i: (observed.burst[pairs[i]], np.nan_to_num(observed.photo_time[i]), i))
    of = dict(zip(photos, sorted(pairs.values()), strict=True))
    return {i: of[i] for i in pairs}


def _without(cost: FloatArray, a: int, b: BoolArray) -> float:
    """Cost of the best assignment without pairs of a and b."""
    other = cost.copy()
    other[a, b] = _WORST
    return _solve(other)[2]


def _solve(cost: FloatArray) -> tuple[NDArray[np.int_], NDArray[np.int_], float]:
    """Pairs of the cheapest assignment in which leaving out costs nothing."""
    rows, columns = linear_sum_assignment(np.minimum(cost, 0.0))
    worth = cost[rows, columns] < 0.0
    return rows[worth], columns[worth], float(cost[rows[worth], columns[worth]].sum())


def _blocks(observed: Observed, fit: Fit) -> list[tuple[NDArray[np.int_], NDArray[np.int_]]]:
    """Photographs and triggers in groups that cannot be paired across: the gate's gaps in time, or all in one."""
    if not math.isfinite(fit.offset_s):
        return [(np.flatnonzero(observed.located), np.arange(len(observed.trigger_time)))]
    photos = np.flatnonzero(np.isfinite(observed.photo_time))
    expected = observed.trigger_time + fit.offset_s + fit.rate * (observed.trigger_time - fit.zero_s)
    times = np.concatenate([observed.photo_time[photos], expected])
    order = np.argsort(times, kind="stable")
    blocks = []
    for part in np.split(order, np.flatnonzero(np.diff(times[order]) > fit.gate_s) + 1):
        i, j = photos[part[part < len(photos)]], part[part >= len(photos)] - len(photos)
        if len(i) and len(j):
            blocks.append((i, j))
    return blocks


def _time_cost(residual: FloatArray, jitter_s: float, whole_seconds: bool) -> FloatArray:
    """Negative log density of times: Gaussian, or Gaussian convolved with one second that rounding takes."""
    if not whole_seconds:
        return np.asarray(0.5 * (residual / jitter_s) ** 2 + math.log(jitter_s * math.sqrt(2.0 * math.pi)))
    r = np.abs(residual)
    share = ndtr((r + 0.5) / jitter_s) - ndtr((r - 0.5) / jitter_s)
    return np.asarray(np.where(share > 1e-9, -np.log(np.maximum(share, 1e-300)), -log_ndtr(-(r - 0.5) / jitter_s)))


def _line(difference: FloatArray, elapsed: FloatArray, whole_seconds: bool) -> tuple[float, float]:
    """Offset and rate of differences over time. Rounded times are uniform about the line: the middle of their range."""
    rate = 0.0
    if len(difference) >= _DRIFT_PAIRS and float(np.ptp(elapsed)) > _DRIFT_SPAN_S:
        rate = float(np.clip(np.polyfit(elapsed, difference - difference[0], 1)[0], -_DRIFT_LIMIT, _DRIFT_LIMIT))
    flat = difference - rate * elapsed
    if whole_seconds:
        return 0.5 * (float(flat.min()) + float(flat.max())), rate
    return float(np.median(flat)), rate
