"""The front of patterns: minutes in the air against the expected distance."""

from __future__ import annotations

from collections.abc import Sequence

from fieldkit.pictures.panels import FAINT, INK, PAPER, png


def draw_front(title: str, points: Sequence[tuple[float, float, bool]]) -> bytes:
    """A PNG of patterns.

    Args:
        points: of each pattern the minutes, the distance in mm, and whether it is the plan.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.5), facecolor=PAPER)
    axes = figure.add_subplot(facecolor=PAPER, title=title, xlabel="minutes in the air", ylabel="expected distance, mm")
    axes.plot([x for x, _, _ in points], [y for _, y, _ in points], color=FAINT, marker="o")
    axes.plot(*next((x, y) for x, y, chosen in points if chosen), color=INK, marker="o", markersize=10)
    axes.set_ylim(bottom=0.0)
    return png(figure)
