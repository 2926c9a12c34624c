"""What a worker does: one visit evaluated and written into its folder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache
from fieldkit.campaign.reading import CampaignPlot, stage_versions, visit_place
from fieldkit.captures.bursts import by_station
from fieldkit.captures.model import Capture
from fieldkit.captures.selection import FoundPhoto, capture_of
from fieldkit.clouds.canopy import Outline
from fieldkit.clouds.volume import Volume
from fieldkit.errors import MetadataError
from fieldkit.evaluation.adherence import ComparedPlan
from fieldkit.evaluation.conversion import evaluation_report
from fieldkit.evaluation.evaluate_plot import RESERVED, PlotCapture, Scoring, evaluate_plot, write_evaluation
from fieldkit.evaluation.rasters import COARSE_M
from fieldkit.evaluation.reference import Reference
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.evaluation.traits import PlotOutline
from fieldkit.files import atomic_folder
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame, plot_from_enu
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.reconstruction.plot_frame import find_ground
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.fields import clean_text
from fieldkit.results.finding import COARSE_RASTERS, NO_RASTERS, TOLD
from fieldkit.results.frame import Plane
from fieldkit.results.plan import Plan
from fieldkit.results.report_files import EVALUATION_FILE, REFERENCE_FILE
from fieldkit.results.visit import VISIT_FILE, Visit, save_visit
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.sites.fit import plants_outgrown
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.sites.plots_file import drawn_outline
from fieldkit.version import __version__
from fieldkit.vocabulary import LEAST_POSITIONS
from fieldkit.wording import count


@dataclass(frozen=True)
class VisitJob:
    """What a worker needs to evaluate a visit."""

    plot: CampaignPlot
    date: str
    """ISO 8601."""
    photos: tuple[FoundPhoto, ...]
    captures: str
    """Their folder, for people."""
    notes: tuple[str, ...]
    """Of sorting."""
    folder: Path
    """Of the campaign."""
    plan: Plan
    """That was flown."""
    evaluation: EvaluationSettings
    camera: Path | None
    """Calibration of photographs without one."""
    cache: Path | None
    """Its root, or None."""
    inputs: str = ""
    """Digest of all that the result depends on; "" where it could not be made."""

    @property
    def place(self) -> str:
        """The visit's folder, relative to the campaign's."""
        return visit_place(self.plot.name, self.date)


def evaluate_visit(job: VisitJob) -> Visit:
    """Evaluate a visit and write its folder.

    What is wrong with its photographs or files is kept as its ``error`` with its inputs, so that it is not met again
    before something changes.
    """
    place = job.folder / job.place
    marker = EVALUATION_FILE if (place / EVALUATION_FILE).is_file() else VISIT_FILE
    with atomic_folder(place, overwrite=True, marker=marker) as folder:
        visit = _evaluated(job, folder)
        save_visit(folder, visit)
    return visit


def failed_visit(job: VisitJob, error: str) -> Visit:
    """A visit that came to nothing and is tried again by the next run."""
    return Visit(images=len(job.photos), error=error, **_of_job(job, job.notes))


def _of_job(job: VisitJob, notes: Iterable[str]) -> dict[str, Any]:
    """A visit's fields that are known before it is evaluated."""
    return {
        "plot": job.plot.name,
        "date": job.date,
        "captures": job.captures,
        "notes": tuple(dict.fromkeys(notes)),
        "fieldkit": __version__,
        "stages": stage_versions(),
        "photographs": _paths(job),
    }


def _paths(job: VisitJob) -> dict[str, str]:
    found = {}
    for each in job.photos:
        path = each.photo.path
        inside = path.is_relative_to(job.folder)
        name = (path.relative_to(job.folder) if inside else path).as_posix()
        if clean_text(name) == name:  # bytes that are no UTF-8 cannot be kept: such a photograph is given again
            found[each.photo.sha256] = name
    return found


