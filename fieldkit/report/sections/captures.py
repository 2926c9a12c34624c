"""References and evaluations: their sections (figures, photographs, views and findings), and the summary."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator

from fieldkit.figures.content import (
    Block,
    Details,
    KeyFigure,
    KeyFigures,
    Paragraph,
    Section,
    Statement,
    Terms,
)
from fieldkit.figures.registry import FIGURES
from fieldkit.figures.style import format_length
from fieldkit.figures.tables import scores
from fieldkit.figures.tables.reconstruction import finding_table, photograph_table, quality_rows, stage_table
from fieldkit.report.sections.loaded import Loaded, Results
from fieldkit.report.sections.plots import plot_anchors
from fieldkit.report.sections.shown import Shown
from fieldkit.results.evaluation import (
    AdherenceEntry,
    EvaluationReport,
    PlotEvaluation,
    ReconstructionEntry,
    ReferenceReport,
)
from fieldkit.results.finding import DOUBTFUL
from fieldkit.results.traits import TraitsEntry
from fieldkit.wording import by_key, count, listed

_OPEN_ROWS = 14
"""Most rows of a table that is not folded."""
_MOST_NAMES = 20
"""Most photographs that a finding names."""
_TOO_LOW = re.compile("the pictures end|tips are missed")  # reasons of fieldkit/evaluation/traits.py
_WITH_ROOM = (
    "`fieldkit export-mission PLAN --vehicle VEHICLE --site site.toml --plant-height METRES --fit -o mission.plan`"
)


def reference_section(result: Loaded[ReferenceReport], anchor: str, shown: Shown) -> Section:
    """The photographs and the result of a reference."""
    report = result.report
    gsd, residuals = (format_length(each, metric=report.metric) for each in (report.gsd_m, report.pose_rms_m))
    blocks: list[Block] = [
        KeyFigures(
            (
                *_key_figures(report),
                KeyFigure("pixel on the plot", gsd, "ground sampling distance"),
                KeyFigure("position residuals, RMS", residuals, "how far cameras lie from where they were said to be"),
            )
        ),
        *shown.view_blocks(anchor),
        *_reconstruction_blocks(report),
    ]
    return Section(anchor, f"Reference: {report.source}", tuple(blocks))


def evaluation_section(result: Loaded[EvaluationReport], anchor: str, shown: Shown) -> Section:
    """The comparison of one plot's or many plots' captures with the reference."""
    plots = result.report.plots
    one = len(plots) == 1 and result.report.flight is None
    blocks = list(_plot_blocks(plots[0], anchor, shown) if one else _plots_blocks(plots, anchor, shown))
    return Section(anchor, f"Evaluation: {result.report.source}", tuple(blocks))


def _plots_blocks(plots: tuple[PlotEvaluation, ...], anchor: str, shown: Shown) -> Iterator[Block]:
    yield scores.quality_table("How well the plots were reconstructed", plots)
    yield from (table for table in (scores.unused_table(plots), scores.adherence_by_plot(plots)) if table.rows)
    viewed = sum(shown.has_view(anchor, plot.name) for plot in plots)
    if 0 < viewed < sum(plot.error is None for plot in plots):
        yield Paragraph(f"3D views: the {viewed} plots with the greatest distances.", faint=True)
    farthest = max((plot.chamfer_m or 0.0 for plot in plots), default=0.0)
    for name, plot in zip(plot_anchors(plots, anchor).values(), plots, strict=False):
        is_open = farthest > 0 and plot.chamfer_m == farthest
        blocks = tuple(_plot_blocks(plot, anchor, shown))
        yield Details(f"Details: {plot.name}", blocks, is_open, anchor=f"{name}-more")


def _plot_blocks(plot: PlotEvaluation, anchor: str, shown: Shown) -> Iterator[Block]:
    if plot.error is not None:
        yield Paragraph(f"No result: {plot.error.message}. {plot.error.remedy}")
        yield from _findings(plot)
        return
    photographs, points = _key_figures(plot)
    yield KeyFigures((photographs, *scores.score_figures(plot), points))
    yield from shown.view_blocks(anchor, plot.name)
    if plot.f_score is not None:
        yield scores.distance_table(plot)
    if plot.correction is not None:
        yield Paragraph(scores.correction_sentence(plot))
    if (found := plot.adherence) is not None:
        yield scores.station_table(found)
        if (missing := scores.gaps(found)) is not None:
            yield missing
    yield from _reconstruction_blocks(plot)


def _key_figures(report: ReconstructionEntry) -> tuple[KeyFigure, KeyFigure]:
    used = "placed by reconstruction, and where they are known to be"
    return (
        KeyFigure("photographs used", f"{report.right} of {report.images}", used),
        KeyFigure("points of plants", f"{report.points:,}"),
    )


def _reconstruction_blocks(report: ReconstructionEntry) -> Iterator[Block]:
    """The result of a reconstruction: photographs, figures, times, findings."""
    if report.image_reports:
        table = photograph_table(report.image_reports, "Photographs", metric=report.metric)
        many = len(table.rows) > _OPEN_ROWS
        yield Details(f"All {count(len(report.image_reports), 'photograph')}", (table,)) if many else table
    times = (stage_table(report),) if report.times else ()
    yield Details("How the reconstruction went", (Terms(quality_rows(report)), *times))
    yield from _findings(report)


def _findings(report: ReconstructionEntry) -> Iterator[Block]:
    if report.findings:
        findings = finding_table(report.findings, _MOST_NAMES)
        yield Details(count(len(report.findings), "finding"), (findings,))


def reference_statements(result: Loaded[ReferenceReport], _: Results) -> Iterator[Statement]:
    """The photographs of a reference, and its doubtful points."""
    report = result.report
    yield from _left_out(report, "The reference")
    yield from _doubts(report, f"The reference of “{report.source}”")


def evaluation_statements(result: Loaded[EvaluationReport], results: Results) -> Iterator[Statement]:
    """What speaks against the results of plots, and what their figures cannot say."""
    report = result.report
    plots = [plot for plot in report.plots if plot.error is None]
    again = f"`fieldkit evaluate {shlex.quote(report.source)} --reference REFERENCE -o {results.path(result)}{{}}`"
    for plot in plots:
        yield from _left_out(plot, plot.name, plot.unregistered)
        yield from _doubts(plot, plot.name)
    known = (FIGURES["chamfer_m"], FIGURES["predicted_chamfer_m"])
    unknown = [plot for plot in plots if all(figure.value(plot) is None for figure in known)]
    if unknown and report.reference_sha256 is None and report.flight is None:
        why = next((f": {p.reason.rstrip('.')}" for plot in unknown if (p := plot.prediction) and p.reason), "")
        yield Statement(
            "note",
            f"How near {listed([plot.name for plot in unknown], 8)} came to its plants is not known{why}.",
            f"Measure the distance: {again.format(' --overwrite')}",
        )
    failed = by_key(((e.message, e.remedy), plot.name) for plot in report.plots if (e := plot.error) is not None)
    for (why, remedy), names in failed.items():
        yield Statement("problem", f"No result of {listed(names, 8)}: {why}.", remedy)
    yield from without_height((plot.name, plot.traits) for plot in plots)
    for plot in plots:
        if plot.adherence is not None:
            yield from _adherence(plot.name, plot.adherence, report.source)


def without_height(plots: Iterable[tuple[str, TraitsEntry | None]]) -> Iterator[Statement]:
    """Plots whose plants' height cannot be had, by the reason that the table gives."""
    reasons = ((name, reason) for name, traits in plots if traits and (reason := traits.unknown.get("height_m")))
    for found in by_key((re.sub(r"\d+", "#", reason), (name, reason)) for name, reason in reasons).values():
        names, reason = listed([name for name, _ in found], 8), found[0][1]
        advice = f"Leave room above the plants next time: {_WITH_ROOM}" if _TOO_LOW.search(reason) else ""
        yield Statement("note", f"No height of {names}: {reason}.", advice)


