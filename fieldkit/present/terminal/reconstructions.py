"""Tables for the terminal: how a reconstruction went, and how plots scored."""

from __future__ import annotations

from collections.abc import Iterator

from rich.markup import escape
from rich.table import Table

from fieldkit.present.style import format_count, format_length, format_number, format_seconds, table
from fieldkit.results.evaluation import (
    EvaluationReport,
    FindingEntry,
    PlantEntry,
    PlotEvaluation,
    PredictionEntry,
    ReconstructionEntry,
    ReferenceReport,
)

_MOST_ROWS = 20
_MOST_NAMES = 3


def quality_tables(report: ReferenceReport | PlotEvaluation) -> Iterator[Table]:
    """What a person should look at after a reconstruction: figures, images that do not count, stages, findings."""
    name = report.source if isinstance(report, ReferenceReport) else report.name
    rows = table(escape(name), "", "")
    rows.show_header = False
    for label, value in quality_rows(report):
        rows.add_row(label, escape(value))
    yield rows
    bad = [image for image in report.image_reports if not image.registered or image.right is False]
    if bad:
        images = table("Photographs that do not count", "photograph", "features>", "why")
        for image in bad[:_MOST_ROWS]:
            images.add_row(escape(image.name), format_count(image.features), escape(image.reason))
        _and_more(images, len(bad))
        yield images
    if report.times:
        stages = table("Time per stage", "stage", "items>", "from cache>", "wall>", "CPU>")
        for stage in report.times:
            stages.add_row(
                escape(stage.name), format_count(stage.items), format_count(stage.cached),
                format_seconds(stage.wall_s), format_seconds(stage.cpu_s),
            )  # fmt: skip
        stages.add_row("[bold]all[/]", "", "", format_seconds(report.seconds), format_seconds(report.cpu_seconds))
        yield stages
    if report.findings:
        yield _findings(report.findings)


def evaluation_tables(report: EvaluationReport) -> Iterator[Table]:
    """One row per plot, then what failed and why images do not count; a single plot's quality tables in full."""
    plots = [plot for plot in report.plots if plot.error is None]
    if len(report.plots) == 1:
        yield from quality_tables(report.plots[0])
    elif plots:
        yield _scores(report, plots) if report.reference_sha256 else _reference_free(plots)
        if any(plot.plants is not None or plot.prediction is not None for plot in plots):
            yield _plant_figures(plots)
        yield from _unpredicted(plots)
    reasons = [(plot.name, reason, count) for plot in plots for reason, count in plot.unregistered.items()]
    if reasons and len(report.plots) > 1:
        rows = table("Photographs that do not count", "plot", "why", "photographs>")
        for name, reason, count in reasons[:_MOST_ROWS]:
            rows.add_row(escape(name), escape(reason), format_count(count))
        _and_more(rows, len(reasons))
        yield rows
    if report.failed:
        rows = table("Failed", "plot", "why")
        for plot in report.plots:
            if plot.error is not None:
                remedy = f"\n→ {plot.error.remedy}" if plot.error.remedy else ""
                rows.add_row(escape(plot.name), escape(plot.error.message + remedy))
        yield rows


def quality_rows(report: ReconstructionEntry) -> list[tuple[str, str]]:
    """The main figures of a reconstruction as label and value; for the terminal and for the overview picture."""
    wrong = sum(image.registered and image.right is False for image in report.image_reports)
    known = any(image.right is not None for image in report.image_reports)
    pairs = f"{format_count(report.pairs_verified)} of {format_count(report.pairs_tried)}"
    tracks = f"{format_count(report.observations)} observations, track length {format_number(report.track_length)}"
    rows = [
        ("photographs", f"{report.images}"),
        ("registered", f"{report.registered} of {report.images}{_percent(report.registered, report.images)}"),
        ("right", f"{report.right}" if known else "not known: no positions to compare with"),
        ("registered but wrong", f"{wrong}" if known else "not known"),
        ("models", f"{len(report.models)} ({', '.join(str(size) for size in report.models) or 'no images'})"),
        ("mapping", f"{report.method or '–'}, {pairs} pairs verified"),
        ("features per image", format_number(report.features_per_image, 0)),
        ("sparse points", f"{format_count(report.sparse_points)}, {tracks}"),
        ("reprojection error", f"{format_number(report.reprojection_px)} px"),
        ("metric source", _metric(report)),
    ]
    rows += [("camera", camera) for camera in _cameras(report)]
    if report.frame is not None:
        ground = report.frame.ground
        tilt = "none found" if ground is None else f"{format_length(ground.rms_m, metric=report.metric)} RMS"
        rows.append(("ground plane", tilt))
    rows.append(("ground sampling", f"{format_length(report.gsd_m, metric=report.metric)} per pixel"))
    if report.volume is not None:
        edges = (high - low for low, high in zip(report.volume.lower_m, report.volume.upper_m, strict=True))
        unit = "m" if report.metric else "units"
        rows.append(("volume of interest", " × ".join(f"{edge:.2f}" for edge in edges) + f" {unit}"))
    rows.append(("plants", _plants(report)))
    if isinstance(report, ReferenceReport) and report.scene_points is not None:
        rows.append(("scene", f"{format_count(report.scene_points)} points"))
    if report.dense is not None:
        rows.append(("dense stereo", f"{report.dense.fidelity} on {report.dense.backend}, mask {report.dense.mask}"))
    if isinstance(report, PlotEvaluation):
        rows += _plant_rows(report.plants) + _score_rows(report) + _prediction_rows(report.prediction)
    return rows


