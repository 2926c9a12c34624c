"""Upright prisms as arrays, and exact tests of straight legs against many of them."""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from fieldkit.arrays import BoolArray, FloatArray, IntArray
from fieldkit.runtime.kernels import kernel

_ROUNDING_M = 1e-9
"""Length that rounding may make of none, metres."""
_BLOCK = 16  # solids that are looked at only if a leg comes near any of them
_THIRDS = 60
"""Steps by a third that find a leg's nearest place to 1e-10 of its length."""
_EACH, _ANY, _ONCE = range(3)
"""Of `_entries`: all solids count for every leg; one is enough for a leg; or a solid that was met is not used again."""
_TURNS = np.pi / 8 * np.arange(8)
_AXES = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1)


@dataclass(frozen=True, eq=False)
class Prisms:
    """Solids that reach from below everything up to a height, with e edges in plan in all.

    Their sides belong to them, their tops do not: a leg along a side is in, one along the top is clear. What part of a
    leg is in a solid begins and ends at its own ends, where it crosses an edge, or where it sinks through the top; and
    as its height changes evenly, its lowest place in there is one of these. So these places are all that is tested.
    """

    edges: FloatArray
    """(e, 4) x and y of both ends; a place is in the plan where a ray from it crosses an odd number."""
    first: IntArray
    """(count + 1,) each solid's first edge."""
    tops: FloatArray
    """(count,) metres, infinite where nothing is above it."""
    spans: FloatArray
    """(count, 8, 2) least and greatest place along eight axes, 22.5° apart. A leg whose span along one of them is
    beside a solid's does not come near it."""
    blocks: FloatArray
    """(⌈count / 16⌉, 8, 2) the same of that many solids after one another."""
    block_tops: FloatArray
    """Their highest tops."""

    @classmethod
    def of(cls, solids: Sequence[tuple[BaseGeometry, float]]) -> Prisms:
        """Solids as their plan, a valid polygon or several, or a point, and their top."""
        edges = [_edges(plan) for plan, _ in solids]
        tops = np.array([top for _, top in solids], dtype=np.float64)
        spans = np.array([_spans(some) for some in edges]).reshape(-1, len(_AXES), 2)
        parts = [slice(k, k + _BLOCK) for k in range(0, len(tops), _BLOCK)]
        blocks = [np.stack([spans[k, :, 0].min(axis=0), spans[k, :, 1].max(axis=0)], axis=1) for k in parts]
        return cls(
            np.ascontiguousarray(np.concatenate([np.zeros((0, 4)), *edges])),
            np.cumsum([0, *(len(some) for some in edges)], dtype=np.int64),
            tops,
            spans,
            np.array(blocks).reshape(-1, len(_AXES), 2),
            np.array([tops[k].max() for k in parts], dtype=np.float64),
        )

    def __len__(self) -> int:
        return len(self.tops)

    def entries(self, a: FloatArray, b: FloatArray, active: BoolArray | None = None) -> FloatArray:
        """(n,) share of legs from a to b, (n, 3) each, before they are in a solid; infinite where a leg is clear.

        ``active`` (count,) are the solids that are looked at; all unless given.
        """
        shares: FloatArray = _entries(a, b, *self._arrays, self._used(active), _EACH)
        return shares

    def blocked(self, a: FloatArray, b: FloatArray, active: BoolArray | None = None) -> BoolArray:
        """(n,) whether legs are in a solid; as `entries`, faster."""
        shares: FloatArray = _entries(a, b, *self._arrays, self._used(active), _ANY)
        return shares < np.inf

    def met(self, a: FloatArray, b: FloatArray) -> BoolArray:
        """(count,) whether any of the legs is in each solid."""
        _entries(a, b, *self._arrays, left := self._used(None), _ONCE)
        return ~left

    def least_m(self, a: FloatArray, b: FloatArray) -> float:
        """Least distance between legs and solids; 0 where a leg is in one, infinite without solids."""
        return float(_least(a, b, *self._arrays))

    def tops_below(self, a: FloatArray, b: FloatArray, least: FloatArray) -> FloatArray:
        """(n,) highest top above ``least`` (n,) that each leg passes in the plan, at whatever height; else −∞."""
        highest: FloatArray = _tops_below(a, b, least, *self._arrays)
        return np.where(highest > least, highest, -np.inf)

    @property
    def _arrays(self) -> tuple[NDArray[np.generic], ...]:
        return self.edges, self.first, self.tops, self.spans, self.blocks, self.block_tops

    def _used(self, active: BoolArray | None) -> BoolArray:
        return np.ones(len(self), dtype=np.bool_) if active is None else active


