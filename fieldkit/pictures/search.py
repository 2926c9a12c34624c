"""Figures of a planning run: its regret curve with the models' weights, and the plan's cameras about the plants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from fieldkit.clouds.cloud import Cloud
from fieldkit.pictures.panels import COLORS, INK, colors_or_grey, draw_cloud, drawable, view_row
from fieldkit.pictures.plot_axes import dress, panel_row
from fieldkit.pictures.projection import FRONT, SIDE, TOP

_CAMERA = "#c0262d"

Array = NDArray[np.float64]


def draw_search(
    values_m: Sequence[float | None],
    best_m: Sequence[float | None],
    weights: Mapping[str, Sequence[float | None]],
    confirmed_m: float | None,
) -> Figure:
    """Values and the best so far (simple regret with r(z*) = 0) against trials; beside it the models' weights.

    Args:
        values_m: per trial, metres; None if its evaluation broke.
        best_m: per trial, metres.
        weights: per model and trial; None before the first model. Without models they are not drawn.
        confirmed_m: the chosen set's value by its confirmations; None without any.
    """
    figure, row = panel_row(1 + bool(weights), width_in=5.2)
    axes = row[0]
    trials = np.arange(1, len(values_m) + 1)
    axes.plot(trials, _millimetres(values_m), ".", color=COLORS[5], markersize=4, alpha=0.6, label="trial")
    axes.step(trials, _millimetres(best_m), where="post", color=COLORS[0], linewidth=1.6, label="best so far")
    if confirmed_m is not None:
        axes.axhline(
            1000.0 * confirmed_m, color=COLORS[1], linewidth=1.0, linestyle=(0, (4, 3)), label="plan, confirmed"
        )
    finite = _millimetres(values_m)[np.isfinite(_millimetres(values_m))]
    if len(finite):
        axes.set_ylim(0.0, 1.08 * float(np.quantile(finite, 0.97)))
    dress(axes, "trial", "value, mm")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(fontsize=8, frameon=False, labelcolor=INK)
    if weights:
        for (name, line), color in zip(weights.items(), COLORS, strict=False):
            shares = np.array([np.nan if w is None else w for w in line], dtype=np.float64)
            row[1].plot(trials, shares, "o-", color=color, markersize=2, linewidth=1.0, label=name)
        row[1].set_ylim(-0.03, 1.03)
        dress(row[1], "trial", "weight of the model")
        row[1].legend(fontsize=8, frameon=False, labelcolor=INK)
    return figure


def draw_regret(panels: Mapping[str, Mapping[str, Sequence[Sequence[float | None]]]]) -> Figure:
    """Best so far (simple regret) against evaluations, logarithmic: a panel per place, a curve per method.

    Args:
        panels: by place and method, a curve per seed in metres; several curves are drawn as median and range.
    """
    figure, row = panel_row(len(panels), width_in=5.2)
    for axes, (place, methods) in zip(row, panels.items(), strict=True):
        for (method, curves), color in zip(methods.items(), COLORS * len(methods), strict=False):
            length = min(len(curve) for curve in curves)
            lines = np.array([_millimetres(curve[:length]) for curve in curves])
            bayesian = method in ("bosfm", "field")
            trials = np.arange(1, length + 1)
            axes.step(
                trials, np.nanmedian(lines, axis=0), where="post", color=color, label=method,
                linewidth=1.8 if bayesian else 1.4, linestyle="-" if bayesian else (0, (3, 2)),
                marker="o" if length == 1 else "", markersize=4,
            )  # fmt: skip
            if len(curves) > 1:
                axes.fill_between(
                    trials, np.nanmin(lines, axis=0), np.nanmax(lines, axis=0), step="post", color=color, alpha=0.15,
                    linewidth=0,
                )  # fmt: skip
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


def draw_plan(
    title: str, positions: Array, forward: Array, plants: Cloud, others: Array | None = None
) -> Figure:  # fmt: skip
    """A plan's cameras about the plants: from above, from the front and from the side, to one scale.

    Args:
        title: of the figure.
        positions: (n, 3) metres, plot frame.
        forward: (n, 3) unit vectors of the optical axes.
        plants: the reference.
        others: (m, 3) the other cameras of a recorded set.
    """
    others = np.zeros((0, 3)) if others is None else others
    arrow = 0.25 * float(np.median(np.linalg.norm(positions - plants.points.mean(axis=0), axis=1)))
    everything = np.concatenate([plants.points, positions, positions + arrow * forward, others])
    figure, views = view_row(title, [(direction, everything) for direction in (TOP, FRONT, SIDE)])
    for direction, axes, window in views:
        draw_cloud(axes, plants.points, colors_or_grey(plants.points, plants.colors), direction, window)
        axes.plot(
            others[:, direction.right], others[:, direction.up], "o", color=INK, alpha=0.35, markersize=2, zorder=3
        )
        for number, (spot, axis) in enumerate(zip(positions, forward, strict=True), 1):
            x, y = direction.flat(spot)
            u, v = direction.flat(spot + arrow * axis)
            axes.plot([x, u], [y, v], color=_CAMERA, linewidth=0.9, alpha=0.8, zorder=4)
            axes.plot(x, y, "o", color=_CAMERA, markersize=4, zorder=5)
            axes.annotate(
                str(number), (x, y), (3, 3), textcoords="offset points", size=7, color=INK, zorder=6, parse_math=False
            )
    return figure


def _millimetres(values: Sequence[float | None]) -> Array:
    return np.array([np.nan if v is None else 1000.0 * v for v in values], dtype=np.float64)
