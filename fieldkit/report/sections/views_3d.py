"""The report's 3D views: their clouds, cameras and ways, each in one frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fieldkit.arrays import ByteArray, Float32Array, FloatArray
from fieldkit.clouds import Cloud, PointIndex, read_cloud
from fieldkit.errors import FieldkitError
from fieldkit.figures.content import FrustumLayer, LineLayer, PlaceName, PointLayer, ViewerScene
from fieldkit.figures.style import format_length
from fieldkit.files import file_beside
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results
from fieldkit.results.evaluation import (
    CLOUD_FILE,
    SCENE_FILE,
    EvaluationReport,
    ImageReport,
    PlotEvaluation,
    ReconstructionEntry,
    ReferenceReport,
)
from fieldkit.results.frame import CameraReport
from fieldkit.results.mission import Passing, Shot
from fieldkit.results.plan import Plan, station_number
from fieldkit.results.report_files import check_file
from fieldkit.sites.placement import PlotFrame, SiteFrame

MOST_VIEWS_OF_PLOTS = 4
"""An evaluation of more plots shows those with the greatest distances: browsers draw about a dozen views at once."""

_ACHIEVED, _PLANNED, _WRONG = "#2f9e6e", "#3b7dd8", "#d0383f"
_WAY, _FENCE, _ZONE = "#d9812b", "#7b61c4", "#d0383f"
_HALF_VIEW = (0.55, 0.41)  # of an unknown camera
_LARGEST_SCALE_M = 10.0
"""Largest distance that a scale of colours ends at, metres."""
_PLANT_GREEN = (70, 140, 70)
"""RGB of plants' points without colours of their own."""


NotedView = tuple[ViewerScene | None, str]
"""A view, and a note on it; None where there is none, and why."""


def reference_view(result: Loaded[ReferenceReport], _: Results) -> NotedView:
    """The reference's cloud, with the ground if it was kept, and its cameras."""
    report = result.report
    try:
        names = {entry.name for entry in report.files}
        cloud = read_cloud(check_file(result.folder, report, SCENE_FILE if SCENE_FILE in names else CLOUD_FILE))
    except (FieldkitError, OSError) as error:
        return None, f"No 3D view: {error}"
    layer = PointLayer("Reference", *_drawn(cloud))
    frusta = _camera_layers(report.image_reports, report.cameras, "Cameras")
    title = f"{report.source}: the reference and its {report.right} cameras"
    return ViewerScene(title, (layer,), frusta, north=_north_of(report), metric=report.metric), ""


def plot_views(result: Loaded[EvaluationReport], results: Results) -> Iterator[tuple[str, ViewerScene | None, str]]:
    """The views of an evaluation by plot: of all if they are few, else of those with the greatest distances."""
    plots = [plot for plot in result.report.plots if plot.error is None]
    if len(plots) > MOST_VIEWS_OF_PLOTS:
        plots = sorted(plots, key=lambda plot: -(plot.chamfer_m or 0.0))[:MOST_VIEWS_OF_PLOTS]
    for plot in plots:
        yield plot.name, *plot_view(result, plot, results)


def plot_view(result: Loaded[EvaluationReport], plot: PlotEvaluation, results: Results) -> NotedView:
    """A plot's cloud and the reference, each coloured by its distance to the other, with cameras planned and achieved.

    Distances are exact: from every point to the whole other cloud.
    """
    try:
        cloud = read_cloud(_plot_cloud(result, plot))
    except (FieldkitError, OSError) as error:
        return None, f"No 3D view: {error}"
    sha256, distances = result.report.reference_sha256, None
    other, note = _reference_cloud(sha256, results)
    stations = () if plot.adherence is None else plot.adherence.stations
    stands = {error.image: error.station.removeprefix("station ") for error in stations}
    frusta = _camera_layers(plot.image_reports, plot.cameras, "Cameras, achieved", stands)
    layers = []
    if other is not None and len(cloud):
        limit = min(max(result.report.distances_m, default=0.02), _LARGEST_SCALE_M)
        distances = PointIndex(other.points).nearest(cloud.points)[0]
        missing = PointIndex(cloud.points).nearest(other.points)[0]
        layers = [
            PointLayer("This capture", *_drawn(cloud), distances.astype(np.float32), limit),
            PointLayer("Reference", *_drawn(other), missing.astype(np.float32), limit, shown=False),
        ]
        note = (
            "By distance, “This capture” shows accuracy (what should not be there stands out) and “Reference” "
            "shows completeness (what is missing in this capture stands out)."
        )
    plans = [run.report.plan for run in results.of(PlanRun) if run.report.plan is not None]
    frusta += [_planned_layer(plan) for plan in plans if sha256 and plan.source and plan.source.sha256 == sha256]
    if not layers:
        layers.append(PointLayer("This capture", *_drawn(cloud)))
    title = f"{plot.name}: the capture{' against its reference' * (distances is not None)}"
    numbers = [PlaceName(str(each.plant), (each.x_m, each.y_m, 0.0)) for each in plot.plants]
    return ViewerScene(title, layers, frusta, places=numbers, north=_north_of(plot), metric=plot.metric), note