def _metric(report: ReconstructionEntry) -> str:
    if not report.metric:
        return "none: lengths are not metres"
    if report.pose_rms_m is None:
        return f"{report.metric_source}"
    bound = f", right up to {format_length(report.position_bound_m)}" if report.position_bound_m is not None else ""
    return f"{report.metric_source}, residuals {format_length(report.pose_rms_m)} RMS{bound}"


def _cameras(report: ReconstructionEntry) -> list[str]:
    found = [
        f"{camera.model} {camera.width}×{camera.height}, f {camera.params[0]:.1f} px, {camera.source}"
        + (f" ({camera.photos} photographs)" if len(report.cameras) > 1 else "")
        for camera in report.cameras
    ]
    return found if len(found) <= 4 else [*found[:3], f"and {len(found) - 3} more"]


def _plants(report: ReconstructionEntry) -> str:
    text = f"{format_count(report.points)} points"
    if report.points_per_plant_voxel is None:
        return text
    return f"{text}, {report.points_per_plant_voxel:.1f} per {format_length(report.plant_voxel_m)} voxel"


def _plant_rows(plants: PlantEntry | None) -> list[tuple[str, str]]:
    if plants is None:
        return []
    rows = []
    if plants.height_m is not None:
        height = f"{format_length(plants.height_m)} (95 %), highest {format_length(plants.height_max_m)}"
        rows.append(("plant height", height))
    covered = f"{100 * plants.cover:.0f} % of {plants.area_m2:.2f} m²: {plants.covered_m2:.3f} m²"
    rows.append(("ground cover", f"{covered} (cells of {format_length(plants.cell_m)})"))
    rows.append(("plants' hull", f"{plants.hull_m3:.3f} m³"))
    return rows


def _prediction_rows(prediction: PredictionEntry | None) -> list[tuple[str, str]]:
    if prediction is None:
        return []
    if prediction.chamfer_m is None:
        return [("predicted chamfer", f"none: {prediction.reason}")]
    between = f"{format_length(prediction.low_m)} to {format_length(prediction.high_m)}"
    return [("predicted chamfer", f"{format_length(prediction.chamfer_m)}; nine in ten plots {between}")]


def _score_rows(plot: PlotEvaluation) -> list[tuple[str, str]]:
    if plot.chamfer_m is None or plot.f_score is None:
        return []
    terms = f"accuracy {format_length(plot.accuracy_m)} + completeness {format_length(plot.completeness_m)}"
    rows = [("chamfer distance", f"{format_length(plot.chamfer_m)} = {terms}")]
    for distance, f_score in plot.f_score.items():
        assert plot.precision is not None
        assert plot.recall is not None
        parts = f"precision {plot.precision[distance]:.3f}, recall {plot.recall[distance]:.3f}"
        rows.append((f"F-score at {1000 * float(distance):g} mm", f"{f_score:.3f} ({parts})"))
    if plot.correction is not None:
        shift = sum(value**2 for value in plot.correction.translation_m) ** 0.5
        change = f"{format_length(shift)}, {plot.correction.angle_deg:.2f}°, scale {plot.correction.scale:.4f}"
        rows.append(("moved by ICP", f"{change}; then {format_length(plot.correction.rms_m)} RMS"))
    return rows


