"""The plants that are kept clear of on one plot: the plan's, as far as is known changed to that plot's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from fieldkit.arrays import FloatArray
from fieldkit.errors import MissionError
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan, PlanPlants, Plans
from fieldkit.sites.site import LEVEL, Gradient, Site, SitePlot

BAND_M = 0.05
"""Height of the bands that plants are cut into as obstacles, metres."""
_ARC = 4  # sides in a quarter turn
_SIMPLER_M = 0.01
"""Distance by which outlines are simplified, metres."""
SAME_SPACING = 0.1
"""Share by which a row spacing may differ and still be the plan's."""
BESIDE_M = 0.25
"""A plot that reaches no farther beyond the plan's plants is not larger: where its edge is drawn is a convention."""
UNKNOWN_SHARE = 1.3
"""By what plants of unknown height may be taller than the tallest whose height is known."""
HEIGHT_TAKEN = "plant-height-taken"
"""Code of a plot whose plants nobody states a height of."""
PlantHeight = float | Literal["unknown"]
"""Metres, for all plots; or "unknown"."""
_STEP_M = 0.05
"""Step in which plants are made higher, metres."""
_FARTHEST_M = 10_000.0
"""Largest distance of a plant from the plot's origin, metres."""
_HIGHEST_M = 100.0
"""Largest height of a plant above or below it, metres."""

# Of rows of plants.
_BIN_M = 0.02
"""Width of the bins across rows, metres."""
_SMOOTH_M = 0.06
"""Standard deviation over which they are smoothed, metres."""
_TURNS_DEG = tuple(range(-12, 13, 3))
"""Directions against x that rows are looked for in, degrees."""
STANDS_SHARE = 0.4
"""Of the plants' height: stems and the feet of leaves, which stand in rows also where leaves meet."""
_CELL_M = 0.05
"""Side of the cells that plants' feet are counted in, metres."""
_GAP = 0.5  # of the lower of two rows, that the ground between them has at most
_ROW = 0.3  # of the strongest row, that a row has at least
_EVEN = 0.2  # by which a spacing may differ from the others'
_LONG = 1.2  # spacings that a row is long
_LEAST_POINTS = 30
"""Least number of points, and of cells, that show rows."""
_ROWS_WITHIN_M = 1000.0
"""Largest distance of a point from the plot's origin where rows are looked for, metres."""


@dataclass(frozen=True)
class Band:
    """An upright prism from the ground to a height."""

    corners: tuple[tuple[float, float], ...]
    """(x, y) in the plot frame, metres, without a repeated last one."""
    top_m: float
    """Plot frame."""


def no_fly_bands(plants: PlanPlants, clearance_m: float) -> tuple[Band, ...]:
    """Prisms that fill the places nearer to a plant than a distance, and those below them.

    They are stacked like the steps of a hill: each holds the discs that spheres about the points cut out of its upper
    side. So they lie within the spheres, and cameras that the planner put at just this distance are outside; what is
    outside is nearer than the distance by less than `BAND_M` and 2 cm. What is wholly surrounded by plants counts as
    plants.
    """
    points: FloatArray = np.array(plants.points_m, dtype=np.float64).reshape(-1, 3)
    if not len(points):
        return ()
    highest = float(points[:, 2].max()) + clearance_m
    steps = max(1, math.ceil((highest - float(points[:, 2].min())) / BAND_M))
    found: list[Band] = []
    whole, above = shapely.Polygon(), np.zeros(len(points), dtype=np.bool_)
    for top in highest - BAND_M * np.arange(1, steps + 1):
        # Downwards, so that discs that have their full size are united once.
        rising = ~above & (points[:, 2] >= top)
        whole, above = shapely.union_all([whole, *_discs(points[rising], clearance_m)]), above | rising
        shoulder = ~above & (points[:, 2] + clearance_m > top)
        radii = np.sqrt(clearance_m**2 - (top - points[shoulder, 2]) ** 2)
        plan = shapely.simplify(shapely.union_all([whole, *_discs(points[shoulder], radii)]), _SIMPLER_M)
        for part in shapely.get_parts(plan):
            if isinstance(part, shapely.Polygon) and not part.is_empty:
                corners = tuple((float(x), float(y)) for x, y in shapely.get_coordinates(part.exterior)[:-1])
                found.append(Band(corners, float(top)))
    return tuple(reversed(found))