def _evaluated(job: VisitJob, folder: Path) -> Visit:
    spent = Spent.now()
    settings, notes = job.evaluation.reconstruction, list(job.notes)

    def given() -> PlotCapture:
        reference = _reference(job.plot)
        known = None if reference is None else reference.known_plot()
        capture = by_station(capture_of(job.photos, camera=job.camera), settings.mask)
        without = wanted_sidecars(capture, job.plan, known)
        if without:
            notes.append(f"{' and '.join(sorted(without))} passed over: the positions are taken from GPS")
            capture = by_station(capture_of(job.photos, camera=job.camera, without=without), settings.mask)
        placed = place_visit(capture, job.plot, job.plan, known, seed=settings.seed)
        notes.extend((*placed.notes, *_against_plan(capture, job.plan)))
        rasters = job.evaluation.wanted_rasters
        return PlotCapture(
            capture,
            Scoring.against(reference, refine=job.evaluation.refine, distances_m=job.evaluation.distances_m),
            placed.plot,
            placed.outline,
            None if rasters is None else replace(rasters, at_origin=placed.at_origin),
            None if placed.plot is None else ComparedPlan(job.plan, placed.plot.source),
        )

    name = plot_file_name(job.plot.name, RESERVED)
    plot = evaluate_plot(
        job.plot.name, given, folder, name, settings, Context(StageCache(job.cache)), photographs=len(job.photos)
    )
    report = evaluation_report(
        Path(job.captures).name,
        [plot],
        settings,
        reference_sha256=job.plot.reference_sha256,
        refine=job.evaluation.refine,
        distances_m=job.evaluation.distances_m,
        spent=spent,
    )
    write_evaluation(folder, report)
    said = _of_job(job, [*notes, *_remarks(job, plot)])
    return Visit.of_evaluation(plot, folder=job.place, cpu_s=spent.cpu_seconds, inputs=job.inputs, **said)


def _remarks(job: VisitJob, plot: PlotEvaluation) -> Iterator[str]:
    """What else a person should know of an evaluation."""
    yield from (finding.message for finding in plot.findings if finding.code in (*TOLD, COARSE_RASTERS))
    yield from (f"no rasters: {finding.message}" for finding in plot.findings if finding.code == NO_RASTERS)
    top_m = None if plot.traits is None else plot.traits.height_m
    outgrown = None if top_m is None else plants_outgrown(job.plan, top_m)
    if outgrown is not None:
        yield f"{outgrown.message}. {outgrown.remedy}"
    if plot.prediction is not None and plot.prediction.reason:
        yield f"no prediction: {plot.prediction.reason}"


def _against_plan(capture: Capture, plan: Plan) -> list[str]:
    have, asked = len(capture.photos), len(plan.stations)
    if have == asked:
        return []
    return [f"{count(have, 'photograph')}, {'fewer' if have < asked else 'more'} than the plan's {asked}"]


def _reference(plot: CampaignPlot) -> Reference | None:
    if plot.reference is None:
        return None
    if plot.reference_sha256_now() != plot.reference_sha256:
        raise MetadataError(
            f"the reference of {plot.name} is not there, or is not the one that campaign.toml names by its sha256",
            path=plot.reference / REFERENCE_FILE,
            remedy="Correct its path or its sha256 in campaign.toml; all visits of the plot are then evaluated again.",
        )
    return Reference(plot.reference)


ON_STATION_M = 0.5
"""poses.csv is in the plot frame where its positions are this near to the plan's stations (median)."""
_MARGIN = 0.15  # of the plants' width, on every side
_LEAST_MARGIN_M = 0.10
"""Least width about the plants on every side, metres."""
_GROWTH = 0.5  # of the plants' height: other plots and later dates are higher than what was planned on
_LEAST_GROWTH_M = 0.30
"""Least height above the plants, metres."""
_BELOW_M = 0.05
"""Depth of the volume below the ground, metres."""


