"""Pictures of cameras about the plants: those of a plan, and those of a flight with its legs, home and plots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from fieldkit.arrays import FloatArray
from fieldkit.clouds.cloud import Cloud
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.pictures.panels import FRONT, INK, SIDE, TOP, Direction, annotate, draw_cloud, drawable, view_row
from fieldkit.results.plan import Plan

_CAMERA, _LEG, _OUTLINE = "#c0262d", "#2f6db3", "#8a5a2b"
_SHARE = 0.1
"""Length of a frustum as a share of the cameras' spread."""
_MOST_NAMES = 100
"""Most plots that are named."""


def draw_plan(title: str, plan: Plan) -> Figure:
    """A plan's cameras about its plants: from above, from the front and from the side, to one scale."""
    poses = [station.pose for station in plan.stations]
    positions, forward = np.array([pose.center for pose in poses]), np.array([pose.rotation[2] for pose in poses])
    plants = Cloud(np.array(() if plan.plants is None else plan.plants.points_m).reshape(-1, 3))
    arrow = 0.25 * float(np.median(np.linalg.norm(positions - positions.mean(axis=0), axis=1)))
    everything = np.concatenate([plants.points, positions, positions + arrow * forward])
    figure, views = view_row(title, [(direction, everything) for direction in (TOP, FRONT, SIDE)])
    for direction, axes, window in views:
        draw_cloud(axes, plants, direction, window)
        arrows = np.stack([positions, positions + arrow * forward], axis=1)
        _draw_cameras(axes, list(arrows), direction, linewidth=0.9, size=4.0)
        for number, spot in enumerate(positions, 1):
            annotate(axes, str(number), direction.flat(spot))
    return figure


def draw_mission(
    title: str,
    legs: Sequence[FloatArray],
    cameras: Sequence[Pose],
    camera: Intrinsics,
    plants: Cloud,
    outlines: Sequence[FloatArray],
    *,
    near: int,
    near_plants: Cloud,
    stations: Sequence[str],
    plots: Sequence[str],
    home: FloatArray,
) -> Figure:
    """A flight about the plants: all of it from above, and its first plot from above and from the front.

    The view from the front shows only the first plot: others would lie before and behind it.

    Args:
        legs: (k, 3) each: the way from one stop to the next; metres, heights above home.
        cameras: of the photographs in the order they are taken, in the same frame.
        camera: intrinsics of the drawn frusta.
        plants: in the same frame; may be empty.
        outlines: (k, 2) each: fences, zones and obstacles from above.
        near: number of cameras of the first plot, which come first.
        near_plants: plants of that plot.
        stations: of the cameras, as people number them.
        plots: of the cameras; their names stand at the middle of each plot's cameras.
        home: (2,) where the vehicle takes off.
    """
    centers = np.array([pose.center for pose in cameras])
    spread = float(np.linalg.norm(np.ptp(centers[:near], axis=0)))
    frusta = [frustum(pose, camera, max(_SHARE * spread, 0.05)) for pose in cameras]
    close = np.concatenate([*frusta[:near], near_plants.points])
    whole = np.concatenate([*legs, *frusta, plants.points])
    first = drawable(plots[0])
    names = ("All of it from above", f"{first} from above", f"{first} from the front")
    figure, views = view_row(title, [(TOP, whole), (TOP, close), (FRONT, close)], names=names)
    for k, (direction, axes, window) in enumerate(views):
        of_all = direction is TOP
        shown = plants if of_all else near_plants
        if len(shown):
            draw_cloud(axes, shown, direction, window)
        _draw_lines(axes, legs if of_all else legs[: near + 1], direction, _LEG, linewidth=0.9, zorder=3)
        if of_all:
            _draw_surroundings(axes, outlines, home)
        if k == 0:
            _name_plots(axes, centers, plots)
        of_view = frusta if of_all else frusta[:near]
        edges = [corners[[0, 1, 2, 0, 3, 4, 0, 1, 4, 3, 2]] for corners in of_view]
        _draw_cameras(axes, edges, direction, linewidth=0.6, size=2.5)
        for number, corners in zip(stations, of_view, strict=False):
            x, y = direction.flat(corners[0])
            if k and window.left < x < window.right and window.bottom < y < window.top:
                annotate(axes, drawable(number), (x, y))
    return figure


def frustum(pose: Pose, camera: Intrinsics, depth_m: float) -> FloatArray:
    """(5, 3) the projection centre, then the corners of the picture at the given depth, in order."""
    pixels = np.array([[0, 0], [camera.width, 0], [camera.width, camera.height], [0, camera.height]], dtype=np.float64)
    rays = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    corners = depth_m * np.column_stack([rays, np.ones(4)])
    return np.vstack([pose.center, pose.center + corners @ pose.rotation])


def _draw_surroundings(axes: Axes, outlines: Sequence[FloatArray], home: FloatArray) -> None:
    """Outlines, north and home from above."""
    for outline in outlines:
        axes.plot(*np.vstack([outline, outline[:1]]).T, color=_OUTLINE, linewidth=0.9, zorder=2)
    axes.annotate(
        "N",
        (0.96, 0.97),
        (0.96, 0.86),
        xycoords="axes fraction",
        textcoords="axes fraction",
        size=8,
        color=INK,
        ha="center",
        va="center",
        zorder=7,
        arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 0.9},
    )
    axes.scatter([home[0]], [home[1]], marker="^", s=30, color=INK, zorder=6)
    annotate(axes, "home", (float(home[0]), float(home[1])), shift=(5, -9))


def _name_plots(axes: Axes, centers: FloatArray, plots: Sequence[str]) -> None:
    """Each plot's name at the middle of its cameras; of very many, some."""
    known = list(dict.fromkeys(plots))
    of = np.array(plots)
    for name in known[:: -(-len(known) // _MOST_NAMES) or 1]:
        x, y = centers[of == name, :2].mean(axis=0)
        axes.annotate(
            drawable(name),
            (x, y),
            size=7,
            weight="bold",
            color=INK,
            ha="center",
            va="center",
            zorder=7,
            parse_math=False,
            path_effects=[withStroke(linewidth=2, foreground="white")],
        )


def _draw_cameras(
    axes: Axes, lines: Sequence[FloatArray], direction: Direction, *, linewidth: float, size: float
) -> None:
    """Lines (k, 3) that begin at cameras, which are dots."""
    _draw_lines(axes, lines, direction, _CAMERA, linewidth=linewidth, zorder=4)
    spots = np.array([direction.flat(line[0]) for line in lines]).reshape(-1, 2)
    axes.plot(*spots.T, "o", color=_CAMERA, markersize=size, zorder=5)


def _draw_lines(
    axes: Axes, lines: Sequence[FloatArray], direction: Direction, color: str, *, linewidth: float, zorder: int
) -> None:
    """Lines (k, 3) in one piece: single ones of a whole field take seconds."""
    flat = [line[:, [direction.right, direction.up]] for line in lines]
    axes.add_collection(LineCollection(flat, colors=color, linewidths=linewidth, alpha=0.8, zorder=zorder))
