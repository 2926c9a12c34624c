"""Pictures of subsets of a recorded rig and their results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from benchmarks.curves import COLORS, dress
from fieldkit.arrays import FloatArray
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.pictures.panels import FAINT, FRONT, INK, TOP, Panel, add_panel, draw_cloud, fitting_scale, new_figure

_WIDTH, _ROW, _MARGIN, _TITLE = 13.0, 3.6, 0.55, 0.6
_COLORS = COLORS[:2]


@dataclass(frozen=True, eq=False)
class Subset:
    """A subset with its result."""

    name: str
    """For people."""
    cloud: Cloud
    """Its plants, plot frame."""
    views: Sequence[int]
    """Indices of its views."""
    value_m: float
    """Its value."""


def draw_subsets(centers: FloatArray, subsets: Sequence[Subset], values: Sequence[float], volume: Volume) -> Figure:
    """A row for each subset: its cameras on the rig, and its cloud from above and from the front; then all values.

    Args:
        centers: (n, 3) of all candidate views, metres.
        subsets: at most two.
        values: of every tried subset, metres.
        volume: of interest.
    """
    figure = new_figure(_WIDTH, _TITLE + _ROW * len(subsets), "Random subsets of a recorded rig")
    side = _ROW - 2 * _MARGIN + 0.3
    everything = np.concatenate([*(subset.cloud.points for subset in subsets), [volume.lower, volume.upper]])
    lower, upper = everything.min(axis=0), everything.max(axis=0)
    for row, (subset, color) in enumerate(zip(subsets, _COLORS, strict=True)):
        bottom = _ROW * (len(subsets) - 1 - row) + 0.5
        title = f"{subset.name}: {1000 * subset.value_m:.2f} mm, {len(subset.views)} views"
        views = (
            (TOP, centers.min(axis=0), centers.max(axis=0), title),
            *((direction, lower, upper, f"cloud {direction.name}") for direction in (TOP, FRONT)),
        )
        for k, (direction, low, high, name) in enumerate(views):
            place = Panel(0.5 + k * (side + 0.35), bottom, side, side)
            scale = fitting_scale(high - low, direction, place)
            axes, window = add_panel(figure, place, 0.5 * (low + high), direction, scale, name, unit="m")
            draw_cloud(axes, subset.cloud, direction, window)
            if not k:
                axes.plot(centers[:, 0], centers[:, 1], ".", color=FAINT, markersize=4, zorder=4)
                chosen = centers[list(subset.views)]
                axes.plot(chosen[:, 0], chosen[:, 1], "o", color=color, markersize=7, zorder=5)
    _draw_values(figure, subsets, values)
    return figure


def _draw_values(figure: Figure, subsets: Sequence[Subset], values: Sequence[float]) -> None:
    width, height = figure.get_size_inches()
    left = 0.5 + 3 * (_ROW - 2 * _MARGIN + 0.3 + 0.35) + 0.35
    axes: Axes = figure.add_axes(
        (left / width, 0.5 / height, (width - left - 0.3) / width, 1 - (_TITLE + 0.7) / height)
    )
    ranked = 1000.0 * np.sort(np.asarray(values))
    dress(axes, "value, mm", "subset, best first")
    axes.plot(ranked, np.arange(1, len(ranked) + 1), "o-", color=INK, markersize=4, linewidth=0.8)
    for subset, color in zip(subsets, _COLORS, strict=True):
        value = 1000.0 * subset.value_m
        axes.plot([value], [1 + int(np.abs(ranked - value).argmin())], "o", color=color, markersize=8)
    axes.set_xlim(left=0)
    axes.invert_yaxis()
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
