"""Telling the plants of a reconstructed plot apart: which plant each point of a cloud belongs to.

Stems are apart low down even where leaves cross. So plants are found by their feet, and the rest of the cloud goes to
the foot that is nearest along the plants' surfaces. Where that gives no clear answer, the answer is that the plants
cannot be told apart: plants with leaves of others make plots that cannot be, and turning the whole plot does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from fieldkit.clouds import Cloud, voxel_thin

LEAST_CLEAR = 0.8
"""Plants are told apart where at least this share of points is clearly nearer to its own foot than to any other."""

_CELL_M, _CELLS_HIGH = 0.005, 100
"""Work is done on a cloud thinned to this, or to this share of the plants' height where they are small."""
_LOW, _BAND, _HIGH = 0.06, 0.12, 0.15
"""Feet are looked for below the second of these shares of the height, and checked against the others."""
_RISE = 0.7
"""A foot reaches through this share of its band. Weeds and leaf tips that hang low do not."""
_LINK, _SQUASH = 3.0, 2.0
"""Points of a foot are linked over so many cells sideways, and over ``_SQUASH`` times as many upwards."""
_LEAST_POINTS = 10
_WIDE = 0.25
"""Nine in ten points of a foot lie within this share of the height about its middle; else it is a canopy's skirt."""
_SAME_FOOT = 6.0
"""Feet of the two bands are the same within so many cells."""
_STEM_RADIUS, _STEM_TOP, _STEM_LEAN = 5.0, 0.6, 0.3
"""A stem is followed within so many cells of its axis up to this share of the height. The axis moves by this share of
the way to the middle of each slice of two cells."""
_STEM_COST = 2.0
_UPRIGHT_BANDS, _UPRIGHT, _AWAY = ((0.25, 0.5), (0.4, 0.6)), 0.7, 16.0
"""What fills this share of one of these bands of the plants' height, more than so many cells from any stem that was
followed, is a stem whose foot was not found."""
_REACH, _BEND = 2.4, 30.0
"""Neighbours on a surface are so many cells apart. Steps out of a surface, or to one that faces elsewhere, count up to
``1 + 2 · _BEND`` times: that is what keeps paths from changing leaves where two cross."""
_JUMP, _JUMP_COST = 8.0, 20.0
"""Gaps of up to so many cells are crossed at this cost per metre."""
_CLEARLY = 1.1
"""A point is clearly nearer to one foot when the next is this much further."""


@dataclass(frozen=True, eq=False)
class PlantsApart:
    """Which plant each point belongs to. The arrays are read-only."""

    numbers: NDArray[np.int32]
    """(n,) int32: the point's plant, from 1; 0 for what belongs to none, such as weeds, and for every point where
    plants cannot be told apart."""
    feet_m: NDArray[np.float64]
    """(k, 3) metres: where each plant stands, on the level of the lowest points, by x; k is 0 where plants cannot be
    told apart."""
    clear: float
    """Share of the points that are clearly nearer to their own foot than to any other, 0 to 1."""
    refused: str = ""
    """Why the plants cannot be told apart; empty where they can."""

    def __post_init__(self) -> None:
        for name, dtype in (("numbers", np.int32), ("feet_m", np.float64)):
            view = np.ascontiguousarray(getattr(self, name), dtype).view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)

    @property
    def count(self) -> int:
        """How many plants there are; 0 where they cannot be told apart."""
        return len(self.feet_m)


def tell_apart(cloud: Cloud) -> PlantsApart:
    """Which plant each point of ``cloud`` belongs to.

    1. The cloud is thinned to cells of 5 mm, or a hundredth of the plants' height where that is less.
    2. Feet are the connected parts of the points below 0.12 of the height that reach up through that band.
    3. Each stem is followed upwards from its foot, across what is missing of it.
    4. Every point goes to the foot nearest to it along the surfaces (Dijkstra 1959, on a graph of neighbours). Steps
       out of a surface count more, so that paths stay on their leaf where two leaves touch.
    5. What is connected to nothing goes with the nearest point. If it lies low, it belongs to no plant.

    Plants cannot be told apart when one of these holds:

    - no foot is found, or one is wider than a quarter of the height on each side;
    - a foot is two below 0.06 of the height: feet touch;
    - there are other feet below 0.15 of the height than below 0.12: feet touch, or have holes;
    - something as upright as a stem stands where no foot is: a foot was not reconstructed;
    - fewer than `LEAST_CLEAR` of the points are clearly nearer to their foot than to the next: leaves mix.

    Args:
        cloud: plants in the plot frame, z up, metres. Normals are used where there are any.
    """
    try:
        return _told_apart(cloud)
    except _Mixed as why:
        return PlantsApart(np.zeros(len(cloud), np.int32), np.zeros((0, 3)), why.clear, str(why))


