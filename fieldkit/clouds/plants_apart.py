"""Telling the plants of a reconstructed plot apart: which plant each point belongs to, and in which row each stands.

Stems are apart low down even where leaves cross. So plants are found by their feet, and the rest of the cloud goes to
the foot that is nearest along the plants' surfaces. Where that gives no clear answer, the answer is that the plants
cannot be told apart: plants with leaves of others make plots that cannot be, and turning the whole plot does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from fieldkit.arrays import BoolArray, FloatArray, IntArray
from fieldkit.clouds.cells import voxel_thin
from fieldkit.clouds.cloud import Cloud

OnPlot = Callable[[FloatArray], BoolArray]
LEAST_CLEAR = 0.8
"""Plants are told apart where at least this share of points is clearly nearer to its own foot than to any other."""

_CELL_M = 0.005
"""Edge of the cells to which a cloud is thinned, metres."""
_CELLS_HIGH = 100
"""Least number of cells in the plants' height: small plants have smaller cells."""
_BAND = 0.3
"""Share of the plants' height below which stems' feet are looked for."""
_WINDOW = 0.12
"""Length of an upright column, as a share of the plants' height, over which `_FILLED` holds."""
_FILLED = 0.7
"""Least share of a column's voxels that hold points."""
_SHORT = 0.1
"""Least length of a column that counts, as a share of the plants' height."""
_TALL = 0.15
"""Least length of a stem's foot, as a share of the plants' height."""
_FOOT = 0.12
"""Share of the plants' height below which a stem's foot begins."""
_LITTER = 0.12
"""What is connected to nothing and lies wholly below this share of the height belongs to no plant."""
_MOST_VOXELS = 50_000_000
"""Most voxels in which columns are looked for: 200 MB each array."""
_LEAST_POINTS = 10
"""Least number of points in which plants are told apart."""
_WIDE = 0.25
"""Nine in ten points of a foot lie within this share of the height about its middle; else it is a canopy's skirt."""
_STEM_RADIUS = 5.0
"""Distance from a stem's axis within which points are its own, in cells."""
_STEM_TOP = 0.6
"""Share of the plants' height up to which a stem is followed."""
_STEM_LEAN = 0.3
"""Share of the way to the middle of each slice of two cells by which a stem's axis moves."""
_STEM_COST = 2.0
"""Cost of a metre along a stem, in metres along a leaf."""
_UPRIGHT_BANDS = ((0.25, 0.5), (0.4, 0.6))
"""Bands, as shares of the plants' height, through which a column is a stem, with or without a foot."""
_AWAY = 16.0
"""Distance from every stem that was followed beyond which such a column is another, in cells."""
_REACH = 2.4
"""Distance between neighbours on a surface, in cells."""
_BEND = 30.0
"""Weight of steps out of a surface, or to one that faces elsewhere: up to ``1 + 2 · _BEND`` times their length. It
keeps paths from changing leaves where two cross."""
_JUMP = 8.0
"""Widest gap that a path may cross, in cells."""
_JUMP_COST = 6.0
"""Cost of a metre across a gap, in metres along a leaf."""
_CLEARLY = 1.1
"""Factor by which the way to any other foot must be longer for a point to be clearly one plant's."""


@dataclass(frozen=True, eq=False)
class PlantsApart:
    """Which plant each point belongs to. The arrays are read-only."""

    numbers: NDArray[np.int32]
    """(n,) int32: the point's plant, from 1; 0 for what belongs to none, such as weeds, and for every point where
    plants cannot be told apart."""
    feet_m: FloatArray
    """(k, 3) metres: where each plant stands, on the level of the lowest points, by x; k is 0 where plants cannot be
    told apart."""
    clear: float
    """Share of the points that are clearly nearer to their own foot than to any other, 0 to 1."""
    refused: str = ""
    """Why the plants cannot be told apart; empty where they can."""
    sure: BoolArray | None = None
    """(n,) whether the point is clearly nearer to its own foot than to any other; None where they cannot be."""

    def __post_init__(self) -> None:
        for name, dtype in (("numbers", np.int32), ("feet_m", np.float64)):
            view = np.ascontiguousarray(getattr(self, name), dtype).view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)

    @property
    def count(self) -> int:
        """How many plants there are; 0 where they cannot be told apart."""
        return len(self.feet_m)


def everywhere(places: FloatArray) -> BoolArray:
    """All places belong to the plot."""
    return np.ones(len(places), np.bool_)


