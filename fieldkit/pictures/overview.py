"""The overview picture of a reconstruction: the plants from three sides, the cameras, the main figures."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from fieldkit.clouds import Cloud, Volume
from fieldkit.figures.tables.reconstruction import quality_rows
from fieldkit.figures.tables.scores import score_rows
from fieldkit.files import write_atomic
from fieldkit.geometry import Pose
from fieldkit.pictures.panels import (
    BOX,
    FAINT,
    GROUND,
    INK,
    Ground,
    Place,
    add_panel,
    colors_or_grey,
    display_limits,
    draw_cloud,
    draw_ground,
    draw_volume,
    drawable,
    fitting_scale,
    new_figure,
    window_around,
)
from fieldkit.pictures.projection import FRONT, SIDE, TOP, Direction
from fieldkit.results.evaluation import ImageEntry, PlotEvaluation, ReconstructionEntry, ReferenceReport

_WIDTH, _HEIGHT = 15.0, 10.0
_MARGIN, _GAP = 0.45, 0.55
_UPPER = (4.55, 4.65)  # bottom and height of the row of panels with the plants
_LOWER = (0.75, 3.15)
_RIGHT = "#1f5fa8"
_WRONG = "#c0262d"
_MISSING = "#d98300"
_TEXT_COLUMNS = 51
_LABELS_WIDTH = 1.65
_CAMERAS_WIDTH = 4.25


def write_overview(path: Path, report: ReferenceReport | PlotEvaluation, plants: Cloud) -> None:
    """Write the overview picture (PNG).

    Raises:
        StorageError: the place is full or not writable.
    """
    save_figure(path, draw_overview(report, plants))


def draw_overview(report: ReferenceReport | PlotEvaluation, plants: Cloud) -> Figure:
    """The overview picture.

    Args:
        report: of a reconstruction that did not fail.
        plants: its dense cloud, in the plot frame.

    Raises:
        ValueError: the report has no volume, because the reconstruction failed.
    """
    if report.volume is None:
        raise ValueError("a reconstruction that failed has nothing to show")
    volume = Volume(report.volume.lower_m, report.volume.upper_m)
    name = f"{report.source}: reference" if isinstance(report, ReferenceReport) else report.name
    figure = new_figure(_WIDTH, _HEIGHT, name)
    ground = _ground(report)
    unit = "m" if report.metric else ""
    draw_plants(figure, plants, volume, ground, unit)
    _draw_cameras(figure, report, plants, volume, ground, unit)
    _draw_figures(figure, report)
    return figure


def save_figure(path: Path, figure: Figure) -> None:
    """Write a figure as PNG; the same figure gives the same bytes.

    Raises:
        StorageError: the place is full or not writable.
    """
    picture = io.BytesIO()
    figure.savefig(picture, format="png", facecolor=figure.get_facecolor(), metadata={"Software": None})
    write_atomic(path, picture.getvalue())


def draw_plants(
    figure: Figure,
    plants: Cloud,
    volume: Volume,
    ground: Ground | None,
    unit: str,
    row: tuple[float, float] = _UPPER,
    *,
    limits: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
) -> list[Axes]:
    """Three panels with the plants from the front, the side and above, all to one scale.

    Args:
        figure: 15 inches wide.
        plants: the cloud.
        volume: of interest.
        ground: line to draw, or None.
        unit: ``"m"``, or empty where lengths are not metres.
        row: bottom and height of the panels, inches.
        limits: of what fits into the panels, (3,) and (3,), see `display_limits`; None takes those of the plants.
    """
    lower, upper = display_limits(plants.points, volume) if limits is None else limits
    if ground is not None:
        lower = np.array([*lower[:2], min(lower[2], ground.offset_m / max(float(ground.normal[2]), 0.1))])
    size, middle = upper - lower, 0.5 * (lower + upper)
    directions = (FRONT, SIDE, TOP)
    places = _side_by_side([float(size[d.right]) for d in directions], row)
    scale = max(fitting_scale((size[d.right], size[d.up]), p) for d, p in zip(directions, places, strict=True))
    colors = colors_or_grey(plants.points, plants.colors)
    panels = []
    for direction, place in zip(directions, places, strict=True):
        window = window_around((middle[direction.right], middle[direction.up]), place, scale)
        axes = add_panel(figure, place, window, direction.name.capitalize(), unit=unit)
        draw_cloud(axes, plants.points, colors, direction, window)
        draw_volume(axes, volume, direction)
        if ground is not None:
            draw_ground(axes, ground, direction, window, middle)
        panels.append(axes)
    return panels


def _side_by_side(widths: Sequence[float], row: tuple[float, float]) -> list[Place]:
    """Panels in a row, about as wide as their content, each at least a fifth."""
    room = _WIDTH - 2 * _MARGIN - (len(widths) - 1) * _GAP
    shares = np.maximum(np.array(widths) / sum(widths), 0.2)
    lengths = room * shares / shares.sum()
    lefts = _MARGIN + np.concatenate([[0.0], np.cumsum(lengths + _GAP)[:-1]])
    return [Place(float(left), row[0], float(length), row[1]) for left, length in zip(lefts, lengths, strict=True)]


def _draw_cameras(
    figure: Figure,
    report: ReconstructionEntry,
    plants: Cloud,
    volume: Volume,
    ground: Ground | None,
    unit: str,
) -> None:
    images = report.image_reports
    spots = [image.center_m or image.known_center_m for image in images]
    everything = np.array([*volume.corners(), *(spot for spot in spots if spot is not None)])
    lower, upper = everything.min(axis=0), everything.max(axis=0)
    size, middle = upper - lower, 0.5 * (lower + upper)
    places = [Place(_MARGIN + i * (_CAMERAS_WIDTH + _GAP), _LOWER[0], _CAMERAS_WIDTH, _LOWER[1]) for i in range(2)]
    scale = max(fitting_scale((size[d.right], size[d.up]), p) for d, p in zip((TOP, FRONT), places, strict=True))
    colors = colors_or_grey(plants.points, plants.colors)
    for direction, place, title in (
        (TOP, places[0], "Cameras from above"),
        (FRONT, places[1], "Cameras from the front"),
    ):
        window = window_around((middle[direction.right], middle[direction.up]), place, scale)
        axes = add_panel(figure, place, window, title, unit=unit)
        draw_cloud(axes, plants.points, colors, direction, window)
        draw_volume(axes, volume, direction)
        if ground is not None:
            draw_ground(axes, ground, direction, window, middle)
        arrow = 0.05 * min(window.right - window.left, window.top - window.bottom)
        for image in images:
            _draw_camera(axes, image, direction, arrow)
    _legend(figure, report)


def _draw_camera(axes: Axes, image: ImageEntry, direction: Direction, arrow: float) -> None:
    center = image.center_m if image.registered else image.known_center_m
    if center is None:
        return
    x, y = center[direction.right], center[direction.up]
    if not image.registered:
        axes.plot(x, y, "o", color=_MISSING, fillstyle="none", markersize=5, markeredgewidth=1.2, zorder=5)
        return
    wrong = image.right is False
    color = _WRONG if wrong else _RIGHT
    if image.yaw_deg is not None and image.pitch_deg is not None:
        forward = Pose.from_yaw_pitch(center, image.yaw_deg, image.pitch_deg).forward
        ends = [x, x + 2 * arrow * forward[direction.right]], [y, y + 2 * arrow * forward[direction.up]]
        axes.plot(*ends, color=color, linewidth=0.8, alpha=0.8, zorder=4)
    axes.plot(x, y, "x" if wrong else "o", color=color, markersize=6 if wrong else 3, zorder=5)


def _legend(figure: Figure, report: ReconstructionEntry) -> None:
    wrong = sum(image.registered and image.right is False for image in report.image_reports)
    missing = [image for image in report.image_reports if not image.registered]
    nowhere = sum(image.known_center_m is None for image in missing)
    where = f", {nowhere} at an unknown place" if nowhere else ""
    marks = [
        Line2D([], [], marker="o", color=_RIGHT, markersize=4, linewidth=1, label=f"registered ({report.right})"),
        Line2D([], [], marker="x", color=_WRONG, markersize=6, linewidth=1, label=f"registered but wrong ({wrong})"),
        Line2D(
            [], [], marker="o", color=_MISSING, fillstyle="none", markersize=5, linestyle="",
            label=f"not registered ({len(missing)}{where})",
        ),
        Line2D([], [], color=BOX, linewidth=0.9, linestyle=(0, (5, 3)), label="volume of interest"),
        Line2D([], [], color=GROUND, linewidth=1.1, label="ground"),
    ]  # fmt: skip
    figure.legend(
        handles=marks, loc="lower left", bbox_to_anchor=(_MARGIN / _WIDTH - 0.005, 0.012), ncols=5, fontsize=8,
        frameon=False, labelcolor=INK, handlelength=1.8, columnspacing=1.6,
    )  # fmt: skip


def _draw_figures(figure: Figure, report: ReferenceReport | PlotEvaluation) -> None:
    left = _MARGIN + 2 * (_CAMERAS_WIDTH + _GAP)
    lines: list[tuple[str, str]] = []
    scores = score_rows(report) if isinstance(report, PlotEvaluation) else ()
    for label, value in (*quality_rows(report), *scores):
        wrapped = textwrap.wrap(drawable(value), _TEXT_COLUMNS) or [""]
        lines += [(label, wrapped[0]), *(("", more) for more in wrapped[1:])]
    step = min(0.175, (_LOWER[1] + 0.3) / max(len(lines), 1))
    size = min(8.0, 8.0 * step / 0.155)
    top = _LOWER[0] + _LOWER[1] + 0.05
    for index, (label, value) in enumerate(lines):
        y = (top - index * step) / _HEIGHT
        figure.text(left / _WIDTH, y, label, size=size, color=FAINT, va="center", parse_math=False)
        figure.text((left + _LABELS_WIDTH) / _WIDTH, y, value, size=size, color=INK, va="center", parse_math=False)


def _ground(report: ReconstructionEntry) -> Ground | None:
    if report.frame is None or report.frame.ground is None:
        return None
    normal: NDArray[np.float64] = np.array(report.frame.ground.normal)
    return Ground(normal, report.frame.ground.offset_m)