@dataclass(frozen=True, eq=False)
class Settling:
    """Moves a mapped visit onto its plot's ground; see `KnownPlot.settle`."""

    aim: tuple[float, float] | None
    """(x, y) where the plan's cameras look; None leaves the place sideways as it is."""
    height_m: float
    """Of the stations' median, which the cameras' takes where no ground is found."""
    onto: Plane | None = None
    """Ground of the plot's reference, to which the visit's is moved; None makes it z = 0 at the origin."""
    seed: int = 0
    """Of the ground's RANSAC."""

    def __call__(self, points: FloatArray, poses: Mapping[str, Pose]) -> tuple[Similarity, Plane | None]:
        shift = np.zeros(3)
        looked_at = None if self.aim is None else region_of_interest(list(poses.values()))
        if self.aim is not None and looked_at is not None:
            shift[:2] = np.array(self.aim) - np.array(looked_at.center[:2])
        ground = find_ground(points, poses, seed=self.seed, up=np.array([0.0, 0.0, 1.0]))
        if ground is None:
            shift[2] = self.height_m - float(np.median([pose.center[2] for pose in poses.values()]))
            return Similarity(1.0, np.eye(3), shift), self.onto
        sideways = ground.moved(Similarity(1.0, np.eye(3), np.array([shift[0], shift[1], 0.0])))
        wanted = 0.0 if self.onto is None else _height_at_origin(self.onto)
        shift[2] = wanted - _height_at_origin(sideways)
        motion = Similarity(1.0, np.eye(3), shift)
        return motion, ground.moved(motion) if self.onto is None else self.onto


@dataclass(frozen=True, eq=False)
class PlacedVisit:
    """Where a visit is reconstructed."""

    plot: KnownPlot | None
    """What is known; None where nothing is, and the visit's own frame is found from its cameras."""
    notes: tuple[str, ...] = ()
    """What a person should know of it."""
    outline: PlotOutline | None = None
    """Of the plot; None takes the bounds that its reference was made with."""
    at_origin: bool = False
    """The plot's place on Earth is that of the site, not that of the visit's positions, which are too coarse for it."""


def wanted_sidecars(capture: Capture, plan: Plan, reference: KnownPlot | None) -> frozenset[str]:
    """Sidecars of a visit that must not be used, since its positions are wanted from elsewhere.

    Where the plot's reference is georeferenced, GPS is, where there is enough of it; where there is no reference,
    poses.csv that is not in the plan's frame is passed over for GPS.
    """
    tagged = sum(photo.geotag is not None for photo in capture.photos) >= LEAST_POSITIONS
    if capture.metric_source != "poses.csv" or not tagged:
        return frozenset()
    if reference is not None:
        return frozenset({"poses.csv"}) if reference.source.georeferenced else frozenset()
    return frozenset() if on_stations(capture, plan) else frozenset({"poses.csv"})


def on_stations(capture: Capture, plan: Plan) -> bool:
    """Whether the known positions are those of the plan's stations: then they are in the plot frame."""
    positions = np.array([p.position for p in capture.priors.values() if p.position is not None], dtype=np.float64)
    if not len(positions):
        return False
    stations = np.array([station.position_m for station in plan.stations])
    nearest = np.linalg.norm(positions[:, None] - stations[None], axis=2).min(axis=1)
    return float(np.median(nearest)) <= ON_STATION_M