class _Mixed(Exception):
    """Why plants cannot be told apart."""

    def __init__(self, why: str, clear: float = 0.0) -> None:
        super().__init__(why)
        self.clear = clear


def _told_apart(cloud: Cloud) -> PlantsApart:
    if len(cloud) < _LEAST_POINTS:
        raise _Mixed("there are hardly any points")
    low, high = np.quantile(cloud.points[:, 2], (0.001, 0.995))
    base, height = float(low), float(high - low)
    if height <= 0.0:
        raise _Mixed("nothing stands up")
    cell = max(min(_CELL_M, height / _CELLS_HIGH), _spacing(cloud.points))
    thin = _thinned(cloud, cell)
    points = thin.points
    feet, places = _standing_feet(points, base, height, cell)
    stems = _stems(points, feet, places, base, height, cell)
    surface = _surface(thin, cell)
    graph = _with_shortcuts(points, surface, feet, stems, cell)
    distance = np.array([dijkstra(graph, directed=False, indices=foot, min_only=True) for foot in feet])
    numbers = _nearest_reached(points, distance) + 1
    numbers[_litter(points, surface, feet, base + _BAND * height)] = 0
    clear = _clear_share(distance, numbers > 0)
    if clear < LEAST_CLEAR:
        why = f"leaves of different plants mix: {1.0 - clear:.0%} of the points are about as near to two feet"
        raise _Mixed(why, clear)
    return PlantsApart(numbers[cKDTree(points).query(cloud.points)[1]], places, clear)


def _standing_feet(
    points: NDArray[np.float64], base: float, height: float, cell: float
) -> tuple[list[NDArray[np.int64]], NDArray[np.float64]]:
    """Each plant's foot and its place (k, 3), by x; `_Mixed` where feet cannot be told apart."""
    feet = _feet(points, base, _BAND * height, cell)
    if not feet:
        raise _Mixed("no foot of a plant is found near the ground")
    places = _places(points, feet, base)
    if any(_spread(points, foot) > _WIDE * height for foot in feet):
        raise _Mixed("what stands on the ground is too wide for a stem")
    lower = _feet(points, base, _LOW * height, cell)
    if any(_parts_of(foot, lower) > 1 for foot in feet):
        raise _Mixed("their feet touch")
    higher = _places(points, _feet(points, base, _HIGH * height, cell), base)
    if not _same(places, higher, _SAME_FOOT * cell):
        raise _Mixed("their feet are others a little higher up: they touch, or have holes")
    order = np.lexsort((places[:, 1], places[:, 0]))
    return [feet[i] for i in order], places[order]


def _stems(
    points: NDArray[np.float64],
    feet: list[NDArray[np.int64]],
    places: NDArray[np.float64],
    base: float,
    height: float,
    cell: float,
) -> list[NDArray[np.int64]]:
    """Each foot's stem; `_Mixed` where there is one more."""
    top = base + _STEM_TOP * height
    stems = [_stem(points, foot, place, top, cell) for foot, place in zip(feet, places, strict=True)]
    bands = [(base + a * height, base + b * height) for a, b in _UPRIGHT_BANDS]
    if any(_stands_elsewhere(points, stems, bottom, top, cell) for bottom, top in bands):
        raise _Mixed("a stem stands where no foot is found")
    return stems


