"""The figures of a plot that evaluations are compared by. Pure functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from fieldkit.results.doubtful import OTHER_PLANTS
from fieldkit.results.evaluation import PlotEvaluation, distance_key
from fieldkit.results.traits import TRAITS

PREDICTED = "predicted_chamfer_m"
DISTANCES = ("chamfer_m", "accuracy_m", "completeness_m")
"""Against the reference."""
_REFERENCE_FREE = (
    "right_share", "pose_rms_m", "reprojection_px", "track_length", "points", "points_per_plant_voxel", "gsd_m",
)  # fmt: skip
_LARGEST = 1e12


def figure_names(distances_m: Sequence[float], *, scored: bool) -> list[str]:
    """Figures in the order of tables.

    Args:
        distances_m: that all evaluations have F-scores at.
        scored: whether all were scored against one reference.
    """
    against = [*DISTANCES, *(f"f_score_{distance_key(d)}" for d in distances_m)] if scored else [PREDICTED]
    return [*against, *TRAITS, *_REFERENCE_FREE]


def figure_value(plot: PlotEvaluation, figure: str) -> float | None:
    """A figure of a plot; None where it has none, for numbers that no plot has, and for distances to other plants."""
    to_others = OTHER_PLANTS in plot.doubts and (figure in DISTANCES or figure.startswith("f_score_"))
    value = None if plot.error is not None or to_others else _value(plot, figure)
    return None if value is None or abs(value) > _LARGEST else float(value)


def _value(plot: PlotEvaluation, figure: str) -> float | None:
    if figure.startswith("f_score_"):
        return None if plot.f_score is None else plot.f_score.get(figure.removeprefix("f_score_"))
    if figure == "right_share":
        return plot.right / plot.images if plot.images else None
    if figure == PREDICTED:
        return None if plot.prediction is None else plot.prediction.chamfer_m
    if figure in TRAITS:
        return None if plot.traits is None else cast("float | None", getattr(plot.traits, figure))
    # Without a scale lengths are in units of their own, which no two models share.
    known = plot.metric or not figure.endswith("_m")
    return cast("float | None", getattr(plot, figure)) if known else None