def _discs(points: FloatArray, radii: FloatArray | float) -> NDArray[np.object_]:
    discs: NDArray[np.object_] = shapely.buffer(
        shapely.points(points[:, :2]), np.maximum(radii - _SIMPLER_M, 0.0), quad_segs=_ARC
    )
    return discs


@dataclass(frozen=True)
class Block:
    """A rectangle of a plot that plants are taken to fill, for nobody knows where in it they stand."""

    low: tuple[float, float]
    high: tuple[float, float]
    """(x, y) of two corners, plot frame, metres."""
    top_m: float
    """Above the ground."""

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """(x, y), anticlockwise."""
        (a, b), (c, d) = self.low, self.high
        return (a, b), (c, b), (c, d), (a, d)


@dataclass(frozen=True, eq=False)
class PlanFacts:
    """What a plan says of the plot that it was made on."""

    plan: Plan

    @cached_property
    def points(self) -> FloatArray:
        """(m, 3) of the plants, plot frame; empty where the plan does not say where they are."""
        given = () if self.plan.plants is None else self.plan.plants.points_m
        points = np.array(given, dtype=np.float64).reshape(-1, 3)
        if not (np.abs(points) <= (_FARTHEST_M, _FARTHEST_M, _HIGHEST_M)).all():
            raise MissionError(
                f"a plant of the plan lies farther than {_FARTHEST_M / 1000:g} km from the plot's origin, or "
                f"{_HIGHEST_M:g} m above or below it",
                remedy="Give a plan in the plot frame, in metres.",
            )
        return points

    @property
    def top_m(self) -> float | None:
        """Height of the highest plant above the ground; None where the plan knows no plants."""
        return float(self.points[:, 2].max()) if len(self.points) else None

    @cached_property
    def spacing_m(self) -> float | None:
        """From row to row; None where that cannot be told."""
        return row_spacing_m(self.points)

    @property
    def box(self) -> tuple[FloatArray, FloatArray] | None:
        """Least and greatest (x, y) of the plants."""
        return (self.points[:, :2].min(axis=0), self.points[:, :2].max(axis=0)) if len(self.points) else None


def facts_of(plans: Plans | None, site: Site) -> list[tuple[SitePlot, PlanFacts | None]]:
    """Every plot of a site with what its plan says; None where none is known, as of neighbours.

    What a plan says is found out once.
    """
    facts: dict[int, PlanFacts] = {}
    by_plot = {plot.name: plans for plot in site.plots} if isinstance(plans, Plan) else plans or {}
    found = [(plot, by_plot.get(plot.name)) for plot in site.all_plots]
    return [(plot, None if plan is None else facts.setdefault(id(plan), PlanFacts(plan))) for plot, plan in found]


