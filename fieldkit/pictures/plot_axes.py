"""Plots with axes: a row of them, and the house style of each."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fieldkit.pictures.panels import DPI, INK, PAPER, drawable


def panel_row(count: int, width_in: float = 3.6) -> tuple[Figure, list[Axes]]:
    """A figure with so many plots in a row."""
    figure = Figure(figsize=(width_in * count, 3.2), dpi=DPI, facecolor=PAPER, layout="constrained")
    return figure, list(np.atleast_1d(figure.subplots(1, count)))


def dress(axes: Axes, x: str, y: str) -> None:
    """The house style of a plot, with its axes' names."""
    axes.set_facecolor("white")
    axes.set_xlabel(drawable(x), size=9, color=INK)
    axes.set_ylabel(drawable(y), size=9, color=INK)
    axes.grid(color="#e6e3da", linewidth=0.8)
    axes.tick_params(labelsize=8, colors=INK, length=2)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