def _edges(plan: BaseGeometry) -> FloatArray:
    if isinstance(plan, shapely.Point):
        return np.array([[plan.x, plan.y, plan.x, plan.y]])
    rings = [ring for polygon in shapely.get_parts(plan) for ring in (polygon.exterior, *polygon.interiors)]
    places = [shapely.get_coordinates(ring) for ring in rings]
    return np.concatenate([np.zeros((0, 4)), *(np.hstack([ring[:-1], ring[1:]]) for ring in places)])


def _spans(edges: FloatArray) -> FloatArray:
    """(8, 2) least and greatest place of edges (k, 4) along the axes."""
    along = edges[:, :2] @ _AXES.T
    return np.stack([along.min(axis=0), along.max(axis=0)], axis=1)


@kernel
def _is_in(x, y, edges, start, stop):
    """Whether a place is in a plan."""
    inside = False
    for k in range(start, stop):
        below, above = edges[k, 1] > y, edges[k, 3] > y
        if below != above:
            across = edges[k, 0] + (y - edges[k, 1]) * (edges[k, 2] - edges[k, 0]) / (edges[k, 3] - edges[k, 1])
            inside ^= x < across
    return inside


@kernel
def _crossing(ax, ay, dx, dy, length, edges, k):
    """Share of a leg where it first meets an edge; infinite where it does not."""
    fx, fy, gx, gy = edges[k, 0] - ax, edges[k, 1] - ay, edges[k, 2] - ax, edges[k, 3] - ay
    near, one_side, other_side = _ROUNDING_M * length, fx * dy - fy * dx, gx * dy - gy * dx
    if (one_side > near and other_side > near) or (one_side < -near and other_side < -near):
        return np.inf
    ex, ey = gx - fx, gy - fy
    across = dx * ey - dy * ex
    if abs(across) > 1e-12 * length * np.hypot(ex, ey):
        share, along = (fx * ey - fy * ex) / across, one_side / across
        slack, spare = _ROUNDING_M / length, _ROUNDING_M / np.hypot(ex, ey)
        if -slack <= share <= 1.0 + slack and -spare <= along <= 1.0 + spare:
            return min(max(share, 0.0), 1.0)
        return np.inf
    one = (fx * dx + fy * dy) / length**2
    other = (gx * dx + gy * dy) / length**2
    if max(one, other) < 0.0 or min(one, other) > 1.0:
        return np.inf
    return max(min(one, other), 0.0)


@kernel
def _entry(a, b, leg, edges, start, stop, top):
    """Share of a leg before it is in a solid; infinite where it is clear."""
    ax, ay, az = a[leg, 0], a[leg, 1], a[leg, 2]
    dx, dy, dz = b[leg, 0] - ax, b[leg, 1] - ay, b[leg, 2] - az
    if az < top and _is_in(ax, ay, edges, start, stop):
        return 0.0
    first, length = np.inf, np.hypot(dx, dy)
    for k in range(start, stop if length > 0.0 else start):
        share = _crossing(ax, ay, dx, dy, length, edges, k)
        if share < first and az + share * dz < top:
            first = share
    if az >= top and az + dz < top:
        sinks = (top - az) / dz
        if sinks < first and _is_in(ax + sinks * dx, ay + sinks * dy, edges, start, stop):
            first = sinks
    return first


@kernel
def _span(a, b, leg, span):
    """Put the leg's least and greatest place along the axes into ``span`` (8, 2)."""
    for k in range(len(_AXES)):
        one = a[leg, 0] * _AXES[k, 0] + a[leg, 1] * _AXES[k, 1]
        other = b[leg, 0] * _AXES[k, 0] + b[leg, 1] * _AXES[k, 1]
        span[k, 0], span[k, 1] = min(one, other) - _ROUNDING_M, max(one, other) + _ROUNDING_M


@kernel
def _beside(span, spans, index):
    """Whether a leg's span is beside a solid's or a block's along some axis."""
    for k in range(len(_AXES)):  # noqa: SIM110 - Numba takes no any()
        if span[k, 1] < spans[index, k, 0] or span[k, 0] > spans[index, k, 1]:
            return True
    return False