@dataclass(frozen=True, eq=False)
class PlotPlants:
    """The plants of one plot, for flying."""

    points: FloatArray
    """(m, 3) plot frame, z above the ground: the plan's, stretched upwards where this plot's are higher."""
    blocks: tuple[Block, ...]
    """That count as full: the plot's outline, and the rectangle about the plan's plants where rows are elsewhere."""
    cell_m: float
    """Of the plan's grid."""

    @cached_property
    def outside(self) -> FloatArray:
        """(k, 3) of the points those that no block holds."""
        held = np.zeros(len(self.points), dtype=np.bool_)
        for block in self.blocks:
            inside = (self.points[:, :2] >= block.low) & (self.points[:, :2] <= block.high)
            held |= inside.all(axis=1) & (self.points[:, 2] <= block.top_m)
        return self.points[~held]

    @property
    def clear_m(self) -> float:
        """The height of plants that is kept clear of, wherever they stand."""
        tops = [block.top_m for block in self.blocks]
        return min([*tops, float(self.points[:, 2].max())] if len(self.points) else tops)

    def bands(self, clearance_m: float, slope: Gradient = LEVEL) -> tuple[Band, ...]:
        """The air that the points take, as `no_fly_bands`, in a frame with z above the ground at the origin.

        ``slope`` is the rise of the ground along x and y; the points stand on it. Those within blocks are left out.
        """
        points = self.outside
        if slope != LEVEL:
            points = np.column_stack([points[:, :2], points[:, 2] + points[:, :2] @ np.array(slope)])
        rows = tuple((float(x), float(y), float(z)) for x, y, z in points)
        return no_fly_bands(PlanPlants(points_m=rows, cell_m=self.cell_m), clearance_m)


def with_plant_height(site: Site, plans: Plans | None, given: PlantHeight | None) -> Site:
    """The site with the height of every plot's plants, as far as that is known.

    Where nobody says one, plants count as `UNKNOWN_SHARE` times as high as the tallest that any plot states; people are
    told so by `heights_taken`.

    Args:
        plans: flown there; none where they are not known.
        given: metres replace what plots say; with "unknown" the plants that plans know are among those stated.
    """
    if given is not None and given != "unknown":
        return site.with_each(lambda plot: plot.model_copy(update={"plant_height_m": given}))
    stated = [plot.plant_height_m for plot in site.all_plots]
    if given is not None:
        for plan in (plans,) if isinstance(plans, Plan) else (plans or {}).values():
            stated += [PlanFacts(plan).top_m, plan.plant_height_m]
    tallest = max((height for height in stated if height is not None), default=None)
    if tallest is None:
        return site
    taken = {"plant_height_m": UNKNOWN_SHARE * tallest}
    return site.with_each(lambda plot: plot.model_copy(update=taken if plot.plant_height_m is None else {}))


def heights_taken(before: Site, after: Site, given: PlantHeight | None) -> tuple[Finding, ...]:
    """What people are told of plots whose plants' height `with_plant_height` had to take."""
    stated = {plot.name for plot in before.all_plots if plot.plant_height_m is not None}
    return tuple(
        Finding(
            plot.name,
            HEIGHT_TAKEN,
            f"nobody says how high its plants are: they count as {plot.plant_height_m:.2f} m high, the tallest known "
            "ones and 30 %",
            remedy="Measure them: plant_height_m in the plots file gives each plot's.",
        )
        for plot in after.all_plots
        if plot.name not in stated and plot.plant_height_m not in (None, given)
    )


def same_height_m(height_m: float) -> float:
    """By how much plants may differ from a plan's in height and still be its own, for fitting as for keeping clear."""
    return min(0.05 * height_m, 0.05)


def plants_on(facts: PlanFacts | None, plot: SitePlot) -> PlotPlants | None:
    """The plants of a plot: the plan's, changed by what the site says of this plot.

    - Where ``plant_height_m`` is more than the height that the plan is stated for, by more than `same_height_m`, the
      plan's plants are stretched upwards by as much, in steps of 5 cm. Lower ones change nothing.
    - Where ``row_spacing_m`` is another than the plan's rows have (by more than 10 %), the rectangle about the plan's
      plants counts as full.
    - All of a plot of known size and plant height counts as full, up to that height. Leaves may make it higher.

    None where neither the plan nor the site says where plants are.
    """
    outline: tuple[Block, ...] = ()
    if plot.size_m is not None and plot.plant_height_m is not None:
        length, width = 0.5 * plot.size_m[0], 0.5 * plot.size_m[1]
        outline = (Block((-length, -width), (length, width), plot.plant_height_m),)
    if facts is None or facts.plan.plants is None or facts.top_m is None or facts.box is None:
        return PlotPlants(np.zeros((0, 3)), outline, _STEP_M) if outline else None
    top, box = facts.top_m, facts.box
    stated = max(top, facts.plan.plant_height_m or 0.0)  # the points stand in cells, so their top is a little lower
    more = (plot.plant_height_m or 0.0) - stated
    steps = math.ceil(more / _STEP_M - 1e-6) if more > same_height_m(stated) else 0
    height, points = top + _STEP_M * steps, facts.points
    if steps > 0 and top > 0.0:
        points = points * np.array([1.0, 1.0, height / top])
    blocks: list[Block] = []
    if plot.row_spacing_m is not None and other_spacing(facts.spacing_m, plot.row_spacing_m):
        blocks.append(_block(box[0], box[1], height))
    return PlotPlants(points, (*blocks, *outline), facts.plan.plants.cell_m)


