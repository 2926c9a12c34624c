"""The result of a reconstruction: main figures, photographs, findings, times."""

from __future__ import annotations

from collections.abc import Sequence

from fieldkit.figures.content import Column, Mark, Table, tabulated
from fieldkit.figures.style import DASH, decimal, format_length, format_seconds, with_unit
from fieldkit.results.evaluation import ImageReport, ReconstructionEntry, ReferenceReport
from fieldkit.results.finding import Finding
from fieldkit.results.frame import CameraReport
from fieldkit.wording import by_key, count, listed

_MOST_CAMERAS = 4
"""Most cameras that are listed."""


def quality_rows(report: ReconstructionEntry) -> tuple[tuple[str, str], ...]:
    """The main figures of a reconstruction, as label and value."""
    metric = report.metric
    wrong = sum(image.registered and image.right is False for image in report.image_reports)
    known = any(image.position_residual_m is not None or image.right is not None for image in report.image_reports)
    stated = sum(image.stated for image in report.image_reports)
    unconfirmed = f", {stated} by stated poses that no picture confirms" if stated else ""
    untold = "not known: too few matches to tell" if stated else "not known: no positions to compare with"
    share = f" ({100 * report.registered / report.images:.0f} %)" if report.images else ""
    pairs = f"{report.pairs_verified:,} of {report.pairs_tried:,} pairs verified"
    tracks = f"{report.observations:,} observations, track length {decimal(report.track_length) or DASH}"
    rows = [
        ("photographs registered", f"{report.registered} of {report.images}{share}"),
        ("photographs used", f"{report.right}{unconfirmed}"),
        ("registered but wrong", f"{wrong}" if known else untold),
        *_known_to(report),
        ("models", f"{len(report.models)} ({', '.join(map(str, report.models)) or 'no'} photographs)"),
        ("mapping", f"{report.method or DASH}, {pairs}"),
        ("features per photograph", decimal(report.features_per_image, 0) or DASH),
        ("sparse points", f"{report.sparse_points:,}, {tracks}"),
        ("reprojection error", with_unit(decimal(report.reprojection_px), "px")),
        ("scale and place from", _metric_source(report)),
        *(("camera", camera) for camera in _cameras(report.cameras)),
    ]
    if report.frame is not None:
        ground = report.frame.ground
        tilt = "none found" if ground is None else f"{format_length(ground.rms_m, metric=metric)} RMS"
        rows += [("ground plane", tilt), *(("doubt about the frame", note) for note in report.frame.notes)]
    rows.append(("ground sampling distance", f"{format_length(report.gsd_m, metric=metric)} per pixel"))
    if report.volume is not None:
        edges = (high - low for low, high in zip(report.volume.lower_m, report.volume.upper_m, strict=True))
        unit = "m" if metric else "units"
        rows.append(("volume of interest", " × ".join(f"{edge:.2f}" for edge in edges) + f" {unit}"))
    rows.append(("plants", _plants(report)))
    if report.near_3px is not None and report.near_6px is not None and report.inside is not None:
        filled = f"{100 * report.near_3px:.0f} and {100 * report.near_6px:.0f} % within 3 and 6 px of the cloud"
        holes = "" if report.filled is None else f", {100 * report.filled:.0f} % of them fill holes"
        rows.append(("plants' pixels", f"{filled}, {100 * report.inside:.0f} % of its points on plants{holes}"))
    if isinstance(report, ReferenceReport) and report.scene_points is not None:
        rows.append(("scene", f"{report.scene_points:,} points"))
    if report.dense is not None:
        pixel = report.dense.pixel_m
        size = "" if pixel is None else f" ({format_length(pixel)} per pixel)"
        rows.append(("dense stereo", f"{report.dense.fidelity}{size}, plants by mask {report.dense.mask}"))
    return tuple(rows)