def _left_out(report: ReconstructionEntry, name: str, reasons: dict[str, int] | None = None) -> Iterator[Statement]:
    missing = report.images - report.right
    if missing <= 0:
        return
    told = "" if not reasons else ": " + ", ".join(f"{number} {reason}" for reason, number in reasons.items())
    wrong = report.registered - report.right
    advice = "Take again what is blurred, looks elsewhere or overlaps too little: the table of photographs says which."
    if wrong >= missing:
        advice = "Check poses.csv or geotags: wrong poses come from those, or from plants that look alike."
    yield Statement(
        "problem" if missing > 0.2 * report.images else "note",
        f"{name}: {missing} of {count(report.images, 'photograph')} "
        f"{'was' if missing == 1 else 'were'} not used{told}.",
        advice,
    )


def _doubts(report: ReconstructionEntry, name: str) -> Iterator[Statement]:
    """With what a result must not be taken as it is."""
    for finding in report.findings:
        if finding.code in DOUBTFUL:  # its message ends in the remedy
            said, _, advice = finding.message.rpartition("; ")
            yield Statement(
                "problem", f"{name}: {said or advice}.", f"{advice[:1].upper()}{advice[1:]}." if said else ""
            )
    if not report.metric:
        yield Statement(
            "problem",
            f"{name}: nothing gave the reconstruction a scale, so its lengths are not metres.",
            "Put poses.csv, geo.txt or markers.toml beside the photographs, or take them with GPS.",
        )
    if len(report.models) > 1:
        yield Statement(
            "problem",
            f"{name}: the photographs fell apart into {len(report.models)} groups that share too little "
            f"({listed([str(size) for size in report.models])} photographs); only the largest was used.",
            "Take photographs between the groups, so that neighbours see the same leaves.",
        )


def _adherence(name: str, found: AdherenceEntry, source: str) -> Iterator[Statement]:
    if found.missing:
        yield Statement(
            "problem",
            f"{name}: no photograph at {listed(list(found.missing), 8)}.",
            f"Fly these stations again: `fieldkit check {shlex.quote(source)} --plan PLAN --site site.toml --vehicle "
            "VEHICLE -o again.plan`",
        )
    if found.extra:
        yield Statement("note", f"{name}: {count(len(found.extra), 'photograph')} of no station of the plan.")