def tell_apart(cloud: Cloud, on_plot: OnPlot = everywhere) -> PlantsApart:
    """Which plant each point of ``cloud`` belongs to.

    1. The cloud is thinned to cells of 5 mm, or a hundredth of the plants' height where that is less.
    2. Stems are the upright columns of the lowest 0.3 of the height: seen from above they stay within 3 cm, and points
       fill most of their length. Leaves are not so upright, and weeds not so high.
    3. Each stem is followed further upwards, across what is missing of it.
    4. Every point goes to the foot nearest to it along the surfaces (Dijkstra 1959, on a graph of neighbours). Steps
       out of a surface count more, so that paths stay on their leaf where two leaves touch.
    5. What is connected to nothing goes with the nearest point. If it lies low, it belongs to no plant.

    Plants cannot be told apart when one of these holds:

    - no stem is found, or one is wider than a quarter of the height on each side;
    - something as upright as a stem stands where no foot is: a foot was not reconstructed;
    - fewer than `LEAST_CLEAR` of the points are clearly nearer to their foot than to the next: leaves mix.

    Args:
        cloud: plants in the plot frame, z up, metres. Normals are used where there are any.
        on_plot: which places (n, 2) belong to the plot. Plants elsewhere need not be told apart.
    """
    try:
        return _told_apart(cloud, on_plot)
    except _Mixed as why:
        return PlantsApart(np.zeros(len(cloud), np.int32), np.zeros((0, 3)), why.clear, str(why))


class _Mixed(Exception):
    """Why plants cannot be told apart."""

    def __init__(self, why: str, clear: float = 0.0) -> None:
        super().__init__(why)
        self.clear = clear


def _told_apart(cloud: Cloud, on_plot: OnPlot) -> PlantsApart:
    if len(cloud) < _LEAST_POINTS:
        raise _Mixed("there are hardly any points")
    low, high = np.quantile(cloud.points[:, 2], (0.001, 0.995))
    base, height = float(low), float(high - low)
    if height <= 0.0:
        raise _Mixed("nothing stands up")
    cell = max(min(_CELL_M, height / _CELLS_HIGH), _spacing(cloud.points))
    thin = _thinned(cloud, cell)
    points = thin.points
    feet, places = _standing_feet(points, on_plot, base, height, cell)
    stems = _stems(points, on_plot, feet, places, base, height, cell)
    surface = _surface(thin, cell)
    graph = _with_shortcuts(points, surface, feet, stems, cell)
    nearest, sure = _nearest_feet(points, graph, feet)
    numbers = np.where(_litter(points, surface, feet, base + _LITTER * height), 0, nearest + 1)
    own = np.append(False, on_plot(places[:, :2]))[numbers]
    clear = float(np.mean(sure[own])) if own.any() else 1.0
    if clear < LEAST_CLEAR:
        why = f"leaves of different plants mix: {1.0 - clear:.0%} of the points are about as near to two feet"
        raise _Mixed(why, clear)
    of = cKDTree(points).query(cloud.points)[1]
    return PlantsApart(numbers[of], places, clear, sure=sure[of])


def _standing_feet(
    points: FloatArray, on_plot: OnPlot, base: float, height: float, cell: float
) -> tuple[list[IntArray], FloatArray]:
    """The low part of each plant's stem and its place (k, 3), by x; `_Mixed` where that is not clear."""
    lowest = float(points[:, 2].min())
    columns = _columns(points, lowest, base + _BAND * height, _WINDOW * height, cell)
    columns = [column for column in columns if len(column) and np.ptp(points[column, 2]) >= _SHORT * height]
    middles = np.array([np.median(points[column, :2], axis=0) for column in columns]).reshape(-1, 2)
    tall = [points[column, 2] - base for column in columns]
    sure = [np.ptp(z) >= _TALL * height and z.min() <= _FOOT * height for z in tall]
    feet = [column for column, stands in zip(columns, sure, strict=True) if stands]
    if not feet:
        raise _Mixed("no foot of a plant is found near the ground")
    places = np.array([_place(points, foot, base, cell) for foot in feet])
    if any(_spread(points, foot) > _WIDE * height for foot in feet):
        raise _Mixed("what stands on the ground is too wide for a stem")
    elsewhere = (cKDTree(places[:, :2]).query(middles)[0] > _AWAY * cell) & on_plot(middles)
    if (elsewhere & ~np.array(sure)).any():
        raise _Mixed("something stands upright of which no foot is found")
    order = np.lexsort((places[:, 1], places[:, 0]))
    return [feet[i] for i in order], places[order]


