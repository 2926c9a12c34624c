"""Figures about the objective: values against noise, two fidelities against each other, recorded subsets."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from fieldkit.pictures.panels import COLORS, INK, drawable
from fieldkit.pictures.plot_axes import dress, panel_row

Curve = Mapping[float, Sequence[float]]


def png(figure: Figure) -> bytes:
    """The figure as bytes of a PNG file, equal for equal figures."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def draw_bands(panels: Mapping[str, Curve], label: str) -> Figure:
    """Values (metres) against one quantity per panel: the mean as a line, ± one standard deviation as a band.

    Args:
        panels: by the x axis's name, the values of all repeats by x.
        label: of the y axis, drawn in millimetres.
    """
    figure, row = panel_row(len(panels))
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
    figure, row = panel_row(len(panels))
    for axes, (name, (x, y)), color in zip(row, panels.items(), COLORS * len(panels), strict=False):
        axes.plot(1000.0 * np.asarray(x), 1000.0 * np.asarray(y), "o", color=color, markersize=4)
        dress(axes, f"{labels[0]}, mm", f"{labels[1]}, mm")
        axes.set_title(drawable(name), size=10, color=INK, loc="left")
    return figure