def plan_view(result: Loaded[PlanRun], results: Results) -> NotedView:
    """A plan's cameras about the plants; a pattern stands about none."""
    plan = result.report.plan
    if plan is None or not plan.stations:
        return None, ""
    layers, note = _plan_plants(plan, results)
    if not layers and not note:
        note = "The plan does not say where the plants are: they stand about the middle, on z = 0."
    heading = None if plan.row_heading_deg is None else np.radians(plan.row_heading_deg)
    north = None if heading is None else (float(np.cos(heading)), float(np.sin(heading)))
    return ViewerScene("The planned cameras", layers, (_planned_layer(plan),), north=north), note


def _plan_plants(plan: Plan, results: Results) -> tuple[list[PointLayer], str]:
    """The plants of a plan, in its plot frame: the reference's cloud, and the plants that flights keep clear of."""
    cloud, note = _reference_cloud(None if plan.source is None else plan.source.sha256, results)
    layers = [] if cloud is None else [PointLayer("Reference", *_drawn(cloud))]
    if plan.plants is not None and plan.plants.points_m:
        layers += _kept_clear(np.array(plan.plants.points_m), shown=not layers)
    return layers, note


def _kept_clear(points: FloatArray, *, shown: bool = True) -> list[PointLayer]:
    colors = np.tile(np.array(_PLANT_GREEN, dtype=np.uint8), (len(points), 1))
    return [PointLayer("Plants, as flights keep clear of them", points.astype(np.float32), colors, shown=shown)]


def _reference_cloud(sha256: str | None, results: Results) -> tuple[Cloud | None, str]:
    """The cloud of the reference with that reference.json, or why it is not shown; "" where none is asked for."""
    if sha256 is None:
        return None, ""
    reference = next((r for r in results.of(ReferenceReport) if r.sha256 == sha256), None)
    if reference is None:
        return None, "The reference is not in this folder, so it is not shown."
    try:
        return read_cloud(check_file(reference.folder, reference.report, CLOUD_FILE)), ""
    except (FieldkitError, OSError) as error:
        return None, f"The reference is not shown: {error}"


def mission_view(result: Loaded[FlownMission], _: Results) -> NotedView:
    """A mission's way, photographs and limits, in metres about home."""
    record, flight = result.report.record, result.report.flight
    frame = SiteFrame(record.home)
    shots: list[Shot | Passing] = [*flight.shots, *flight.passings]
    poses = [
        Pose.from_yaw_pitch(position, s.yaw_deg, s.pitch_deg)
        for position, s in zip(frame.points(shots), shots, strict=True)
    ]
    numbers = [f"{station_number(s.station)}" if isinstance(s, Shot) else "" for s in shots]
    labels = [
        f"{s.plot}, station {number}" if isinstance(s, Shot) else s.name
        for s, number in zip(shots, numbers, strict=True)
    ]
    lines = [LineLayer("Way", (frame.points(record.way(flight)).astype(np.float32),), _WAY)]
    for name, rings, color in (("Fence", record.inside, _FENCE), ("No-fly zones", record.outside, _ZONE)):
        if rings:
            closed = [
                np.pad(np.array(frame.outline((*ring, ring[0]))), ((0, 0), (0, 1))).astype(np.float32) for ring in rings
            ]
            lines.append(LineLayer(name, closed, color))
    half = _half_view(record.vehicle.camera)
    frusta = FrustumLayer("Photographs", poses, labels, *half, _PLANNED, numbers=numbers)
    places = [PlaceName("home", (0.0, 0.0, 0.0))]
    for plot in record.plots:
        if plot.name in flight.plots:
            x, y, z = frame.to_local(*PlotFrame.recorded(plot).to_geodetic(np.zeros((1, 3))))[0].tolist()
            places.append(PlaceName(plot.name, (x, y, z)))
    return ViewerScene(
        f"{flight.name}: the way and its photographs",
        (),
        (frusta,),
        lines,
        places,
        north=(0.0, 1.0),
    ), ""


