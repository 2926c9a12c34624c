"""The picture of a comparison: figures by evaluation, a line per plot, with intervals of the differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fieldkit.figures.registry import figure as figure_of
from fieldkit.pictures.overview import save_figure
from fieldkit.pictures.panels import COLORS, DPI, FAINT, INK, PAPER, drawable
from fieldkit.pictures.plot_axes import dress
from fieldkit.results.comparison import ComparisonReport

_COLUMNS, _MOST_FIGURES, _MOST_NAMED = 3, 9, 8
_WIDTH, _ROW_HEIGHT = 4.8, 3.3
_LONGEST = 18


def write_compare_picture(path: Path, report: ComparisonReport) -> None:
    """Write the picture of a comparison (PNG).

    Raises:
        StorageError: the place is full or not writable.
    """
    save_figure(path, draw_comparison_of(report))


def draw_comparison_of(report: ComparisonReport) -> Figure:
    """A panel per figure: values by evaluation in the order given, a line per plot.

    Bars are the 95 % intervals of the differences to the first evaluation, drawn about the values. Filled markers lie
    beyond noise, open ones within; crosses mark unknown noise.
    """
    figures = report.figures[:_MOST_FIGURES]
    rows = max(1, -(-len(figures) // _COLUMNS))
    columns = min(_COLUMNS, max(1, len(figures)))
    figure = Figure(
        figsize=(_WIDTH * columns, _ROW_HEIGHT * rows + 0.6), dpi=DPI, facecolor=PAPER, layout="constrained"
    )
    panels = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    plots = list(dict.fromkeys(value.plot for value in report.values))
    for axes, name in zip(panels, figures, strict=False):
        _draw(axes, report, name, plots)
    for axes in panels[len(figures) :]:
        axes.set_axis_off()
    if 1 < len(plots) <= _MOST_NAMED and figures:
        panels[0].legend(fontsize=7, frameon=False, labelcolor=INK)
    figure.suptitle(
        "filled: beyond noise of the difference to the first; open: within; ×: cannot be told; bars: 95 %", size=9,
        color=FAINT, x=0.01, ha="left", parse_math=False,
    )  # fmt: skip
    return figure


def _draw(axes: Axes, report: ComparisonReport, name: str, plots: list[str]) -> None:
    labels = [evaluation.label for evaluation in report.evaluations]
    first = labels[0]
    shown = figure_of(name)
    factor = shown.factor
    values = {(v.plot, v.label): factor * v.value for v in report.values if v.figure == name}
    told = {(d.plot, d.label): d for d in report.differences if d.figure == name and d.less == first}
    for k, plot in enumerate(plots):
        color = COLORS[k % len(COLORS)]
        offset = 0.0 if len(plots) == 1 else 0.24 * (k / (len(plots) - 1) - 0.5)
        at = [i for i, label in enumerate(labels) if (plot, label) in values]
        heights = [values[plot, labels[i]] for i in at]
        axes.plot([i + offset for i in at], heights, "-", color=color, linewidth=1.0, alpha=0.6, label=_short(plot))
        for i, height in zip(at, heights, strict=True):
            found = told.get((plot, labels[i]))
            if found is None:
                axes.plot(i + offset, height, "s", color=color, markersize=5)
                continue
            if found.low is not None and found.high is not None:
                half = 0.5 * factor * (found.high - found.low)
                axes.errorbar(i + offset, height, yerr=half, color=color, linewidth=1.0, capsize=2)
            marker, face = ("x", color) if found.beyond is None else ("o", color if found.beyond else "white")
            axes.plot(i + offset, height, marker, color=color, markerfacecolor=face, markersize=5.5)
    dress(axes, "", shown.title)
    axes.set_xlim(-0.5, len(labels) - 0.5)
    step = max(1, len(labels) // 8)
    axes.set_xticks(range(0, len(labels), step), [_short(label) for label in labels[::step]], parse_math=False)


def _short(label: str) -> str:
    return drawable(label if len(label) <= _LONGEST else f"{label[: _LONGEST - 1]}…")
