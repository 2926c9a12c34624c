"""Blocks that references and evaluated plots have in common: figures of a reconstruction, its photographs, findings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fieldkit.present.content import Block, Column, Details, Mark, Picture, Table, Terms
from fieldkit.present.html.text import count, decimal, length, metres, millimetres
from fieldkit.present.style import format_seconds
from fieldkit.results.evaluation import ImageEntry, ReconstructionEntry

_OPEN_ROWS = 14
MOST_ROWS = 400
"""Of a table about photographs, stations or findings; the files hold all."""


def reconstruction_blocks(report: ReconstructionEntry, pictures: Mapping[str, Picture]) -> Iterator[Block]:
    """How a reconstruction went: photographs, quality, cameras, findings, times."""
    photographs = photograph_table(report, pictures)
    if photographs is not None:
        if len(photographs.rows) <= _OPEN_ROWS:
            yield photographs
        else:
            yield Details(f"All {count(len(report.image_reports), 'photograph')}", (photographs,))
    yield Details("How the reconstruction went", tuple(_quality(report)))
    if report.findings:
        rows = tuple((f.name, f.message, "not used" if f.left_out else "used") for f in report.findings[:MOST_ROWS])
        columns = (Column("file"), Column("what was found"), Column("the file was"))
        note = f"The first {MOST_ROWS} of {len(report.findings)}." if len(report.findings) > MOST_ROWS else ""
        yield Details(f"{count(len(report.findings), 'finding')}", (Table("Findings", columns, rows, note),))


def photograph_table(report: ReconstructionEntry, pictures: Mapping[str, Picture]) -> Table | None:
    """What became of every photograph; those that were not used come first. None without photographs."""
    if not report.image_reports:
        return None
    known = any(image.position_residual_m is not None for image in report.image_reports)
    angles = any(image.angle_residual_deg is not None for image in report.image_reports)
    why = any(image.reason for image in report.image_reports)
    columns = [Column("photograph")]
    columns += [Column("picture")] if pictures else []
    columns += [
        Column("state"),
        Column("features", True),
        Column("points seen", True),
        Column("reprojection, px", True),
    ]
    columns += [Column("position residual, mm" if report.metric else "position residual", True)] if known else []
    columns += [Column("direction residual, °", True)] if angles else []
    columns += [Column("height, m" if report.metric else "height", True), Column("pitch, °", True)]
    columns += [Column("why")] if why else []
    ordered = sorted(report.image_reports, key=lambda image: image.registered and image.right is not False)
    rows = []
    for image in ordered[:MOST_ROWS]:
        row: list[str | Picture | Mark | None] = [image.name]
        row += [pictures.get(image.name)] if pictures else []
        row += [state(image), f"{image.features:,}", f"{image.observations:,}", decimal(image.reprojection_px)]
        residual = image.position_residual_m
        row += [millimetres(residual) if report.metric else decimal(residual, 4)] if known else []
        row += [decimal(image.angle_residual_deg)] if angles else []
        row += [None if image.center_m is None else metres(image.center_m[2]), decimal(image.pitch_deg, 1)]
        row += [image.reason or None] if why else []
        rows.append(tuple(row))
    note = f"The first {MOST_ROWS} of {len(ordered)}." if len(ordered) > MOST_ROWS else ""
    return Table("Photographs", tuple(columns), tuple(rows), note)


def state(image: ImageEntry) -> Mark:
    """Whether a photograph was used."""
    if not image.registered:
        return Mark("problem", "not registered")
    return Mark("problem", "wrong pose") if image.right is False else Mark("good", "used")


def _quality(report: ReconstructionEntry) -> Iterator[Block]:
    metric = report.metric
    rows = [
        ("photographs registered", f"{report.registered} of {report.images}"),
        ("photographs used", f"{report.right}"),
        ("models", f"{len(report.models)} ({', '.join(str(size) for size in report.models) or 'none'} photographs)"),
        ("mapping", report.method or "–"),
        ("scale and place from", (report.metric_source or "–") if metric else "nothing: lengths are not metres"),
        ("position residuals, RMS", length(report.pose_rms_m, metric=metric)),
        ("reprojection error", _with_unit(decimal(report.reprojection_px), "px")),
        ("track length", decimal(report.track_length, 1) or "–"),
        ("features per photograph", decimal(report.features_per_image, 0) or "–"),
        ("pairs of photographs with matches", f"{report.pairs_verified:,} of {report.pairs_tried:,}"),
        ("sparse points", f"{report.sparse_points:,}"),
        ("points of the plants' cloud", f"{report.points:,}"),
        ("ground sampling distance", length(report.gsd_m, metric=metric) + " per pixel"),
    ]
    if report.volume is not None:
        edges = (high - low for low, high in zip(report.volume.lower_m, report.volume.upper_m, strict=True))
        rows.append(("volume of interest", " × ".join(f"{edge:.2f}" for edge in edges) + (" m" if metric else "")))
    if report.dense is not None:
        rows.append(
            ("dense stereo", f"{report.dense.fidelity}, on {report.dense.backend}, plants by {report.dense.mask}")
        )
    if report.frame is not None:
        rows += [("doubt about the frame", note) for note in report.frame.notes]
    yield Terms(tuple(rows))
    if report.cameras:
        columns = (
            Column("camera"),
            Column("model"),
            Column("size, px", True),
            Column("from"),
            Column("photographs", True),
        )
        cameras = tuple((c.key, c.model, f"{c.width} × {c.height}", c.source, f"{c.photos}") for c in report.cameras)
        yield Table("Cameras", columns, cameras)
    if report.times:
        columns = (
            Column("stage"),
            Column("items", True),
            Column("from cache", True),
            Column("time", True),
            Column("CPU time", True),
        )
        stages = [
            (t.name, f"{t.items:,}", f"{t.cached:,}", format_seconds(t.wall_s), format_seconds(t.cpu_s))
            for t in report.times
        ]
        stages.append(("all", "", "", format_seconds(report.seconds), format_seconds(report.cpu_seconds)))
        yield Table("Time per stage", columns, tuple(stages))


def _with_unit(text: str | None, unit: str) -> str:
    return "–" if text is None else f"{text} {unit}"