def within_budget(scenes: Sequence[ViewerScene], most_points: int) -> list[ViewerScene]:
    """The same views with a limited number of points in all: every layer keeps the same share.

    The kept points are drawn at random from a fixed seed.
    """
    total = sum(len(layer.points) for scene in scenes for layer in scene.points)
    if total <= most_points:
        return list(scenes)
    share = most_points / total
    return [replace(scene, points=tuple(_thinned(layer, share) for layer in scene.points)) for scene in scenes]


def points_of(scenes: Sequence[ViewerScene]) -> int:
    """The number of points of views."""
    return sum(len(layer.points) for scene in scenes for layer in scene.points)


def _thinned(layer: PointLayer, share: float) -> PointLayer:
    count = len(layer.points)
    kept = np.sort(np.random.default_rng(0).choice(count, int(count * share), replace=False))
    return replace(
        layer,
        points=layer.points[kept],
        colors=None if layer.colors is None else layer.colors[kept],
        values=None if layer.values is None else layer.values[kept],
    )


def _drawn(cloud: Cloud) -> tuple[Float32Array, ByteArray | None]:
    return cloud.points.astype(np.float32), cloud.colors


def _plot_cloud(result: Loaded[EvaluationReport], plot: PlotEvaluation) -> Path:
    name = f"{plot.name}/{CLOUD_FILE}"
    try:
        inside = file_beside(Path(name), result.folder / "evaluation.json")
    except (RuntimeError, ValueError) as error:
        raise FieldkitError("its name is no path") from error
    if inside is None or Path(plot.name).is_absolute():
        raise FieldkitError("its cloud does not lie in the evaluation's folder")
    return check_file(result.folder, result.report.model_copy(update={"files": plot.files}), name)


def _camera_layers(
    images: Sequence[ImageReport], cameras: Sequence[CameraReport], name: str, numbers: Mapping[str, str] | None = None
) -> list[FrustumLayer]:
    half = _HALF_VIEW
    if cameras:
        camera = max(cameras, key=lambda c: c.photos)
        try:
            half = _half_view(Intrinsics(camera.model, camera.width, camera.height, camera.params))
        except ValueError:
            half = _HALF_VIEW
    layers = []
    for title, color, right in ((name, _ACHIEVED, True), ("Cameras, pose found wrong", _WRONG, False)):
        chosen = [(i, pose) for i in images if i.counts is right and (pose := i.pose) is not None]
        if chosen:
            layers.append(
                FrustumLayer(
                    title,
                    [pose for _, pose in chosen],
                    [_label(image) for image, _ in chosen],
                    *half,
                    color,
                    numbers=[numbers.get(image.name, "") for image, _ in chosen] if numbers else (),
                )
            )
    return layers


def _label(image: ImageReport) -> str:
    off = image.position_residual_m
    return image.name if off is None else f"{image.name}, {format_length(off)} from its known position"


def _planned_layer(plan: Plan) -> FrustumLayer:
    half = _HALF_VIEW if plan.camera is None else _half_view(plan.camera)
    poses = [station.pose for station in plan.stations]
    numbers = [f"{station_number(index)}" for index in range(len(poses))]
    labels = [f"station {number}" for number in numbers]
    return FrustumLayer("Cameras, planned", poses, labels, *half, _PLANNED, numbers=numbers)


def _north_of(report: ReconstructionEntry) -> tuple[float, float] | None:
    """True north in a plot frame; None where it is not georeferenced."""
    if report.metric_source is None or report.frame is None or report.frame.origin is None:
        return None
    x, y, _ = report.frame.of_source(report.metric_source).from_source.rotation[:, 1]
    return float(x / np.hypot(x, y)), float(y / np.hypot(x, y))


def _half_view(camera: Intrinsics) -> tuple[float, float]:
    width, height = camera.width / 2 / camera.fx, camera.height / 2 / camera.fy
    return (width, height) if 0.01 < width < 20 and 0.01 < height < 20 else _HALF_VIEW
