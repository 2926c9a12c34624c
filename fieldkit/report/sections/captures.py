"""References and evaluations: their sections (figures, photographs, views and findings), and the summary."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from statistics import median

from fieldkit.figures.content import (
    MOST_ROWS,
    Block,
    Details,
    KeyFigure,
    KeyFigures,
    Paragraph,
    Picture,
    Section,
    Statement,
    Terms,
)
from fieldkit.figures.style import decimal, format_length, percent
from fieldkit.figures.tables import adherence, scores
from fieldkit.figures.tables.adherence import ACHIEVED_BY
from fieldkit.figures.tables.reconstruction import finding_table, photograph_table, quality_rows, stage_table
from fieldkit.report.sections.loaded import Loaded, Results
from fieldkit.report.sections.shown import Shown
from fieldkit.results.demo import DemoReport
from fieldkit.results.evaluation import (
    AdherenceEntry,
    EvaluationReport,
    PlotEvaluation,
    ReconstructionEntry,
    ReferenceReport,
)
from fieldkit.results.finding import DOUBTFUL, OTHER_PLANTS
from fieldkit.results.traits import TraitsEntry
from fieldkit.wording import count, listed

_OPEN_ROWS = 14
_MOST_NAMES = 20
_SHOWN_M = "0.010"
_NAMED = 5  # problems named one by one
_TOO_LOW = re.compile("the pictures end|tips are missed")  # reasons of fieldkit/evaluation/traits.py
_WITH_ROOM = (
    "`fieldkit export-mission PLAN --vehicle VEHICLE --site site.toml --plant-height METRES --fit -o mission.plan`"
)


def reference_section(result: Loaded[ReferenceReport], anchor: str, shown: Shown) -> Section:
    """The photographs and the result of a reference."""
    report = result.report
    gsd, residuals = (format_length(each, metric=report.metric) for each in (report.gsd_m, report.pose_rms_m))
    blocks: list[Block] = [
        KeyFigures((
            *_key_figures(report),
            KeyFigure("pixel on the plot", gsd, "ground sampling distance"),
            KeyFigure("position residuals, RMS", residuals, "how far cameras lie from where they were said to be"),
        )),
        *shown.view_blocks(anchor),
        *_reconstruction_blocks(report, shown.pictures(anchor)),
    ]  # fmt: skip
    return Section(anchor, f"Reference: {report.source}", tuple(blocks))


def evaluation_section(result: Loaded[EvaluationReport], anchor: str, shown: Shown) -> Section:
    """The comparison of one plot's or many plots' captures with the reference."""
    plots = result.report.plots
    blocks = list(_plot_blocks(plots[0], anchor, shown) if len(plots) == 1 else _plots_blocks(plots, anchor, shown))
    return Section(anchor, f"Evaluation: {result.report.source}", tuple(blocks))


def _plots_blocks(plots: tuple[PlotEvaluation, ...], anchor: str, shown: Shown) -> Iterator[Block]:
    yield scores.plot_table(plots)
    yield from (table for table in (scores.unused_table(plots), adherence.adherence_by_plot(plots)) if table.rows)
    viewed = sum(shown.has_view(anchor, plot.name) for plot in plots)
    if 0 < viewed < sum(plot.error is None for plot in plots):
        yield Paragraph(f"3D views: the {viewed} plots with the greatest distances.", faint=True)
    farthest = max((plot.chamfer_m or 0.0 for plot in plots), default=0.0)
    for plot in plots[:MOST_ROWS]:
        is_open = farthest > 0 and plot.chamfer_m == farthest
        yield Details(f"Details: {plot.name}", tuple(_plot_blocks(plot, anchor, shown)), is_open)


def _plot_blocks(plot: PlotEvaluation, anchor: str, shown: Shown) -> Iterator[Block]:
    if plot.error is not None:
        yield Paragraph(f"No result: {plot.error.message}. {plot.error.remedy}")
        return
    photographs, points = _key_figures(plot)
    yield KeyFigures((photographs, *scores.score_figures(plot), points))
    yield from shown.view_blocks(anchor, plot.name)
    if plot.f_score is not None:
        yield scores.distance_table(plot)
    if plot.correction is not None:
        yield Paragraph(scores.correction_sentence(plot))
    if (found := plot.adherence) is not None:
        yield adherence.station_table(found)
        if (missing := adherence.gaps(found)) is not None:
            yield missing
    yield from _reconstruction_blocks(plot, shown.pictures(anchor, plot.name))


def _key_figures(report: ReconstructionEntry) -> tuple[KeyFigure, KeyFigure]:
    used = "placed by reconstruction, and where they are known to be"
    return (
        KeyFigure("photographs used", f"{report.right} of {report.images}", used),
        KeyFigure("points of plants", f"{report.points:,}"),
    )


def _reconstruction_blocks(report: ReconstructionEntry, pictures: Mapping[str, Picture]) -> Iterator[Block]:
    """The result of a reconstruction: photographs, figures, times, findings."""
    if report.image_reports:
        table = photograph_table(report.image_reports, "Photographs", metric=report.metric, pictures=pictures)
        many = len(table.rows) > _OPEN_ROWS
        yield Details(f"All {count(len(report.image_reports), 'photograph')}", (table,)) if many else table
    times = (stage_table(report),) if report.times else ()
    yield Details("How the reconstruction went", (Terms(quality_rows(report)), *times))
    if report.findings:
        findings = finding_table(report.findings, _MOST_NAMES)
        yield Details(count(len(report.findings), "finding"), (findings,))


def reference_statements(result: Loaded[ReferenceReport], _: Results) -> Iterator[Statement]:
    """The photographs of a reference, and its doubtful points."""
    report = result.report
    yield Statement(
        "good" if report.right == report.images and report.metric and not report.doubts else "fact",
        f"The reference was reconstructed from {report.right} of {count(report.images, 'photograph')} of "
        f"“{report.source}”: {report.points:,} points of plants.",
    )
    yield from _left_out(report, "The reference")
    yield from _doubts(report, f"The reference of “{report.source}”")


def evaluation_statements(result: Loaded[EvaluationReport], results: Results) -> Iterator[Statement]:
    """The result of one plot, or of many plots together."""
    report = result.report
    plots = [plot for plot in report.plots if plot.error is None]
    again = f"`fieldkit evaluate {shlex.quote(report.source)} --reference REFERENCE -o {results.path(result)}{{}}`"
    if len(report.plots) == 1:
        for plot in plots:
            yield from _plot(plot, again, scored=report.reference_sha256 is not None)
    elif plots:
        # The demo's plots are methods: their range says nothing, and its own table compares them.
        yield from _plots(report, plots, spread=not results.of(DemoReport))
    failed = [plot for plot in report.plots if plot.error is not None]
    for plot in failed[:_NAMED]:
        assert plot.error is not None
        yield Statement("problem", f"{plot.name} has no result: {plot.error.message}.", plot.error.remedy)
    if len(failed) > _NAMED:
        yield Statement(
            "problem",
            f"{result.name}: {count(len(failed) - _NAMED, 'more plot has', 'more plots have')} no result; the table "
            "says why.",
        )
    yield from without_height(((plot.name, plot.traits) for plot in plots), _WITH_ROOM)
    for plot in plots:
        if plot.adherence is not None:
            yield from _adherence(plot.name, plot.adherence, report.source)


def _plot(plot: PlotEvaluation, again: str, *, scored: bool) -> Iterator[Statement]:
    yield Statement(
        "good" if plot.right == plot.images and not plot.doubts else "fact",
        f"{plot.name}: {plot.right} of {count(plot.images, 'photograph')} registered and used, "
        f"{plot.points:,} points of plants.",
    )
    yield from _left_out(plot, plot.name, plot.unregistered)
    if plot.chamfer_m is None or plot.accuracy_m is None or plot.completeness_m is None:
        if not scored:
            yield _unscored(plot, f"Measure the distance: {again.format(' --overwrite')}")
    elif OTHER_PLANTS not in plot.doubts:
        yield from _distances(plot, plot.chamfer_m, plot.accuracy_m, plot.completeness_m, again)
    yield from _doubts(plot, plot.name)


def _unscored(plot: PlotEvaluation, advice: str) -> Statement:
    """What is known about the distance of a plot without a reference."""
    text = f"{plot.name} was not compared with a reference"
    found = plot.prediction
    if found is None or found.chamfer_m is None:
        why = f": {found.reason.rstrip('.')}" if found is not None and found.reason else ""
        return Statement("note", f"{text}, so how near it comes to its plants is not known{why}.", advice)
    return Statement(
        "fact",
        f"{text}. By figures that need none it is likely to be {format_length(found.chamfer_m)} from its true plants "
        f"(chamfer distance); nine in ten such plots lie between {format_length(found.low_m)} and "
        f"{format_length(found.high_m)}.",
        advice,
    )


def _distances(
    plot: PlotEvaluation, chamfer: float, accuracy: float, completeness: float, again: str
) -> Iterator[Statement]:
    text = (
        f"{plot.name}: on average its points lie {format_length(accuracy)} from the reference (accuracy), and the "
        f"reference's points {format_length(completeness)} from what was reconstructed (completeness). Together that "
        f"is {format_length(chamfer)} (chamfer distance)."
    )
    if plot.precision and plot.recall and _SHOWN_M in plot.precision and _SHOWN_M in plot.recall:
        text += (
            f" {percent(plot.precision[_SHOWN_M], 0)} % of its points are within 10 mm of the reference, and "
            f"{percent(plot.recall[_SHOWN_M], 0)} % of the reference's points are within 10 mm of it."
        )
    yield Statement("fact", text)
    # The frame is fitted to all positions at once, so their errors average out.
    shift = None if plot.pose_rms_m is None or not plot.right else plot.pose_rms_m / plot.right**0.5
    if plot.correction is None and shift is not None and shift > 0.25 * chamfer:
        yield Statement(
            "note",
            f"{plot.name}: the known camera positions are {format_length(plot.pose_rms_m)} (RMS) off the reconstructed "
            f"ones, which can displace the whole cloud by about {format_length(shift)}. That counts in the distance "
            "above.",
            f"See how much of it is displacement: {again.format(' --refine --overwrite')}",
        )
    if plot.gsd_m is not None and plot.metric and 2 * plot.gsd_m > accuracy:
        yield Statement(
            "note",
            f"{plot.name}: a pixel covers {format_length(plot.gsd_m)}, so details below "
            f"{format_length(2 * plot.gsd_m)} are not in its cloud.",
            "Photograph from nearer, or with a camera of more pixels, where finer detail matters.",
        )


def _plots(report: EvaluationReport, plots: Sequence[PlotEvaluation], *, spread: bool) -> Iterator[Statement]:
    images, right = sum(plot.images for plot in plots), sum(plot.right for plot in plots)
    yield Statement(
        "good" if right == images and len(plots) == len(report.plots) and not any(p.doubts for p in plots) else "fact",
        f"{len(plots)} of {count(len(report.plots), 'plot')} of “{report.source}” were reconstructed; "
        f"{right} of {count(images, 'photograph')} were used.",
    )
    short = [plot for plot in plots if plot.right < plot.images]
    if short:
        yield Statement(
            "note",
            f"Photographs were left out in {listed([f'{plot.name} ({plot.images - plot.right})' for plot in short])}.",
            "The plots' tables say why; fly those stations again where plants are missing in the cloud.",
        )
    for plot in plots:
        yield from _findings(plot, plot.name)
    same = [plot for plot in plots if OTHER_PLANTS not in plot.doubts]
    chamfers = sorted((plot.chamfer_m, plot.name) for plot in same if plot.chamfer_m is not None)
    if chamfers and spread:
        middle = median(value for value, _ in chamfers)
        yield Statement(
            "fact",
            f"Distance to the reference (chamfer): {format_length(middle)} in the middle (median), from "
            f"{format_length(chamfers[0][0])} ({chamfers[0][1]}) to {format_length(chamfers[-1][0])} "
            f"({chamfers[-1][1]}).",
        )


def without_height(plots: Iterable[tuple[str, TraitsEntry | None]], plan: str) -> Iterator[Statement]:
    """Plots whose plants' height cannot be had, by the reason that the table gives.

    Args:
        plan: the command that plans with room above the plants.
    """
    alike: dict[str, list[tuple[str, str]]] = {}
    for name, traits in plots:
        if traits is not None and (reason := traits.unknown.get("height_m")):
            alike.setdefault(re.sub(r"\d+", "#", reason), []).append((name, reason))
    for found in alike.values():
        names, reason = listed([name for name, _ in found], 8), found[0][1]
        advice = f"Leave room above the plants next time: {plan}" if _TOO_LOW.search(reason) else ""
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
    yield Statement("problem" if missing > 0.2 * report.images else "note",
                    f"{name}: {missing} of {count(report.images, 'photograph')} "
                    f"{'was' if missing == 1 else 'were'} not used{told}.", advice)  # fmt: skip


def _findings(report: ReconstructionEntry, name: str) -> Iterator[Statement]:
    """Findings with which a result must not be taken as it is; their messages end in the remedy."""
    for finding in report.findings:
        if finding.code in DOUBTFUL:
            said, _, advice = finding.message.rpartition("; ")
            yield Statement(
                "problem", f"{name}: {said or advice}.", f"{advice[:1].upper()}{advice[1:]}." if said else ""
            )


def _doubts(report: ReconstructionEntry, name: str) -> Iterator[Statement]:
    yield from _findings(report, name)
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
    if report.reprojection_px is not None and report.reprojection_px > 1.0:
        yield Statement(
            "note",
            f"{name}: the reprojection error is {decimal(report.reprojection_px)} px; below 1 px is good.",
            "Check the camera file, and photographs for blur and moving leaves.",
        )


def _adherence(name: str, found: AdherenceEntry, source: str) -> Iterator[Statement]:
    taken = len(found.stations)
    total = taken + len(found.missing)
    parts = [
        f"{format_length(found.horizontal_rms_m)} over ground" if found.horizontal_rms_m is not None else "",
        f"{decimal(found.yaw_rms_deg, 1)}° in heading" if found.yaw_rms_deg is not None else "",
        f"{decimal(found.pitch_rms_deg, 1)}° in pitch" if found.pitch_rms_deg is not None else "",
    ]
    kept = listed([part for part in parts if part])
    yield Statement(
        "good" if not found.missing else "fact",
        f"{name}: {taken} of {count(total, 'planned station')} were photographed"
        + (f"; the flight was off by {kept} (RMS, by {ACHIEVED_BY[found.achieved_by]})." if kept else "."),
    )
    if found.missing:
        yield Statement(
            "problem",
            f"{name}: no photograph at {listed(list(found.missing), 8)}.",
            f"Fly these stations again: `fieldkit check {shlex.quote(source)} --plan PLAN --site site.toml --vehicle "
            "VEHICLE -o again.plan`",
        )
    if found.extra:
        yield Statement("note", f"{name}: {count(len(found.extra), 'photograph')} of no station of the plan.")