def _scores(report: EvaluationReport, plots: list[PlotEvaluation]) -> Table:
    rows = _narrow(
        "Scores against the reference; lengths in mm", "plot", "right>", "pose>", "chamfer>", "accuracy>", "complete>",
        *(f"F{1000 * distance:g}>" for distance in report.distances_m),
    )  # fmt: skip
    for plot in plots:
        f_scores = (plot.f_score or {}).values()
        rows.add_row(
            escape(plot.name),
            f"{plot.right}/{plot.images}",
            *(_millimetres(v) for v in (plot.pose_rms_m, plot.chamfer_m, plot.accuracy_m, plot.completeness_m)),
            *(f"{value:.3f}" for value in f_scores),
            *("–" for _ in report.distances_m if not f_scores),
        )
    return rows


def _reference_free(plots: list[PlotEvaluation]) -> Table:
    rows = _narrow(
        "Figures without a reference", "plot", "registered>", "right>", "models>", "error px>", "track>", "points>",
        "/voxel>", "mm/px>",
    )  # fmt: skip
    for plot in plots:
        rows.add_row(
            escape(plot.name),
            f"{plot.registered}/{plot.images}",
            f"{plot.right}",
            f"{len(plot.models)}",
            format_number(plot.reprojection_px),
            format_number(plot.track_length),
            format_count(plot.points),
            format_number(plot.points_per_plant_voxel, 1),
            _millimetres(plot.gsd_m if plot.metric else None),
        )
    return rows


def _plant_figures(plots: list[PlotEvaluation]) -> Table:
    rows = _narrow(
        "Plants; predicted chamfer distance in mm", "plot", "height m>", "cover %>", "hull m³>", "predicted>",
        "nine in ten>",
    )  # fmt: skip
    for plot in plots:
        plants, prediction = plot.plants, plot.prediction
        cells = ["–"] * 3
        if plants is not None:
            cells = [format_number(plants.height_m), f"{100 * plants.cover:.0f}", format_number(plants.hull_m3, 3)]
        predicted = ["–", "–"]
        if prediction is not None and prediction.chamfer_m is not None:
            interval = f"{_millimetres(prediction.low_m)}–{_millimetres(prediction.high_m)}"
            predicted = [_millimetres(prediction.chamfer_m), interval]
        rows.add_row(escape(plot.name), *cells, *predicted)
    return rows


def _unpredicted(plots: list[PlotEvaluation]) -> Iterator[Table]:
    found = [(plot.name, p.reason) for plot in plots if (p := plot.prediction) is not None and p.chamfer_m is None]
    if found:
        rows = table("No prediction", "plot", "why")
        for name, reason in found[:_MOST_ROWS]:
            rows.add_row(escape(name), escape(reason))
        _and_more(rows, len(found))
        yield rows


def _narrow(title: str, *columns: str) -> Table:
    """A table of figures that fits 80 columns; only its first column is wrapped."""
    rows = table(title, *columns)
    rows.collapse_padding, rows.pad_edge = True, False
    for column in rows.columns[1:]:
        column.no_wrap = True
    return rows


def _millimetres(length_m: float | None) -> str:
    return "–" if length_m is None else f"{1000 * length_m:.2f}" if length_m < 0.00995 else f"{1000 * length_m:.1f}"


def _findings(findings: tuple[FindingEntry, ...]) -> Table:
    """One row per finding; files with the same one share it."""
    groups: dict[tuple[str, str, bool], list[str]] = {}
    for finding in findings:
        groups.setdefault((finding.code, finding.message, finding.left_out), []).append(finding.name)
    rows = table("Findings", "files>", "finding", "")
    for (code, message, left_out), names in list(groups.items())[:_MOST_ROWS]:
        listed = ", ".join(names[:_MOST_NAMES]) + (f" and {len(names) - _MOST_NAMES} more" * (len(names) > _MOST_NAMES))
        text = f"{listed}: {'left out: ' if left_out else ''}{message}"
        rows.add_row(format_count(len(names)), escape(code), escape(text))
    _and_more(rows, len(groups))
    return rows


def _and_more(rows: Table, count: int) -> None:
    if count > _MOST_ROWS:
        rows.add_row(f"and {count - _MOST_ROWS} more", *[""] * (len(rows.columns) - 1))


def _percent(part: int, whole: int) -> str:
    return f" ({100 * part / whole:.0f} %)" if whole else ""
