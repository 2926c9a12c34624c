"""The section of a reference."""

from __future__ import annotations

from fieldkit.figures.content import Block, KeyFigure, KeyFigures, Section, View
from fieldkit.figures.style import format_length
from fieldkit.report.sections.loaded_results import ReferenceResult
from fieldkit.report.sections.reconstruction import (
    Pictures,
    photographs_figure,
    points_figure,
    reconstruction_blocks,
    view_blocks,
)

_RESIDUALS = "how far cameras lie from where they were said to be"


def reference_section(
    result: ReferenceResult, anchor: str, view: View | None, note: str, pictures: Pictures
) -> Section:  # fmt: skip
    """The photographs and the result of a reference."""
    report = result.report
    metric = report.metric
    blocks: list[Block] = [
        KeyFigures((
            photographs_figure(report),
            points_figure(report),
            KeyFigure("pixel on the plot", format_length(report.gsd_m, metric=metric), "ground sampling distance"),
            KeyFigure("position residuals, RMS", format_length(report.pose_rms_m, metric=metric), _RESIDUALS),
        )),
        *view_blocks(view, note),
        *reconstruction_blocks(report, pictures),
    ]  # fmt: skip
    return Section(anchor, f"Reference: {report.source}", tuple(blocks))