def other_spacing(plan_m: float | None, plot_m: float) -> bool:
    """Whether rows are known to be farther apart or nearer than the plan's."""
    return plan_m is not None and abs(plot_m - plan_m) > SAME_SPACING * plan_m


def _block(low: FloatArray, high: FloatArray, top_m: float) -> Block:
    (a, b), (c, d) = low.tolist(), high.tolist()
    grow = 0.5e-3  # a row that is a line of points still has an area
    return Block((a - grow, b - grow), (c + grow, d + grow), top_m)


def row_spacing_m(points: FloatArray) -> float | None:
    """Distance from row to row of plants whose rows run along x, or nearly so.

    Points of the lower part of the plants are counted across the rows, in directions within 12° of x, and rows are
    evenly spaced peaks with gaps between them. Each row has to be longer than the spacing, or single plants beside each
    other would be taken for rows. None where there are fewer than two rows, or they cannot be told apart. ``points``
    (n, 3) are in the plot frame, z above the ground, about one per cell of a grid.
    """
    if len(points) < _LEAST_POINTS or not np.isfinite(points).all():
        return None
    if float(np.abs(points[:, :2]).max()) > _ROWS_WITHIN_M:
        return None
    top = float(points[:, 2].max())
    low = points[points[:, 2] <= STANDS_SHARE * top]
    cells = np.unique(np.floor(low[:, :2] / _CELL_M).astype(np.int64), axis=0) * _CELL_M + 0.5 * _CELL_M
    if len(cells) < _LEAST_POINTS:
        return None
    best: tuple[float, float] | None = None
    for turn in np.radians(_TURNS_DEG):
        along, across = (cells @ axis for axis in ((np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))))
        found = _rows(along, across)
        if found is not None and (best is None or found[0] > best[0]):
            best = found
    return None if best is None else best[1]


def _rows(along: FloatArray, across: FloatArray) -> tuple[float, float] | None:
    """Contrast of the rows in one direction, and their spacing."""
    from scipy.ndimage import gaussian_filter1d  # half a second, which most commands can do without
    from scipy.signal import find_peaks

    start = float(across.min()) - 4 * _SMOOTH_M
    bins = max(8, int(np.ceil((float(across.max()) + 4 * _SMOOTH_M - start) / _BIN_M)))
    counts = np.bincount(((across - start) / _BIN_M).astype(np.int64), minlength=bins).astype(np.float64)
    density = gaussian_filter1d(counts, _SMOOTH_M / _BIN_M, mode="constant")
    peaks, _ = find_peaks(density, height=_ROW * float(density.max()))
    if len(peaks) < 2:
        return None
    steps = np.diff(peaks) * _BIN_M
    spacing = float(steps.mean())
    if np.abs(steps - spacing).max() > _EVEN * spacing:
        return None
    for a, b in pairwise(peaks.tolist()):
        if density[a:b].min() > _GAP * min(density[a], density[b]):
            return None
    for peak in peaks:
        row = along[np.abs(across - (start + (peak + 0.5) * _BIN_M)) <= 0.25 * spacing]
        if float(np.percentile(row, 95) - np.percentile(row, 5)) < _LONG * spacing:
            return None
    return float(density.std() / density.mean()), spacing