@kernel
def _entries(a, b, edges, first, tops, spans, blocks, block_tops, used, how):
    shares = np.full(len(a), np.inf)
    span = np.empty((len(_AXES), 2))
    for leg in range(len(a)):
        _span(a, b, leg, span)
        low = min(a[leg, 2], b[leg, 2])
        for block in range(len(blocks)):
            if low >= block_tops[block] or _beside(span, blocks, block):
                continue
            for solid in range(block * _BLOCK, min(block * _BLOCK + _BLOCK, len(tops))):
                if used[solid] and low < tops[solid] and not _beside(span, spans, solid):
                    share = _entry(a, b, leg, edges, first[solid], first[solid + 1], tops[solid])
                    shares[leg] = min(shares[leg], share)
                    if how == _ONCE and share < np.inf:
                        used[solid] = False
                    if how == _ANY and share < np.inf:
                        break
            if how == _ANY and shares[leg] < np.inf:
                break
    return shares


@kernel
def _gap(span, spans, index):
    """What a leg and a solid or a block are apart at least, seen from above."""
    gap = 0.0
    for k in range(len(_AXES)):
        gap = max(gap, span[k, 0] - spans[index, k, 1], spans[index, k, 0] - span[k, 1])
    return gap


@kernel
def _wall(a, b, leg, edges, k, top, share):
    """Distance between a place along a leg and the wall over an edge."""
    x = a[leg, 0] + share * (b[leg, 0] - a[leg, 0]) - edges[k, 0]
    y = a[leg, 1] + share * (b[leg, 1] - a[leg, 1]) - edges[k, 1]
    above = max(a[leg, 2] + share * (b[leg, 2] - a[leg, 2]) - top, 0.0)
    ex, ey = edges[k, 2] - edges[k, 0], edges[k, 3] - edges[k, 1]
    square = ex * ex + ey * ey
    along = min(max((x * ex + y * ey) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return np.sqrt((x - along * ex) ** 2 + (y - along * ey) ** 2 + above**2)


@kernel
def _least(a, b, edges, first, tops, spans, blocks, block_tops):
    least = np.inf
    span = np.empty((len(_AXES), 2))
    for leg in range(len(a)):
        _span(a, b, leg, span)
        low = min(a[leg, 2], b[leg, 2])
        for block in range(len(blocks)):
            if np.hypot(_gap(span, blocks, block), max(low - block_tops[block], 0.0)) >= least:
                continue
            for solid in range(block * _BLOCK, min(block * _BLOCK + _BLOCK, len(tops))):
                start, stop, top = first[solid], first[solid + 1], tops[solid]
                if np.hypot(_gap(span, spans, solid), max(low - top, 0.0)) >= least:
                    continue
                for end in (a, b):
                    if _is_in(end[leg, 0], end[leg, 1], edges, start, stop):
                        least = min(least, max(end[leg, 2] - top, 0.0))
                for k in range(start, stop):
                    # Convex along the leg, as a wall is a convex body: thirds are cut off.
                    early, late = 0.0, 1.0
                    for _ in range(_THIRDS):
                        one, other = early + (late - early) / 3.0, late - (late - early) / 3.0
                        if _wall(a, b, leg, edges, k, top, one) < _wall(a, b, leg, edges, k, top, other):
                            late = other
                        else:
                            early = one
                    least = min(least, _wall(a, b, leg, edges, k, top, 0.5 * (early + late)))
    return least


@kernel
def _passes(a, b, leg, edges, start, stop):
    """Whether a leg passes a plan, at whatever height."""
    dx, dy = b[leg, 0] - a[leg, 0], b[leg, 1] - a[leg, 1]
    length = np.hypot(dx, dy)
    for k in range(start, stop if length > 0.0 else start):
        if _crossing(a[leg, 0], a[leg, 1], dx, dy, length, edges, k) < np.inf:
            return True
    return _is_in(a[leg, 0], a[leg, 1], edges, start, stop)


@kernel
def _tops_below(a, b, least, edges, first, tops, spans, blocks, block_tops):
    highest = least.copy()
    span = np.empty((len(_AXES), 2))
    for leg in range(len(a)):
        _span(a, b, leg, span)
        for block in range(len(blocks)):
            if block_tops[block] <= highest[leg] or _beside(span, blocks, block):
                continue
            # The highest of a plot's layers comes last.
            for solid in range(min(block * _BLOCK + _BLOCK, len(tops)) - 1, block * _BLOCK - 1, -1):
                if (
                    tops[solid] > highest[leg]
                    and not _beside(span, spans, solid)
                    and _passes(a, b, leg, edges, first[solid], first[solid + 1])
                ):
                    highest[leg] = tops[solid]
    return highest
