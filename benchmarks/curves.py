"""Pictures of curves: values against noise, two ways against each other, and searches' regret."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from fieldkit.pictures.panels import DPI, INK, PAPER, drawable

COLORS = ("#1f5fa8", "#c0262d", "#3f7d20", "#d98300", "#7a6fb0", "#5b5b5b", "#8a5a2b", "#12807f")
"""Colours of lines, in turn."""

Curve = Mapping[float, Sequence[float]]


def dress(axes: Axes, x: str, y: str) -> None:
    """The house style of a plot, with its axes' names."""
    axes.set_facecolor("white")
    axes.set_xlabel(drawable(x), size=9, color=INK)
    axes.set_ylabel(drawable(y), size=9, color=INK)
    axes.grid(color="#e6e3da", linewidth=0.8)
    axes.tick_params(labelsize=8, colors=INK, length=2)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def draw_bands(panels: Mapping[str, Curve], label: str) -> Figure:
    """All values (metres) against one quantity per panel, in millimetres: mean and ± one standard deviation.

    Args:
        panels: by the x axis's name, the values of all repeats by x.
        label: of the y axis.
    """
    figure, row = _row(len(panels), 3.6)
    for axes, (name, curve), color in zip(row, panels.items(), COLORS, strict=False):
        x = sorted(curve)
        mean = np.array([1000.0 * np.mean(curve[v]) for v in x])
        spread = np.array([1000.0 * np.std(curve[v], ddof=1) if len(curve[v]) > 1 else 0.0 for v in x])
        axes.fill_between(x, mean - spread, mean + spread, color=color, alpha=0.2, linewidth=0)
        axes.plot(x, mean, "o-", color=color, markersize=4)
        for v in x:
            axes.plot([v] * len(curve[v]), [1000.0 * y for y in curve[v]], ".", color=color, markersize=2, alpha=0.6)
        dress(axes, name, f"{label}, mm")
        axes.set_ylim(0.0, 1.08 * max(1000.0 * max(curve[v]) for v in x))
    return figure


def draw_agreement(panels: Mapping[str, tuple[Sequence[float], Sequence[float]]], labels: tuple[str, str]) -> Figure:
    """Values (metres) of one way against another, a panel each, drawn in millimetres."""
    figure, row = _row(len(panels), 3.6)
    for axes, (name, (x, y)), color in zip(row, panels.items(), COLORS * len(panels), strict=False):
        axes.plot(1000.0 * np.asarray(x), 1000.0 * np.asarray(y), "o", color=color, markersize=4)
        dress(axes, f"{labels[0]}, mm", f"{labels[1]}, mm")
        axes.set_title(drawable(name), size=10, color=INK, loc="left")
    return figure


def draw_regret(panels: Mapping[str, Mapping[str, Sequence[Sequence[float | None]]]]) -> Figure:
    """Best so far (simple regret) against evaluations, logarithmic: a panel per place, a curve per method.

    Args:
        panels: by place and method, a curve per seed in metres; several curves are drawn as median and range.
    """
    figure, row = _row(len(panels), 5.2)
    for axes, (place, methods) in zip(row, panels.items(), strict=True):
        for (method, curves), color in zip(methods.items(), COLORS * len(methods), strict=False):
            length = min(len(curve) for curve in curves)
            lines = 1000.0 * np.array([curve[:length] for curve in curves], dtype=np.float64)  # None becomes NaN
            trials = np.arange(1, length + 1)
            axes.step(
                trials,
                np.nanmedian(lines, axis=0),
                where="post",
                color=color,
                label=method,
                linewidth=1.6,
                marker="o" if length == 1 else "",
                markersize=4,
            )
            if len(curves) > 1:
                low, high = np.nanmin(lines, axis=0), np.nanmax(lines, axis=0)
                axes.fill_between(trials, low, high, step="post", color=color, alpha=0.15, linewidth=0)
        # Sets without a cloud cost a hundred times as much as good ones.
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0) if high > 10.0 * low else range(1, 10)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_locator(NullLocator())
        dress(axes, "evaluation", "best so far, mm")
        axes.set_title(drawable(place), size=10, color=INK, loc="left")
        axes.legend(fontsize=7, frameon=False, labelcolor=INK, ncols=2)
    return figure


def _row(count: int, width_in: float) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width_in * count, 3.2), dpi=DPI, facecolor=PAPER, layout="constrained")
    return figure, list(np.atleast_1d(figure.subplots(1, count)))
