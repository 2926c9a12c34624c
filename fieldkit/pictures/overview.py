"""The overview picture of a reconstruction: the plants from three sides, and the cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fieldkit.clouds import Cloud, read_cloud
from fieldkit.files import write_atomic
from fieldkit.pictures.panels import FRONT, INK, SIDE, TOP, annotate, draw_cloud, png, view_row
from fieldkit.results.evaluation import (
    CLOUD_FILE,
    EvaluationReport,
    PlotEvaluation,
    ReconstructionEntry,
    ReferenceReport,
)

OVERVIEW_FILE = "overview.png"
_PAD_M = 0.03
"""Room about the plants, metres."""
_GROUND, _BOX = "#8a5a2b", "#7a6fb0"
_RIGHT, _WRONG, _MISSING = "#1f5fa8", "#c0262d", "#d98300"
_ARROW = 0.1  # of the volume's diagonal


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
    volume = np.array([report.volume.lower_m, report.volume.upper_m])
    box = volume
    if len(plants):  # but for stragglers
        box = np.quantile(plants.points, [0.001, 0.999], axis=0) + np.array([[-_PAD_M], [_PAD_M]])
    spots = [spot for image in report.image_reports if (spot := image.center_m or image.known_center_m) is not None]
    directions = (FRONT, SIDE, TOP)
    figure, panels = view_row(
        f"{report.source}: reference" if isinstance(report, ReferenceReport) else report.name,
        [*((direction, box) for direction in directions), (TOP, np.array([*volume, *spots]))],
        names=[*(direction.name.capitalize() for direction in directions), "Cameras from above"],
        unit="m" if report.metric else "",
    )
    ground = None if report.frame is None else report.frame.ground
    for direction, axes, window in panels:
        draw_cloud(axes, plants, direction, window)
        (left, bottom), (right, top) = map(direction.flat, volume)
        edges = [left, right, right, left, left], [bottom, bottom, top, top, bottom]
        axes.plot(*edges, color=_BOX, linewidth=0.9, linestyle=(0, (5, 3)), zorder=3, label="volume of interest")
        if ground is not None and direction.up == 2 and abs(ground.normal[2]) > 1e-6:
            # Where the ground cuts the plane through the middle that faces the viewer.
            ends, middle = np.array([window.left, window.right]), box.mean(axis=0)[direction.toward]
            cut = ground.normal[direction.right] * ends + ground.normal[direction.toward] * middle
            axes.plot(ends, (ground.offset_m - cut) / ground.normal[2], color=_GROUND, linewidth=1.1, zorder=2)
    (_, above, _), (_, cameras, _) = panels[2:]
    for plant in report.plants:
        annotate(above, str(plant.plant), (plant.x_m, plant.y_m), shift=(0, 0))
    _draw_cameras(cameras, report, _ARROW * float(np.linalg.norm(np.ptp(volume, axis=0))))
    figure.legend(
        *cameras.get_legend_handles_labels(), loc="lower left", ncols=4, fontsize=8, frameon=False, labelcolor=INK
    )
    return figure


def _draw_cameras(axes: Axes, report: ReconstructionEntry, arrow_m: float) -> None:
    """Photographs that count, wrong ones and missing ones from above, with what they look at."""
    images = report.image_reports
    used = "used" if any(image.stated for image in images) else "registered"
    groups = (
        (used, [image for image in images if image.counts], _RIGHT, "o"),
        ("registered but wrong", [image for image in images if image.registered and not image.counts], _WRONG, "x"),
        ("not registered", [image for image in images if not (image.registered or image.stated)], _MISSING, "s"),
    )
    for label, members, color, marker in groups:
        spots = [spot for image in members if (spot := image.center_m or image.known_center_m) is not None]
        x, y, _ = np.array(spots).reshape(-1, 3).T
        axes.plot(x, y, marker, color=color, markersize=4, zorder=5, label=f"{label} ({len(members)})")
        for pose in (image.pose for image in members if image.registered):
            if pose is not None:
                ends = np.stack([pose.center, pose.center + arrow_m * pose.forward])
                axes.plot(*ends[:, :2].T, color=color, linewidth=0.8, alpha=0.8, zorder=4)
