"""A picture of how the plants of a plot were told apart."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fieldkit.clouds import Cloud
from fieldkit.pictures.panels import COLORS, INK, draw_cloud, view_row
from fieldkit.pictures.projection import FRONT, SIDE, TOP
from fieldkit.scenes.plants_apart import PlantsApart
from fieldkit.wording import count

_NO_PLANT = (196, 192, 182)


def draw_plants_apart(title: str, cloud: Cloud, apart: PlantsApart) -> Figure:
    """The cloud from above, from the front and from the side, to one scale, in a colour per plant.

    Points of no plant are light grey. Each plant's number stands at its foot.

    Args:
        title: of the figure; the result is added to it.
        cloud: n points, at least one, plot frame.
        apart: of these points.
    """
    found = f"not told apart: {apart.refused}" if apart.refused else "1 plant" if apart.count == 1 else (
        f"{count(apart.count, 'plant')}, {apart.clear:.0%} clearly nearest to their own foot"
    )  # fmt: skip
    figure, views = view_row(f"{title}: {found}", [(direction, cloud.points) for direction in (TOP, FRONT, SIDE)])
    colors = _colors(apart.numbers)
    for direction, axes, window in views:
        draw_cloud(axes, cloud.points, colors, direction, window)
        for number, foot in enumerate(apart.feet_m, 1):
            axes.annotate(
                str(number), direction.flat(foot), (0, 0), textcoords="offset points", size=9, weight="bold",
                color=INK, ha="center", va="center", zorder=6, parse_math=False,
                bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": INK, "linewidth": 0.8},
            )  # fmt: skip
    return figure


def _colors(numbers: NDArray[np.int32]) -> NDArray[np.uint8]:
    """(n, 3) colours of the points; they repeat after eight plants."""
    palette = np.array([tuple(round(255 * v) for v in to_rgb(color)) for color in COLORS], dtype=np.uint8)
    colors = palette[(numbers - 1) % len(palette)]
    colors[numbers == 0] = _NO_PLANT
    return np.asarray(colors, np.uint8)