def place_visit(
    capture: Capture, plot: CampaignPlot, plan: Plan, reference: KnownPlot | None, *, seed: int = 0
) -> PlacedVisit:
    """The frame, volume and ground of a visit."""
    aim, height = plan_aim(plan)
    if reference is not None:
        if not reference.source.georeferenced or capture.origin is None:
            return PlacedVisit(reference)
        settled = replace(reference, settle=Settling(None, height, reference.ground, seed))
        corners = drawn_outline(plot, plot.shape, reference.source)
        return PlacedVisit(settled, outline=None if corners is None else PlotOutline(corners))
    if capture.metric_source is None:
        return PlacedVisit(None, ("no positions: reconstructed in a frame and at a scale of its own",))
    if capture.origin is None:
        if not on_stations(capture, plan):
            note = "poses.csv is not in the plan's frame, and there is no GPS: the plot's place in it is not known"
            return PlacedVisit(None, (note,))
        own = SourceFrame(capture.metric_source, LocalFrame(plot.latitude_deg, plot.longitude_deg), _own_axes(plot))
        corners = drawn_outline(plot, plot.shape, own)
        source = SourceFrame(capture.metric_source, None, Similarity.identity())
        known = KnownPlot(source, visit_volume(plan, corners), None, settle=Settling(None, height, None, seed))
        return PlacedVisit(known, outline=PlotOutline(corners))
    origin = LocalFrame(plot.latitude_deg, plot.longitude_deg, capture.origin.altitude_m, capture.origin.datum)
    source = SourceFrame(capture.metric_source, origin, _own_axes(plot))
    accuracy = _accuracy_m(capture)
    coarse = accuracy > COARSE_M
    notes: tuple[str, ...] = ()
    if coarse:
        note = f"positions are good to {accuracy:.1f} m only: the plot is taken to lie where the cameras look"
        notes = (note,)
    settle = Settling(aim if coarse else None, height, None, seed)
    corners = None if coarse else drawn_outline(plot, plot.shape, source)
    outline = PlotOutline(corners)
    if coarse and (plot.shape is not None or plot.size_m is not None):
        outline = PlotOutline(
            None, f"positions are good to {accuracy:.1f} m only, so the plot's outline cannot be placed"
        )
    known = KnownPlot(source, visit_volume(plan, corners), None, settle=settle)
    return PlacedVisit(known, notes, outline, at_origin=coarse)


def visit_volume(plan: Plan, outline: Outline | None) -> Volume:
    """The volume of interest of a visit: above the plot's outline where it is known, else `plan_volume`."""
    volume = plan_volume(plan)
    if outline is None:
        return volume
    low, high = np.min(outline, axis=0), np.max(outline, axis=0)
    return Volume((*low.tolist(), volume.lower[2]), (*high.tolist(), volume.upper[2]))


def plan_aim(plan: Plan) -> tuple[tuple[float, float], float]:
    """Where the plan's cameras look, (x, y) in the plot frame, and the median height of its stations."""
    poses = [station.pose for station in plan.stations]
    centers = np.array([pose.center for pose in poses])
    region = region_of_interest(poses)
    middle = centers.mean(axis=0) if region is None else np.array(region.center)
    return (float(middle[0]), float(middle[1])), float(np.median(centers[:, 2]))


def plan_volume(plan: Plan) -> Volume:
    """The volume of interest on every plot: the plants planned on, with room for others and for growth.

    Without plants in the plan it is a box about what its cameras look at.
    """
    heights = [station.position_m[2] for station in plan.stations]
    if plan.plants is not None and plan.plants.points_m:
        points = np.array(plan.plants.points_m, dtype=np.float64).reshape(-1, 3)
        lower, upper = points.min(axis=0), points.max(axis=0)
        side = np.maximum(_MARGIN * (upper - lower)[:2], _LEAST_MARGIN_M) + plan.plants.cell_m
        top = upper[2] + plan.plants.cell_m + max(_GROWTH * upper[2], _LEAST_GROWTH_M)
    else:
        (x, y), _ = plan_aim(plan)
        region = region_of_interest([station.pose for station in plan.stations])
        reach = 0.5 * float(np.median(heights)) if region is None else region.radius
        lower, upper = np.array([x - reach, y - reach, 0.0]), np.array([x + reach, y + reach, 0.0])
        side = np.zeros(2)
        top = max(float(np.median(heights)), 2 * _LEAST_GROWTH_M)
    bottom = min(float(lower[2]), 0.0) - _BELOW_M
    return Volume((*(lower[:2] - side), bottom), (*(upper[:2] + side), max(top, bottom + _LEAST_GROWTH_M)))


def _own_axes(plot: CampaignPlot) -> Similarity:
    return Similarity(1.0, plot_from_enu(plot.row_heading_deg), np.zeros(3))


def _accuracy_m(capture: Capture) -> float:
    """Standard deviation of one position, median: errors of GPS are common to a visit, so they do not average out."""
    stated = [p.position_sigma_m for p in capture.priors.values() if p.position is not None]
    return float(np.median(stated)) if stated else 0.0


def _height_at_origin(plane: Plane) -> float:
    return float(plane.offset_m / plane.normal[2])
