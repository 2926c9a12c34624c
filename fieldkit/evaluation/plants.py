"""The plants of a plot one by one: where each stands, how high it is, how much ground it covers. Pure functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.clouds.canopy import Canopy, Outline, canopy, highest_leaf_m, inside_outline
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.plant_rows import LEAST_PLANTS, find_rows
from fieldkit.clouds.plants_apart import everywhere, tell_apart
from fieldkit.reconstruction.result import MetricFrame
from fieldkit.results.frame import Plane
from fieldkit.results.traits import PlantEntry, Trait

_BEYOND_M = 0.75
"""Leaves of plants that stand no farther outside the outline are told from the plot's own: leaves reach as far."""
_TOP_M = 0.05
"""Height below a plant's highest point that is its top, metres."""
_OWN = 0.8
"""Least share of a top's points that are clearly nearest to the plant for it to be its own."""
_NO_ROWS = (
    f"the plants stand in no rows: there are fewer than {LEAST_PLANTS}, or no direction in which all stand in evenly "
    "spaced lines"
)


def plants_one_by_one(
    plants: Cloud,
    ground: Plane,
    frame: MetricFrame,
    outline: Outline | None,
    cells: tuple[float, float, float],
    top_seen: Callable[[FloatArray, float], bool],
) -> tuple[tuple[PlantEntry, ...], dict[str, int], dict[Trait, str]]:
    """The plants that stand on a plot, their counts, and why counts cannot be had.

    Args:
        plants: of the plot and its surroundings, plot frame.
        frame: the plot frame's place.
        outline: of the plot; None counts all plants.
        cells: of the canopy: what a pixel covers, and how far leaves swayed, metres; the seam, in cells.
        top_seen: whether photographs show what stands over places (n, 2) up to a height, with room above it.
    """
    if outline is not None:
        around = shapely.Polygon(outline).buffer(_BEYOND_M).exterior.coords[:-1]
        plants = plants.select(inside_outline(plants.points, tuple(around)))
    heights = ground.heights(plants.points)
    upright = np.column_stack([plants.points[:, :2], heights])  # on slopes, too, all feet are at one height
    on_plot = everywhere if outline is None else partial(inside_outline, outline=outline)
    apart = tell_apart(replace(plants, points=upright), on_plot)
    if apart.refused or apart.sure is None:
        why = f"the plants cannot be told apart: {apart.refused}"
        return (), {}, {"plants": why, "row_gaps": why}
    feet = apart.feet_m[:, :2]
    places = [dict[str, float]()] * len(feet)
    if frame.origin is not None:
        latitude, longitude, _ = frame.origin.to_geodetic(frame.plot_from_source.inverse().apply(ground.above(feet)))
        places = [
            {"latitude_deg": float(a), "longitude_deg": float(b)} for a, b in zip(latitude, longitude, strict=True)
        ]
    own = np.flatnonzero(on_plot(feet))
    rows = find_rows(feet[own])
    crowns = [canopy(upright[of], heights[of], *cells) for of in (apart.numbers == k + 1 for k in range(len(feet)))]
    touching = _touching(crowns)
    found = []
    order = np.lexsort((feet[own, 1], feet[own, 0]) if rows is None else (rows.in_row, rows.row))
    for number, i in enumerate(order, 1):
        k = int(own[i])
        row, in_row = (None, None) if rows is None else (int(rows.row[i]), int(rows.in_row[i]))
        of = apart.numbers == k + 1
        height = max(0.0, highest_leaf_m(upright[of], heights[of], *cells[:2]))
        top = of & (heights > height - _TOP_M)
        certain = top_seen(upright[of], height) and float(apart.sure[top].mean()) >= _OWN
        x, y = (float(v) for v in feet[k])
        found.append(
            PlantEntry(
                plant=number,
                row=row,
                in_row=in_row,
                x_m=x,
                y_m=y,
                **places[k],
                height_m=height,
                height_certain=certain,
                area_m2=crowns[k].covered_m2,
                touching=touching[k],
            )
        )
    counts = {"plants": len(found)} | ({} if rows is None else {"row_gaps": rows.gaps})
    return tuple(found), counts, {"row_gaps": _NO_ROWS} if rows is None else {}


def _touching(crowns: list[Canopy]) -> list[float]:
    """The share of each crown, seen from above, where another is in the same cell or in one of the eight about it."""
    import cv2

    cell = crowns[0].cell_m
    at = np.array([np.rint(np.divide(each.low, cell)) for each in crowns], dtype=np.int64)
    size = np.array([each.cover.shape[::-1] for each in crowns])
    at -= at.min(axis=0)
    columns, rows = (at + size).max(axis=0)
    masks = np.zeros((len(crowns), rows, columns), dtype=np.uint8)
    for mask, each, (left, low) in zip(masks, crowns, at, strict=True):
        mask[low : low + each.cover.shape[0], left : left + each.cover.shape[1]] = each.cover > 0
    wide = np.array([cv2.dilate(mask, np.ones((3, 3), np.uint8)) for mask in masks])
    beside = wide.sum(axis=0, dtype=np.int64)
    return [float(np.mean((beside - own > 0)[mask > 0])) for mask, own in zip(masks, wide, strict=True)]