def photograph_table(images: Sequence[ImageReport], caption: str, *, metric: bool) -> Table:
    """The state of photographs, unused ones first."""
    return tabulated(
        caption,
        [
            {
                "photograph": i.name,
                Column("state", detail=True): state(i),
                "features>": f"{i.features:,}",
                Column("points seen", True, detail=True): f"{i.observations:,}",
                Column("reprojection, px", True, detail=True): decimal(i.reprojection_px),
                Column(f"position residual{', m' * metric}", True, detail=True): decimal(i.position_residual_m, 3),
                Column(f"known to{', m' * metric}", True, detail=True): decimal(i.sigma_m and 2.0 * i.sigma_m, 3),
                Column("direction residual, °", True, detail=True): decimal(i.angle_residual_deg),
                Column(f"height{', m' * metric}", True, detail=True): i.center_m and decimal(i.center_m[2]),
                Column("pitch, °", True, detail=True): decimal(i.pitch_deg, 1),
                "why": i.reason or None,
            }
            for i in sorted(images, key=lambda image: image.counts)
        ],
    )


def state(image: ImageReport) -> Mark:
    """Whether a photograph was used."""
    if image.stated:
        return Mark("note", "used, not confirmed")
    if not image.registered:
        return Mark("problem", "not registered")
    if image.right is False:
        return Mark("problem", "wrong pose")
    return Mark("note", "used, loose") if image.reason else Mark("good", "used")


def stage_table(report: ReconstructionEntry) -> Table:
    """The time of each stage and of all together."""
    rows = [(t.name, f"{t.items:,}", f"{t.cached:,}", t.wall_s, t.cpu_s) for t in report.times]
    return tabulated(
        "Time per stage",
        [
            {
                "stage": name,
                "items>": items,
                "from cache>": cached,
                "time>": format_seconds(wall_s),
                "CPU time>": format_seconds(cpu_s),
            }
            for name, items, cached, wall_s, cpu_s in [*rows, ("all", "", "", report.seconds, report.cpu_seconds)]
        ],
    )


def finding_table(findings: Sequence[Finding], most_names: int) -> Table:
    """One row per finding; files with the same finding share it, up to ``most_names`` by name."""
    groups = by_key(((f.code, f.message, f.left_out), f.subject) for f in findings)

    return tabulated(
        "Findings",
        [
            {
                "finding": code,
                "files>": f"{len(names):,}",
                "what was found": f"{listed(names, most_names + 1)}: {'left out: ' if left_out else ''}{message}",
            }
            for (code, message, left_out), names in groups.items()
        ],
    )


def _metric_source(report: ReconstructionEntry) -> str:
    source = f"{report.metric_source or DASH}" if report.metric else "nothing: lengths are not metres"
    if report.pose_rms_m is None:
        return source
    bound = report.position_bound_m
    right = "" if bound is None else f", right up to {format_length(bound, metric=report.metric)}"
    return f"{source}, residuals {format_length(report.pose_rms_m, metric=report.metric)} RMS{right}"


def _known_to(report: ReconstructionEntry) -> list[tuple[str, str]]:
    """How well the places of photographs are known, the weakest of all and what could be off together."""
    sigmas = [image.sigma_m for image in report.image_reports if image.counts and image.sigma_m is not None]
    if not sigmas or report.weakest is None:
        return []
    most, together = format_length(2.0 * max(sigmas)), listed(list(report.weakest.photographs))
    off = format_length(2.0 * report.weakest.sigma_m)
    return [
        ("places known to", f"{most} (two standard deviations); {together} could lie {off} off the others together")
    ]


def _cameras(cameras: Sequence[CameraReport]) -> list[str]:
    found = [
        f"{camera.model} {camera.width}×{camera.height}, f {camera.params[0]:.1f} px, {camera.source}, "
        f"{count(camera.photos, 'photograph')} ({camera.key})"
        for camera in cameras
    ]
    return found if len(found) <= _MOST_CAMERAS else [*found[: _MOST_CAMERAS - 1], f"and {len(found) - 3} more"]


def _plants(report: ReconstructionEntry) -> str:
    text = f"{report.points:,} points"
    if report.points_per_plant_voxel is None:
        return text
    edge = format_length(report.plant_voxel_m, metric=report.metric)
    return f"{text}, {report.points_per_plant_voxel:.1f} per {edge} voxel"