def _columns(points: FloatArray, bottom: float, top: float, stretch: float, cell: float) -> list[IntArray]:
    """The points of each upright column between two heights.

    Space is cut into voxels of two cells. One with its eight neighbours in the plan is part of a column where most of
    those above and below it, over ``stretch`` metres, hold points, too.
    """
    side = 2.0 * cell
    band = np.flatnonzero((points[:, 2] >= bottom) & (points[:, 2] < top))
    if not len(band):
        return []
    corner = np.array([*points[band, :2].min(axis=0) - side, bottom])  # with a row of empty voxels all around
    at = np.floor((points[band] - corner) / side).astype(np.int64)
    shape = [int(n) + room for n, room in zip(at.max(axis=0), (2, 2, 1), strict=True)]
    if math.prod(shape) > _MOST_VOXELS:
        raise _Mixed("the plot is too large to look for stems in")
    filled = np.zeros(shape, np.float32)
    filled[tuple(at.T)] = 1.0
    wide = ndimage.maximum_filter(filled, size=(3, 3, 1))
    slices = 2 * round(0.5 * stretch / side - 0.5) + 1
    share = ndimage.uniform_filter1d(wide, slices, axis=2, mode="constant")
    upright = (ndimage.maximum_filter1d(share, slices, axis=2, mode="constant") > _FILLED - 1e-4) & (wide > 0)
    of = ndimage.label(upright, np.ones((3, 3, 3)))[0][tuple(at.T)]
    return [band[of == number] for number in range(1, int(of.max(initial=0)) + 1)]


def _place(points: FloatArray, foot: IntArray, base: float, cell: float) -> tuple[float, ...]:
    """Where a stem stands: the middle of its lowest points, at height ``base``."""
    z = points[foot, 2]
    x, y = np.median(points[foot[z < z.min() + 6.0 * cell], :2], axis=0)
    return float(x), float(y), base


def _stems(
    points: FloatArray,
    on_plot: OnPlot,
    feet: list[IntArray],
    places: FloatArray,
    base: float,
    height: float,
    cell: float,
) -> list[IntArray]:
    """Each foot's stem; `_Mixed` where there is one more."""
    top = base + _STEM_TOP * height
    stems = [_stem(points, foot, place, top, cell) for foot, place in zip(feet, places, strict=True)]
    known = cKDTree(points[np.concatenate(stems), :2])
    for low, high in _UPRIGHT_BANDS:
        columns = _columns(points, base + low * height, base + high * height, (high - low) * height, cell)
        plan = points[np.concatenate([np.zeros(0, np.int64), *columns]), :2]
        if (known.query(plan[on_plot(plan)])[0] > _AWAY * cell).any():
            raise _Mixed("a stem stands where no foot is found")
    return stems


