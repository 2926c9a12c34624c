"""The picture of a field from straight above: its orthophoto with the plots' outlines, ids and heights."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import shapely
from matplotlib.figure import Figure

from fieldkit.pictures.panels import DPI, FAINT, INK, PAPER, drawable

_SIDE_PX = 1800
"""Longer side of the picture."""
_LETTERS = 0.12
"""Size of labels as a share of the smallest plot's side (root of its area): so they can be read on a page, 640 wide."""
_MOST_PT = 22.0
"""Largest size of labels, points."""


def field_picture(
    orthophoto: Path, outlines: Mapping[str, shapely.Geometry], heights: Mapping[str, float | None]
) -> tuple[bytes, shapely.Polygon]:
    """As JPEG, and what it shows: its corners counter-clockwise from the lower right.

    Args:
        orthophoto: file of it.
        outlines: of the plots by id, in its coordinates.
        heights: of their plants, metres, where they are known.
    """
    import rasterio

    with rasterio.open(orthophoto) as file:
        height, width = (max(1, round(_SIDE_PX * side / max(file.shape))) for side in file.shape)
        picture = np.moveaxis(file.read(out_shape=(3, height, width)), 0, -1)
        picture[file.dataset_mask(out_shape=(height, width)) == 0] = 255
        shape = shapely.box(*file.bounds)
    left, bottom, right, top = shape.bounds
    side_m = np.sqrt(shapely.area([*outlines.values()]).min())
    size = min(_MOST_PT, 72.0 / DPI * _LETTERS * side_m * width / (right - left))
    figure = Figure((width / DPI, height / DPI))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(picture, extent=(left, right, bottom, top))
    axes.set_axis_off()
    for name, outline in outlines.items():
        height_m = heights.get(name)
        axes.plot(*shapely.get_coordinates(outline).T, color=PAPER, linewidth=1.5)
        text = drawable(name) if height_m is None else f"{drawable(name)}\n{height_m:.2f} m"
        box = {"facecolor": PAPER, "edgecolor": FAINT, "alpha": 0.85, "pad": 2.0}
        middle = outline.centroid
        axes.text(middle.x, middle.y, text, size=size, color=INK, ha="center", va="center", parse_math=False, bbox=box)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="jpeg", dpi=DPI)
    return buffer.getvalue(), shape
