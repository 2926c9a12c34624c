"""Picture of a flight: its legs and the cameras' frusta about the plants, home, the plots' names, and north."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from fieldkit.clouds.cloud import Cloud
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.pictures.panels import INK, colors_or_grey, draw_cloud, drawable, view_row
from fieldkit.pictures.projection import FRONT, TOP, Direction

_CAMERA, _LEG, _OUTLINE = "#c0262d", "#2f6db3", "#8a5a2b"
_SHARE = 0.1
_MOST_NAMES = 100

Array = NDArray[np.float64]


def draw_mission(
    title: str,
    legs: Sequence[Array],
    cameras: Sequence[Pose],
    camera: Intrinsics,
    plants: Cloud,
    outlines: Sequence[Array] = (),
    *,
    near: int | None = None,
    near_plants: Cloud | None = None,
    stations: Sequence[str] = (),
    plots: Sequence[str] = (),
    home: Array | None = None,
) -> Figure:
    """A flight about the plants: all of it from above, and its first plot from above and from the front.

    The view from the front shows only the first plot: others would lie before and behind it.

    Args:
        title: of the figure.
        legs: (k, 3) each: the way from one stop to the next; metres, heights above home.
        cameras: of the photographs in the order they are taken, in the same frame.
        camera: intrinsics of the drawn frusta.
        plants: in the same frame; may be empty.
        outlines: (k, 2) each: fences, zones and obstacles from above.
        near: number of cameras of the first plot, which come first; None means all.
        near_plants: plants of that plot; None takes those of ``plants`` about its cameras.
        stations: of the cameras, as people number them; counted in the order of flight where not given.
        plots: of the cameras; their names stand at the middle of each plot's cameras.
        home: (2,) or (3,) where the vehicle takes off.
    """
    centers = np.array([pose.center for pose in cameras])
    first = centers[:near]
    spread = float(np.linalg.norm(np.ptp(first, axis=0)))
    depth = max(_SHARE * spread, 0.05)
    frusta = [frustum(pose, camera, depth) for pose in cameras]
    low, high = first[:, :2].min(axis=0) - 0.3 * spread, first[:, :2].max(axis=0) + 0.3 * spread
    beside = ((plants.points[:, :2] >= low) & (plants.points[:, :2] <= high)).all(axis=1)
    if near_plants is None:
        near_plants = plants if near is None else plants.select(beside)
    close = np.concatenate([*frusta[:near], near_plants.points])
    whole = np.concatenate([*legs, *frusta, plants.points])
    first_plot = drawable(plots[0]) if plots else "The first plot"
    names = ("All of it from above", f"{first_plot} from above", f"{first_plot} from the front")
    numbers = list(stations) or [str(number) for number in range(1, len(cameras) + 1)]
    figure, views = view_row(title, [(TOP, whole), (TOP, close), (FRONT, close)], names=names)
    for direction, axes, window in views:
        beyond = direction is not FRONT
        shown = plants if beyond else near_plants
        if len(shown):
            draw_cloud(axes, shown.points, colors_or_grey(shown.points, shown.colors), direction, window)
        if direction is TOP:
            for outline in outlines:
                axes.plot(
                    *np.vstack([outline, outline[:1]]).T, color=_OUTLINE, linewidth=0.9, zorder=2, scalex=False,
                    scaley=False,
                )  # fmt: skip
        for leg in legs if beyond or near is None else legs[: near + 1]:
            axes.plot(leg[:, direction.right], leg[:, direction.up], color=_LEG, linewidth=0.9, alpha=0.8, zorder=3)
        closer = axes is not figure.axes[0]
        if direction is TOP:
            _draw_north(axes)
            if home is not None:
                _draw_home(axes, home)
        if not closer:
            _name_plots(axes, centers, plots)
        for number, corners in zip(numbers, frusta if beyond else frusta[:near], strict=False):
            _draw_frustum(axes, corners, direction)
            x, y = direction.flat(corners[0])
            if closer and window.left < x < window.right and window.bottom < y < window.top:
                axes.annotate(
                    drawable(number), (x, y), (3, 3), textcoords="offset points", size=7, color=INK, zorder=6,
                    parse_math=False,
                )  # fmt: skip
        axes.set_xlim(window.left, window.right)
        axes.set_ylim(window.bottom, window.top)
    return figure


def _draw_north(axes: Axes) -> None:
    axes.annotate(
        "N", (0.96, 0.97), (0.96, 0.86), xycoords="axes fraction", textcoords="axes fraction", size=8, color=INK,
        ha="center", va="center", zorder=7, arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 0.9},
    )  # fmt: skip


def _draw_home(axes: Axes, home: Array) -> None:
    x, y = float(home[0]), float(home[1])
    axes.scatter([x], [y], marker="^", s=30, color=INK, zorder=6)
    axes.annotate(
        "home", (x, y), (5, -9), textcoords="offset points", size=7, color=INK, zorder=7, annotation_clip=True,
    )  # fmt: skip


def _name_plots(axes: Axes, centers: Array, plots: Sequence[str]) -> None:
    """Each plot's name at the middle of its cameras; of very many, some."""
    known = list(dict.fromkeys(plots))
    of = np.array(plots)
    for name in known[:: -(-len(known) // _MOST_NAMES) or 1]:
        x, y = centers[of == name, :2].mean(axis=0)
        axes.annotate(
            drawable(name), (x, y), size=7, weight="bold", color=INK, ha="center", va="center", zorder=7,
            parse_math=False, path_effects=[withStroke(linewidth=2, foreground="white")],
        )  # fmt: skip


def frustum(pose: Pose, camera: Intrinsics, depth_m: float) -> Array:
    """(5, 3) the projection centre, then the corners of the picture at the given depth, in order."""
    pixels = np.array([[0, 0], [camera.width, 0], [camera.width, camera.height], [0, camera.height]], dtype=np.float64)
    rays = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    corners = depth_m * np.column_stack([rays, np.ones(4)])
    return np.vstack([pose.center, pose.center + corners @ pose.rotation])


def _draw_frustum(axes: Axes, corners: Array, direction: Direction) -> None:
    order = [0, 1, 2, 0, 3, 4, 0, 1, 4, 3, 2]
    axes.plot(
        corners[order, direction.right], corners[order, direction.up], color=_CAMERA, linewidth=0.6, alpha=0.8, zorder=4
    )
    axes.plot(*direction.flat(corners[0]), "o", color=_CAMERA, markersize=2.5, zorder=5)
