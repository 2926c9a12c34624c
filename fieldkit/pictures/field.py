"""The picture of a field from straight above: its orthophoto with the plots' outlines, ids and heights."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from fieldkit.pictures.panels import DPI, FAINT, INK, PAPER, drawable

FIELD_PICTURE = "field.jpg"
_WIDTH = 12.0
"""Width of the picture, inches: 1800 pixels."""
_LARGEST = 13.0
"""Most inches of its height."""
_HEIGHTS = "viridis"
"""Matplotlib's colours of heights."""


def field_picture(
    orthophoto: Path, outlines: Mapping[str, shapely.Geometry], heights: Mapping[str, float | None]
) -> bytes:
    """As JPEG, at most 2000 pixels.

    Args:
        orthophoto: file of it.
        outlines: of the plots by id, in its coordinates.
        heights: of their plants, metres, where they are known.
    """
    import rasterio

    with rasterio.open(orthophoto) as file:
        share = min(1.0, DPI * _WIDTH / max(file.shape))
        size = tuple(max(1, int(share * side)) for side in file.shape)
        picture = np.moveaxis(file.read(out_shape=(3, *size)), 0, -1)
        picture[file.dataset_mask(out_shape=size) == 0] = 255
        left, bottom, right, top = file.bounds
    known = [height for height in heights.values() if height is not None]
    share_of, colors = Normalize(min(known, default=0.0), max(known, default=1.0)), mpl.colormaps[_HEIGHTS]
    figure = Figure((_WIDTH, min(_LARGEST, _WIDTH * (top - bottom) / (right - left))), facecolor=PAPER)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(picture, extent=(left, right, bottom, top))
    axes.set_axis_off()
    for name, outline in outlines.items():
        height = heights.get(name)
        color = FAINT if height is None else colors(share_of(height))
        axes.plot(*shapely.get_coordinates(outline).T, color=color, linewidth=2.5)
        text = drawable(name) if height is None else f"{drawable(name)}\n{height:.2f} m"
        box = {"facecolor": PAPER, "edgecolor": color, "alpha": 0.85, "pad": 2.0}
        middle = outline.centroid
        axes.text(middle.x, middle.y, text, size=8, color=INK, ha="center", va="center", parse_math=False, bbox=box)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="jpeg", dpi=DPI)
    return buffer.getvalue()
