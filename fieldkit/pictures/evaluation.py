"""The picture of an evaluation: distances of a plot's cloud to its reference, and of the reference to the cloud."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fieldkit.clouds import Cloud, PointIndex, ReferenceIndex, Volume
from fieldkit.figures.style import DISTANCE_RAMP, format_length, format_nominal
from fieldkit.pictures.overview import draw_plants, save_figure
from fieldkit.pictures.panels import FAINT, INK, display_limits, drawable, new_figure
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.wording import count

_WIDTH, _HEIGHT = 15.0, 11.7
_AT_A_TIME = 1_000_000
_ROWS = ((6.45, 3.95), (1.35, 3.95))
_COLORS = LinearSegmentedColormap.from_list("distance", DISTANCE_RAMP)


def write_comparison(path: Path, plot: PlotEvaluation, estimate: Cloud, reference: Cloud | ReferenceIndex) -> None:
    """Write the picture of an evaluation (PNG).

    Raises:
        StorageError: the place is full or not writable.
    """
    save_figure(path, draw_comparison(plot, estimate, reference))


def draw_comparison(plot: PlotEvaluation, estimate: Cloud, reference: Cloud | ReferenceIndex) -> Figure:
    """The plot's cloud coloured by its distance to the reference, and the reference by its distance to the cloud.

    Args:
        plot: the scored plot.
        estimate: its cloud, with any correction applied; (m, 3) metres.
        reference: (n, 3) metres in the same frame; a `ReferenceIndex` saves the work of indexing it again.

    Raises:
        ValueError: the plot has no score, or a cloud has no points.
    """
    if plot.f_score is None or plot.volume is None:
        raise ValueError("a plot without a score has nothing to compare")
    volume = Volume(plot.volume.lower_m, plot.volume.upper_m)
    limit = max(float(distance) for distance in plot.f_score)
    kept = reference if isinstance(reference, ReferenceIndex) else ReferenceIndex(reference)
    own, known = PointIndex(estimate.points), kept.cloud.points
    limits = display_limits(estimate.points, volume, known)
    # Millions of distances take much memory, their colours little.
    by_reference = _colored(own.unsorted(kept.index.distances_from(own)), limit)
    by_estimate = _colored(kept.index.unsorted(own.distances_from(kept.index)), limit)
    figure = new_figure(_WIDTH, _HEIGHT, f"{plot.name}: distance to the reference")
    accuracy, completeness = format_length(plot.accuracy_m), format_length(plot.completeness_m)
    ours = f"Accuracy {accuracy}: the plot's {len(estimate):,} points by distance to the reference"
    theirs = f"Completeness {completeness}: the reference's {len(reference):,} points by distance to it"
    rows = ((estimate.points, by_reference, ours), (known, by_estimate, theirs))
    # Both rows show the same part of the plot at the same scale.
    for row, (points, colors, title) in zip(_ROWS, rows, strict=True):
        draw_plants(figure, Cloud(points, colors), volume, None, "m", row, limits=limits)
        y = (row[0] + row[1] + 0.42) / _HEIGHT
        figure.text(0.03, y, title, size=10, color=INK, va="center", weight="bold", parse_math=False)
    _legend(figure, plot, limit)
    return figure


def _colored(distances: NDArray[np.float64], limit: float) -> NDArray[np.uint8]:
    table = np.round(255 * _COLORS(np.arange(_COLORS.N))[:, :3]).astype(np.uint8)
    colors = np.empty((len(distances), 3), dtype=np.uint8)
    for start in range(0, len(distances), _AT_A_TIME):
        some = slice(start, start + _AT_A_TIME)
        colors[some] = table[np.minimum(distances[some] / limit * _COLORS.N, _COLORS.N - 1).astype(np.intp)]
    return colors


def _legend(figure: Figure, plot: PlotEvaluation, limit: float) -> None:
    from matplotlib.cm import ScalarMappable

    axes = figure.add_axes((0.03, 0.052, 0.3, 0.014))
    bar = figure.colorbar(ScalarMappable(Normalize(0, 1000 * limit), _COLORS), cax=axes, orientation="horizontal")
    assert plot.f_score is not None
    bar.set_ticks([0.0, *(1000 * float(distance) for distance in plot.f_score)])
    bar.outline.set_visible(False)
    axes.tick_params(labelsize=8, colors=INK, length=2)
    axes.set_title(f"distance in mm, {1000 * limit:g} and more", size=8, color=FAINT, loc="left", pad=3)
    assert plot.precision is not None
    assert plot.recall is not None
    columns = [("within", "precision", "recall", "F-score")]
    columns += [
        (format_nominal(float(d)), f"{plot.precision[d]:.3f}", f"{plot.recall[d]:.3f}", f"{plot.f_score[d]:.3f}")
        for d in plot.f_score
    ]
    for index, column in enumerate(columns):
        for line, text in enumerate(column):
            figure.text(
                0.40 + 0.058 * index, (0.86 - 0.19 * line) / _HEIGHT, text, size=8.5,
                color=FAINT if index == 0 or line == 0 else INK, va="center", parse_math=False,
            )  # fmt: skip
    summary = [
        f"chamfer distance {format_length(plot.chamfer_m)}",
        f"{plot.right} of {count(plot.images, 'photograph')} registered right",
        "no correction by ICP" if plot.correction is None else f"moved by ICP, {plot.correction.angle_deg:.2f}°",
    ]
    for line, text in enumerate(summary):
        y = (0.86 - 0.19 * line) / _HEIGHT
        figure.text(0.76, y, drawable(text), size=8.5, color=INK, va="center", parse_math=False)
