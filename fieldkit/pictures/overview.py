"""The overview picture of a reconstruction: the plants from three sides, and the cameras."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke

from fieldkit.arrays import FloatArray
from fieldkit.clouds import Cloud, read_cloud
from fieldkit.files import write_atomic
from fieldkit.geometry import Pose
from fieldkit.pictures.panels import (
    FRONT,
    INK,
    SIDE,
    TOP,
    Direction,
    Panel,
    add_panel,
    draw_cloud,
    fitting_scale,
    new_figure,
    png,
)
from fieldkit.results.evaluation import (
    CLOUD_FILE,
    EvaluationReport,
    ImageReport,
    PlotEvaluation,
    ReconstructionEntry,
    ReferenceReport,
)

OVERVIEW_FILE = "overview.png"
_WIDTH = 15.0
"""Width of the picture, inches."""
_HEIGHT = 10.0
"""Height of the picture, inches."""
_MARGIN = 0.45
"""Room about the panels, inches."""
_GAP = 0.55
"""Room between panels, inches."""
_UPPER = (4.55, 4.65)  # bottom and height of the row of panels with the plants
_LOWER = (0.75, 3.15)
"""Bottom and height of the row of panels with the cameras, inches."""
_CAMERAS_WIDTH = (_WIDTH - 2 * _MARGIN - _GAP) / 2
"""Width of a panel with the cameras, inches."""
_GROUND, _BOX = "#8a5a2b", "#7a6fb0"
_RIGHT, _WRONG, _MISSING = "#1f5fa8", "#c0262d", "#d98300"


def write_overviews(folder: Path, report: ReferenceReport | EvaluationReport) -> None:
    """Write the overview pictures of a result beside its clouds (`CLOUD_FILE`)."""
    parts = (report,) if isinstance(report, ReferenceReport) else report.plots
    for part in parts:
        for file in part.files:
            if Path(file.name).name == CLOUD_FILE:
                cloud = folder / file.name
                write_atomic(cloud.with_name(OVERVIEW_FILE), png(draw_overview(part, read_cloud(cloud))))


def draw_overview(report: ReferenceReport | PlotEvaluation, plants: Cloud) -> Figure:
    """The overview picture of a reconstruction and its dense cloud, in the plot frame; ValueError if it failed."""
    if report.volume is None:
        raise ValueError("a reconstruction that failed has nothing to show")
    name = f"{report.source}: reference" if isinstance(report, ReferenceReport) else report.name
    figure = new_figure(_WIDTH, _HEIGHT, name)
    lower, upper = _limits(plants.points, report)
    directions = (FRONT, SIDE, TOP)
    _draw_panels(
        figure,
        report,
        plants,
        lower,
        upper,
        _side_by_side([float((upper - lower)[d.right]) for d in directions]),
        directions,
        [direction.name.capitalize() for direction in directions],
    )
    spots = [spot for image in report.image_reports if (spot := image.center_m or image.known_center_m) is not None]
    everything = np.array([report.volume.lower_m, report.volume.upper_m, *spots])
    places = [Panel(_MARGIN + i * (_CAMERAS_WIDTH + _GAP), _LOWER[0], _CAMERAS_WIDTH, _LOWER[1]) for i in range(2)]
    views = _draw_panels(
        figure,
        report,
        plants,
        everything.min(axis=0),
        everything.max(axis=0),
        places,
        (TOP, FRONT),
        ("Cameras from above", "Cameras from the front"),
    )
    for axes, direction in views:
        arrow = 0.05 * min(float(np.ptp(axes.get_xlim())), float(np.ptp(axes.get_ylim())))
        for image in report.image_reports:
            _draw_camera(axes, image, direction, arrow)
    _legend(figure, report)
    return figure


def _draw_panels(
    figure: Figure,
    report: ReconstructionEntry,
    plants: Cloud,
    lower: FloatArray,
    upper: FloatArray,
    places: Sequence[Panel],
    directions: Sequence[Direction],
    titles: Sequence[str],
) -> list[tuple[Axes, Direction]]:
    """Panels of the part between two corners (3,), to one scale: plants, volume of interest and ground."""
    middle = 0.5 * (lower + upper)
    scale = max(fitting_scale(upper - lower, d, place) for d, place in zip(directions, places, strict=True))
    panels = []
    for direction, place, title in zip(directions, places, titles, strict=True):
        unit = "m" if report.metric else ""
        axes, window = add_panel(figure, place, middle, direction, scale, title, unit=unit)
        draw_cloud(axes, plants, direction, window)
        if report.volume is not None:
            low, high = direction.flat(np.array(report.volume.lower_m)), direction.flat(np.array(report.volume.upper_m))
            axes.add_patch(
                Rectangle(
                    low,
                    high[0] - low[0],
                    high[1] - low[1],
                    fill=False,
                    edgecolor=_BOX,
                    linewidth=0.9,
                    linestyle=(0, (5, 3)),
                    zorder=3,
                )
            )
        ground = None if report.frame is None else report.frame.ground
        if ground is not None and direction.up == 2 and abs(ground.normal[2]) > 1e-6:
            # Where the ground cuts the plane through the middle that faces the viewer.
            ends = np.array([window.left, window.right])
            known = ground.normal[direction.right] * ends + ground.normal[direction.toward] * middle[direction.toward]
            axes.plot(ends, (ground.offset_m - known) / ground.normal[2], color=_GROUND, linewidth=1.1, zorder=2)
        for plant in report.plants if direction is TOP else ():
            axes.text(
                plant.x_m,
                plant.y_m,
                str(plant.plant),
                size=8,
                weight="bold",
                color=INK,
                ha="center",
                va="center",
                clip_on=True,
                zorder=7,
                path_effects=[withStroke(linewidth=2.0, foreground="white")],
            )
        panels.append((axes, direction))
    return panels


def _limits(points: FloatArray, report: ReconstructionEntry) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corner of the part to show: all points without stragglers down to the ground, else the volume."""
    assert report.volume is not None
    if not len(points):
        return np.array(report.volume.lower_m), np.array(report.volume.upper_m)
    lower, upper = np.quantile(points, [0.001, 0.999], axis=0)
    small = 0.05 * max(float((upper - lower).max()), 1e-6)
    flat = upper - lower < small
    lower, upper = np.where(flat, lower - small, lower), np.where(flat, upper + small, upper)
    if report.frame is not None and (ground := report.frame.ground) is not None:
        lower[2] = min(lower[2], ground.offset_m / max(ground.normal[2], 0.1))
    return lower, upper