def _spacing(points: NDArray[np.float64]) -> float:
    """Median distance to the nearest other point, from every so manieth."""
    some = points[:: max(1, len(points) // 5_000)]
    return float(np.median(cKDTree(points).query(some, k=2)[0][:, 1]))


def _thinned(cloud: Cloud, cell_m: float) -> Cloud:
    """One of the cloud's own points per cell, so that normals are those of a surface."""
    middle = voxel_thin(Cloud(cloud.points), cell_m).points
    return cloud.select(np.unique(cKDTree(cloud.points).query(middle)[1]))


def _feet(points: NDArray[np.float64], low: float, band: float, cell: float) -> list[NDArray[np.int64]]:
    """The points of each foot: connected parts of the lowest ``band`` metres that reach up through it."""
    chosen = np.flatnonzero(points[:, 2] < low + band)
    pairs = cKDTree(points[chosen] * (1.0, 1.0, 1.0 / _SQUASH)).query_pairs(_LINK * cell, output_type="ndarray")
    parts, part = _components(pairs, len(chosen))
    feet = []
    for number in range(parts):
        foot = chosen[part == number]
        if len(foot) >= _LEAST_POINTS and np.ptp(points[foot, 2]) >= _RISE * band:
            feet.append(np.asarray(foot, np.int64))
    return feet


def _places(points: NDArray[np.float64], feet: list[NDArray[np.int64]], low: float) -> NDArray[np.float64]:
    """(k, 3): the middle of each foot's points, at height ``low``."""
    middles = [(*np.median(points[foot, :2], axis=0), low) for foot in feet]
    return np.array(middles, dtype=np.float64).reshape(-1, 3)


def _spread(points: NDArray[np.float64], foot: NDArray[np.int64]) -> float:
    """How far nine in ten points of a foot are from its middle, in the ground plan."""
    plan = points[foot, :2]
    return float(np.quantile(np.linalg.norm(plan - np.median(plan, axis=0), axis=1), 0.9))


def _same(a: NDArray[np.float64], b: NDArray[np.float64], within: float) -> bool:
    """Whether each place of one list has one of its own in the other."""
    if len(a) != len(b):
        return False
    distance, nearest = cKDTree(b).query(a)
    return bool((distance <= within).all()) and len(np.unique(nearest)) == len(a)


def _parts_of(foot: NDArray[np.int64], feet: list[NDArray[np.int64]]) -> int:
    """How many of ``feet`` share points with ``foot``."""
    return sum(bool(np.isin(other, foot).any()) for other in feet)


def _surface(cloud: Cloud, cell: float) -> coo_array:
    """A graph (n, n) of neighbours: how far apart they are along the surface, metres."""
    points = cloud.points
    pairs = cKDTree(points).query_pairs(_REACH * cell, output_type="ndarray")
    step = points[pairs[:, 1]] - points[pairs[:, 0]]
    length = np.maximum(np.linalg.norm(step, axis=1), 1e-6)
    weight = length
    if cloud.normals is not None:
        a, b = (cloud.normals[pairs[:, k]].astype(np.float64) for k in (0, 1))
        known = (np.abs(a).max(axis=1) > 0) & (np.abs(b).max(axis=1) > 0)
        unit = step / length[:, None]
        out = np.maximum(np.abs((a * unit).sum(axis=1)), np.abs((b * unit).sum(axis=1)))
        turn = 1.0 - np.abs((a * b).sum(axis=1))
        weight = length * (1.0 + _BEND * np.where(known, out**2 + turn, 0.0))
    return coo_array((weight, (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))


def _stem(
    points: NDArray[np.float64], foot: NDArray[np.int64], place: NDArray[np.float64], top: float, cell: float
) -> NDArray[np.int64]:
    """The points about a stem's axis, which starts at its foot and may lean; over gaps it goes on as it was."""
    tree = cKDTree(points[:, :2])
    middle, slices = place[:2].copy(), []
    for bottom in np.arange(points[foot, 2].min(), top, 2.0 * cell):
        near = np.asarray(tree.query_ball_point(middle, _STEM_RADIUS * cell), np.int64)
        inside = near[(points[near, 2] >= bottom) & (points[near, 2] < bottom + 2.0 * cell)]
        if len(inside):
            slices.append(inside)
            middle += _STEM_LEAN * (np.median(points[inside, :2], axis=0) - middle)
    return np.unique(np.concatenate(slices)) if slices else np.zeros(0, np.int64)


def _stands_elsewhere(
    points: NDArray[np.float64], stems: list[NDArray[np.int64]], bottom: float, top: float, cell: float
) -> bool:
    """Whether something upright stands away from all ``stems`` between two heights.

    The heights are cut into slices of two cells, the ground plan into squares of two cells. A square and its eight
    neighbours hold something upright when most of the slices have points there.
    """
    side = 2.0 * cell
    inside = points[(points[:, 2] >= bottom) & (points[:, 2] < top)]
    if not len(inside):
        return False
    at = np.floor((inside - (*inside[:, :2].min(axis=0), bottom)) / side).astype(np.int64)
    slices, width = int(np.ceil((top - bottom) / side)), int(at[:, 1].max()) + 3
    around = np.stack(np.meshgrid((0, 1, 2), (0, 1, 2), indexing="ij"), axis=-1).reshape(-1, 1, 2)
    square = (at[None, :, 0] + around[..., 0]) * width + at[None, :, 1] + around[..., 1]
    filled = np.unique(square * slices + at[None, :, 2])
    square, count = np.unique(filled // slices, return_counts=True)
    upright = square[count >= _UPRIGHT * slices]
    plan = (np.column_stack([upright // width, upright % width]) - 0.5) * side + inside[:, :2].min(axis=0)
    known = np.concatenate(stems)
    if not len(upright):
        return False
    return not len(known) or bool((cKDTree(points[known, :2]).query(plan)[0] > _AWAY * cell).any())


def _with_shortcuts(
    points: NDArray[np.float64], surface: coo_array, feet: list[NDArray[np.int64]], stems: list[NDArray[np.int64]],
    cell: float,
) -> csr_array:  # fmt: skip
    """The graph of the surface with the ways up the stems, and jumps over gaps between every other point."""
    starts, ends, weights = [surface.row], [surface.col], [surface.data]
    for foot, stem in zip(feet, stems, strict=True):
        top = foot[np.argmax(points[foot, 2])]
        above = stem[points[stem, 2] > points[top, 2]]
        starts.append(np.full(len(above), top))
        ends.append(above)
        weights.append(_STEM_COST * (points[above, 2] - points[top, 2]))
    some = np.unique(cKDTree(points).query(voxel_thin(Cloud(points), 2.0 * cell).points)[1])
    jumps = some[cKDTree(points[some]).query_pairs(_JUMP * cell, output_type="ndarray")]
    starts.append(jumps[:, 0])
    ends.append(jumps[:, 1])
    weights.append(_JUMP_COST * np.linalg.norm(points[jumps[:, 0]] - points[jumps[:, 1]], axis=1))
    a, b, weight = np.concatenate(starts), np.concatenate(ends), np.concatenate(weights)
    # Where two points are joined twice the shorter way counts.
    key = np.minimum(a, b).astype(np.int64) * len(points) + np.maximum(a, b)
    order = np.lexsort((weight, key))
    first = order[np.unique(key[order], return_index=True)[1]]
    n = len(points)
    return coo_array((np.maximum(weight[first], 1e-9), (a[first], b[first])), shape=(n, n)).tocsr()


def _nearest_reached(points: NDArray[np.float64], distance: NDArray[np.float64]) -> NDArray[np.int32]:
    """(n,) the nearest foot by ``distance`` (k, n); that of the nearest point that any foot reaches where none does."""
    nearest: NDArray[np.int32] = np.argmin(distance, axis=0).astype(np.int32)
    reached = np.isfinite(distance.min(axis=0))
    if not reached.all():
        nearest[~reached] = nearest[reached][cKDTree(points[reached]).query(points[~reached])[1]]
    return nearest


def _litter(
    points: NDArray[np.float64], surface: coo_array, feet: list[NDArray[np.int64]], top: float
) -> NDArray[np.bool_]:
    """Points of connected surfaces that lie wholly below ``top`` and are no part of a foot."""
    parts, part = connected_components(surface, directed=False)
    highest = np.full(parts, -np.inf)
    np.maximum.at(highest, part, points[:, 2])
    low = highest < top
    low[np.unique(part[np.concatenate(feet)])] = False
    return np.asarray(low[part], bool)


def _clear_share(distance: NDArray[np.float64], counted: NDArray[np.bool_]) -> float:
    """Share of the points that are reached by one foot clearly sooner than by any other."""
    if not counted.any():
        return 0.0
    if len(distance) == 1:
        return 1.0
    first, second = np.sort(distance[:, counted], axis=0)[:2]
    return float(np.mean(np.isfinite(first) & (second > _CLEARLY * first)))


def _components(pairs: NDArray[np.int64], count: int) -> tuple[int, NDArray[np.int32]]:
    graph = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    parts, part = connected_components(graph, directed=False)
    return int(parts), np.asarray(part, np.int32)
