"""The picture of what a flight over a field photographs: plots by their photographs, and where these are taken."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import shapely
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from fieldkit.arrays import FloatArray
from fieldkit.pictures.panels import INK, TOP, Panel, add_panel, drawable, fitting_scale, new_figure

_NONE, _MANY, _CAMERA = "#c0262d", "#4f8f3f", "#2f6db3"
_SIDE = 8.0
"""Of the picture's panel, inches."""
_MOST_NAMES = 60
"""Most plots that are named, those without photographs first."""


def draw_coverage(
    title: str, plots: Mapping[str, tuple[shapely.Polygon, int]], places: FloatArray, looks: FloatArray
) -> Figure:
    """A field from above: plots darker with more photographs, those without any red.

    Args:
        title: of the figure.
        plots: outline, metres east and north, and number of photographs by name.
        places: (n, 2) of the photographs.
        looks: (n, 2) ways that they look, level parts of unit vectors.
    """
    corners = {name: shapely.get_coordinates(outline) for name, (outline, _) in plots.items()}
    flat = np.vstack([places, places + looks, *corners.values()])
    spread = np.column_stack([flat, np.zeros(len(flat))])
    panel = Panel(0.6, 0.4, _SIDE, _SIDE)
    figure = new_figure(_SIDE + 1.0, _SIDE + 1.4, title)
    middle, scale = 0.5 * (spread.min(axis=0) + spread.max(axis=0)), fitting_scale(np.ptp(spread, axis=0), TOP, panel)
    axes, _ = add_panel(figure, panel, middle, TOP, scale, "Plots with the number of their photographs", unit="m")
    most = max((number for _, number in plots.values()), default=0) or 1
    colors = [_MANY if number else _NONE for _, number in plots.values()]
    patches = PatchCollection(
        [Polygon(ring) for ring in corners.values()], facecolor=colors, edgecolor="white", zorder=2
    )
    patches.set_alpha([0.2 + 0.5 * number / most if number else 0.7 for _, number in plots.values()])
    axes.add_collection(patches)
    axes.quiver(*places.T, *looks.T, color=_CAMERA, units="xy", scale=1.0, width=0.06, zorder=4)
    axes.plot(*places.T, ".", color=_CAMERA, markersize=2.0, zorder=4)
    for name, (outline, number) in sorted(plots.items(), key=lambda item: item[1][1])[:_MOST_NAMES]:
        at, text = outline.centroid, f"{drawable(name)}\n{number}"
        axes.text(at.x, at.y, text, size=6, color=INK, ha="center", va="center", zorder=6, parse_math=False)
    return figure