def _side_by_side(widths: Sequence[float]) -> list[Panel]:
    """Panels in a row, about as wide as their content, each at least a fifth."""
    room = _WIDTH - 2 * _MARGIN - (len(widths) - 1) * _GAP
    shares = np.maximum(np.array(widths) / sum(widths), 0.2)
    lengths = room * shares / shares.sum()
    lefts = _MARGIN + np.concatenate([[0.0], np.cumsum(lengths + _GAP)[:-1]])
    return [Panel(float(left), _UPPER[0], float(n), _UPPER[1]) for left, n in zip(lefts, lengths, strict=True)]


def _draw_camera(axes: Axes, image: ImageReport, direction: Direction, arrow: float) -> None:
    posed = image.registered or image.stated
    center = image.center_m if posed else image.known_center_m
    if center is None:
        return
    x, y = center[direction.right], center[direction.up]
    if not posed:
        axes.plot(x, y, "o", color=_MISSING, fillstyle="none", markersize=5, markeredgewidth=1.2, zorder=5)
        return
    wrong = not image.counts
    color = _WRONG if wrong else _RIGHT
    if image.yaw_deg is not None and image.pitch_deg is not None:
        forward = Pose.from_yaw_pitch(center, image.yaw_deg, image.pitch_deg).forward
        ends = [x, x + 2 * arrow * forward[direction.right]], [y, y + 2 * arrow * forward[direction.up]]
        axes.plot(*ends, color=color, linewidth=0.8, alpha=0.8, zorder=4)
    axes.plot(x, y, "x" if wrong else "o", color=color, markersize=6 if wrong else 3, zorder=5)


def _legend(figure: Figure, report: ReconstructionEntry) -> None:
    wrong = sum(image.registered and not image.counts for image in report.image_reports)
    used = "used" if any(image.stated for image in report.image_reports) else "registered"
    missing = [image for image in report.image_reports if not (image.registered or image.stated)]
    nowhere = sum(image.known_center_m is None for image in missing)
    where = f", {nowhere} at an unknown place" if nowhere else ""
    marks = [
        Line2D([], [], marker="o", color=_RIGHT, markersize=4, linewidth=1, label=f"{used} ({report.right})"),
        Line2D([], [], marker="x", color=_WRONG, markersize=6, linewidth=1, label=f"registered but wrong ({wrong})"),
        Line2D(
            [],
            [],
            marker="o",
            color=_MISSING,
            fillstyle="none",
            markersize=5,
            linestyle="",
            label=f"not registered ({len(missing)}{where})",
        ),
        Line2D([], [], color=_BOX, linewidth=0.9, linestyle=(0, (5, 3)), label="volume of interest"),
        Line2D([], [], color=_GROUND, linewidth=1.1, label="ground"),
    ]
    figure.legend(
        handles=marks,
        loc="lower left",
        bbox_to_anchor=(_MARGIN / _WIDTH - 0.005, 0.012),
        ncols=5,
        fontsize=8,
        frameon=False,
        labelcolor=INK,
        handlelength=1.8,
        columnspacing=1.6,
    )