def _spacing(points: FloatArray) -> float:
    """Median distance to the nearest other point, from every so manieth."""
    some = points[:: max(1, len(points) // 5_000)]
    return float(np.median(cKDTree(points).query(some, k=2)[0][:, 1]))


def _thinned(cloud: Cloud, cell_m: float) -> Cloud:
    """One of the cloud's own points per cell, so that normals are those of a surface."""
    middle = voxel_thin(Cloud(cloud.points), cell_m).points
    return cloud.select(np.unique(cKDTree(cloud.points).query(middle)[1]))


def _spread(points: FloatArray, foot: IntArray) -> float:
    """How far nine in ten points of a foot are from its middle, in the ground plan."""
    plan = points[foot, :2]
    return float(np.quantile(np.linalg.norm(plan - np.median(plan, axis=0), axis=1), 0.9))


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


def _stem(points: FloatArray, foot: IntArray, place: FloatArray, top: float, cell: float) -> IntArray:
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


def _with_shortcuts(
    points: FloatArray, surface: coo_array, feet: list[IntArray], stems: list[IntArray], cell: float
) -> csr_array:
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


def _nearest_feet(points: FloatArray, graph: csr_array, feet: list[IntArray]) -> tuple[NDArray[np.int32], BoolArray]:
    """(n,) the nearest foot, that of the nearest point that any foot reaches where none does; and (n,) whether it is
    clearly nearer than the next.
    """
    nearest = np.zeros(len(points), np.int32)
    first, second = np.full((2, len(points)), np.inf)
    for number, foot in enumerate(feet):
        away = dijkstra(graph, directed=False, indices=foot, min_only=True)
        nearer = away < first
        second = np.where(nearer, first, np.minimum(second, away))
        first[nearer], nearest[nearer] = away[nearer], number
    reached = np.isfinite(first)
    if not reached.all():
        nearest[~reached] = nearest[reached][cKDTree(points[reached]).query(points[~reached])[1]]
    return nearest, (reached & (second > _CLEARLY * first)) | (len(feet) == 1)


def _litter(points: FloatArray, surface: coo_array, feet: list[IntArray], top: float) -> BoolArray:
    """Points of connected surfaces that lie wholly below ``top`` and are no part of a foot."""
    parts, part = connected_components(surface, directed=False)
    highest = np.full(parts, -np.inf)
    np.maximum.at(highest, part, points[:, 2])
    low = highest < top
    low[np.unique(part[np.concatenate(feet)])] = False
    return np.asarray(low[part], bool)


LEAST_PLANTS = 4
"""Fewer stand in a line of some direction by chance."""
GAP = 1.5
"""Neighbours in a row that stand this many spacings apart or more have places without a plant between them."""
_STEP_DEG = 0.5
"""Step between the directions that are tried, degrees."""
_ROWS_APART = 0.5
"""Rows are this share of the least distances between plants apart, and more."""
_MANY = 8
"""Number of plants from which the wider of two tolerances holds: fewer seem to stand in rows by chance."""
_OFF = (0.10, 0.25)
"""RMS distance of plants from their row's line for few and for many plants, as a share of the distance between
plants."""
_UNEVEN = (0.20, 0.30)
"""RMS deviation from even places along a row for few and for many plants, as a share of the spacing."""
_WIDE_ROW = 0.3
"""Rows are at most this share of the distance between rows wide."""


@dataclass(frozen=True, eq=False)
class PlantRows:
    """Which row each plant stands in."""

    row: IntArray
    """(k,) from 1, in the direction across the rows that has a positive y (or x, for rows along y)."""
    in_row: IntArray
    """(k,) number along its row, from 1."""
    spacing_m: float
    """Usual distance of neighbours in a row."""
    gaps: int
    """Places without a plant between the first and the last plant of each row (`GAP`)."""


def find_rows(feet: FloatArray) -> PlantRows | None:
    """The rows that plants stand in; None where they stand in none, or are too few to tell.

    Every direction is tried. Rows are where the plants' places across it leave gaps. Each has two plants or more, one
    at least has three; they stand near its line, and about evenly along it. Of several directions that with the fewest
    rows counts, then that with the straightest ones. ``feet`` (k, 2) are where plants stand, metres.
    """
    if len(feet) < LEAST_PLANTS:
        return None
    apart = np.linalg.norm(feet[:, None] - feet, axis=2) + np.diag(np.full(len(feet), np.inf))
    nearest = float(np.median(apart.min(axis=1)))
    found: list[tuple[int, float, PlantRows]] = []
    for angle in np.radians(np.arange(-90.0, 90.0, _STEP_DEG) + _STEP_DEG):
        along, across = feet @ (np.cos(angle), np.sin(angle)), feet @ (-np.sin(angle), np.cos(angle))
        found += _rows(along, across, nearest)
    return min(found, key=lambda each: each[:2])[2] if found else None


def _rows(along: FloatArray, across: FloatArray, nearest: float) -> list[tuple[int, float, PlantRows]]:
    """The rows along one direction, where there are any, after their number and how far plants stand off them."""
    order, many = np.argsort(across), int(len(across) >= _MANY)
    row = np.zeros(len(across), np.int64)
    row[order[1:]] = np.cumsum(np.diff(across[order]) > _ROWS_APART * nearest)
    sizes = np.bincount(row)
    if sizes.min() < 2 or sizes.max() < 3:
        return []
    middle = np.bincount(row, across) / sizes
    width = max(float(np.ptp(across[row == number])) for number in range(len(sizes)))
    between = float(np.diff(middle).min()) if len(sizes) > 1 else np.inf
    off = float(np.sqrt(np.mean((across - middle[row]) ** 2)))
    if off > _OFF[many] * nearest or width > _WIDE_ROW * between:
        return []
    order = np.lexsort((along, row))
    in_row = np.zeros_like(row)
    in_row[order] = np.concatenate([np.arange(size) for size in sizes]) + 1
    steps = np.diff(along[order])[np.diff(row[order]) == 0]
    spacing, places = float(np.median(steps)), steps
    for _ in range(3):
        places = np.maximum(1.0, np.floor(steps / spacing + (2.0 - GAP)))
        spacing = float(steps.sum() / places.sum())
    if np.sqrt(np.mean((steps / spacing - places) ** 2)) > _UNEVEN[many]:
        return []
    return [(len(sizes), off, PlantRows(row + 1, in_row, spacing, int((places - 1.0).sum())))]
