"""The picture of a plot's adherence: the pose of each photograph by every source, against its station."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from fieldkit.figures.style import format_length
from fieldkit.geometry.angles import wrapped_deg
from fieldkit.pictures.overview import save_figure
from fieldkit.pictures.panels import (
    FAINT,
    INK,
    Place,
    add_panel,
    drawable,
    fitting_scale,
    new_figure,
    nice_length,
    window_around,
)
from fieldkit.pictures.plot_axes import dress
from fieldkit.results.evaluation import AdherenceEntry, PhotographPosesEntry, PoseEntry

_WIDTH, _HEIGHT = 15.0, 7.8
_TOP_VIEW = Place(0.6, 0.75, 6.6, 5.75)
_RIGHT, _RIGHT_WIDTH = 8.1, 6.4
_PANELS = (("up, m", 4.95, 1.5), ("yaw, °", 2.75, 1.5), ("pitch, °", 0.75, 1.3))
_ARROW_SHARE = 0.25
_COLORS = {"commanded": "#d98300", "reported": "#1f5fa8", "tagged": "#7a6fb0", "reconstructed": "#c0262d"}
"""Markers also differ, for colour-blind eyes."""
_MARKERS = {"commanded": "D", "reported": "s", "tagged": "^", "reconstructed": "o"}
_MOST_NUMBERS = 80

Array = NDArray[np.float64]


def write_adherence_picture(path: Path, name: str, found: AdherenceEntry) -> None:
    """Write the picture of a plot's adherence (PNG).

    Raises:
        StorageError: the place is full or not writable.
    """
    save_figure(path, draw_adherence(name, found))


def draw_adherence(name: str, found: AdherenceEntry) -> Figure:
    """Exaggerated lines from stations to the sources' poses, from above; beside them heights and angles.

    The common offset of a source's photographs, such as a receiver's, is left out of its lines and heights and stated
    in the legend.

    Args:
        name: of the plot.
        found: its adherence, with photographs.
    """
    rows = sorted((row for row in found.photographs if row.planned is not None), key=lambda row: _key(row.station))
    figure = new_figure(_WIDTH, _HEIGHT, f"{name}: where photographs were taken, against the plan")
    stations = np.array([row.planned.position_m for row in rows if row.planned is not None]).reshape(-1, 3)
    sources = [s for s in _COLORS if any(getattr(row, s) is not None for row in rows)]
    apart = {source: _apart(rows, source) for source in sources}
    common = {source: np.nanmedian(values[:, :3], axis=0) for source, values in apart.items()}
    _top_view(figure, found, rows, stations, apart, common)
    _beside(figure, rows, apart, common)
    figure.legend(
        handles=_legend(common), loc="upper left", bbox_to_anchor=(0.03, 0.935), ncols=3, fontsize=8,
        frameon=False, labelcolor=INK, handletextpad=0.4, columnspacing=1.6,
    )  # fmt: skip
    return figure


def _top_view(
    figure: Figure,
    found: AdherenceEntry,
    rows: list[PhotographPosesEntry],
    stations: Array,
    apart: dict[str, Array],
    common: dict[str, Array],
) -> None:
    flat = stations[:, :2] if len(stations) else np.zeros((1, 2))
    size = np.maximum(np.ptp(flat, axis=0), 0.2)
    scale = fitting_scale(size, _TOP_VIEW, margin=0.2)
    window = window_around(tuple(0.5 * (flat.min(axis=0) + flat.max(axis=0))), _TOP_VIEW, scale)
    lengths = [np.hypot(*(v[:, :2] - common[s][:2]).T) for s, v in apart.items()]
    longest = max((float(np.nanmax(length)) for length in lengths if np.isfinite(length).any()), default=0.0)
    # A round factor with which the longest line takes up to a quarter of the view.
    factor = 1.0 if longest <= 0 else max(nice_length(_ARROW_SHARE * float(max(size)) / longest), 1.0)
    axes = add_panel(
        figure,
        _TOP_VIEW,
        window,
        f"From above; lines from the stations, {factor:g} times as long as they are",
        unit="m",
    )
    axes.plot(*flat.T, "+", color=INK, markersize=9, zorder=3)
    for source, values in apart.items():
        for start, step in zip(flat, values[:, :2] - common[source][:2], strict=True):
            if np.isfinite(step).all():
                end = start + factor * step
                axes.plot([start[0], end[0]], [start[1], end[1]], color=_COLORS[source], linewidth=1.3, zorder=4)
                axes.plot(*end, _MARKERS[source], color=_COLORS[source], markersize=4, zorder=5)
    for row, (x, y) in zip(rows[:_MOST_NUMBERS], flat, strict=False):
        axes.annotate(
            _number(row.station), (x, y), (-5, 5), textcoords="offset points", size=7, color=FAINT, ha="right",
            zorder=6, parse_math=False,
        )  # fmt: skip
    axes.set_xlim(window.left, window.right)
    axes.set_ylim(window.bottom, window.top)
    missing = f"; stations without a photograph: {len(found.missing)}" if found.missing else ""
    extra = f"; photographs of no station: {len(found.extra)}" if found.extra else ""
    axes.set_xlabel(f"plot frame, m{missing}{extra}", size=8, color=FAINT, loc="left")


def _beside(
    figure: Figure, rows: list[PhotographPosesEntry], apart: dict[str, Array], common: dict[str, Array]
) -> None:
    order = np.arange(len(rows))
    for column, (label, bottom, height) in enumerate(_PANELS, 2):
        place = (_RIGHT / _WIDTH, bottom / _HEIGHT, _RIGHT_WIDTH / _WIDTH, height / _HEIGHT)
        axes: Axes = figure.add_axes(place)
        axes.axhline(0.0, color=INK, linewidth=0.8)
        any_known = False
        for k, (source, values) in enumerate(apart.items()):
            shown = values[:, column] - (common[source][2] if column == 2 else 0.0)
            known = np.isfinite(shown)
            any_known |= bool(known.any())
            beside = 0.13 * (k - 0.5 * (len(apart) - 1))
            axes.vlines(order[known] + beside, 0.0, shown[known], color=_COLORS[source], linewidth=1.0)
            axes.plot(order[known] + beside, shown[known], _MARKERS[source], color=_COLORS[source], markersize=4)
        if not any_known:
            axes.text(0.5, 0.6, "not known", size=8, color=FAINT, ha="center", transform=axes.transAxes)
        dress(axes, "station" if column == 4 else "", f"{label} off")
        axes.set_xlim(-0.7, len(rows) - 0.3)
        step = max(1, len(rows) // 25)
        axes.set_xticks(order[::step], [_number(rows[k].station) for k in order[::step]], parse_math=False)
    figure.text(
        _RIGHT / _WIDTH, 6.62 / _HEIGHT, "Less the plan: up without what is common to all, yaw and pitch as they are",
        size=9, color=INK, va="center", parse_math=False,
    )  # fmt: skip


def _legend(common: dict[str, Array]) -> list[Line2D]:
    handles = [Line2D([], [], marker="+", linestyle="", color=INK, markersize=9, label="planned station")]
    for source, shift in common.items():
        label = f"{source}; all shifted by {', '.join(format_length(float(v)) for v in shift)} (x, y, z)"
        handles.append(
            Line2D([], [], marker=_MARKERS[source], color=_COLORS[source], markersize=5, label=drawable(label))
        )
    return handles


def _apart(rows: list[PhotographPosesEntry], source: str) -> Array:
    """(n, 5) x, y, z, yaw and pitch less the plan's; NaN if unknown."""
    result = np.full((len(rows), 5), np.nan)
    for k, row in enumerate(rows):
        pose: PoseEntry | None = getattr(row, source)
        if pose is None or row.planned is None:
            continue
        result[k, :3] = np.subtract(pose.position_m, row.planned.position_m)
        if pose.yaw_deg is not None and row.planned.yaw_deg is not None:
            result[k, 3] = wrapped_deg(pose.yaw_deg - row.planned.yaw_deg)
        if pose.pitch_deg is not None and row.planned.pitch_deg is not None:
            result[k, 4] = pose.pitch_deg - row.planned.pitch_deg
    return result


def _key(station: str | None) -> tuple[int, str]:
    number = _number(station)
    return (int(number) if number.isdecimal() else 0, number)


def _number(station: str | None) -> str:
    return "" if station is None else drawable(station.removeprefix("station "))
