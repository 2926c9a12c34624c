"""The frame a visit is reconstructed in: its plot's, known from the site, but for the height of the ground.

Positions by GPS are good to metres in height and, without RTK, to metres sideways, too. What the site knows of a plot
is its origin and the heading of its rows. So a visit is mapped in a frame with those, and settled afterwards: the
ground that its photographs show becomes z = 0, and where the positions are too coarse to say where the plot lies, the
place its cameras look at is put where the plan's cameras look.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.campaign.reading import CampaignPlot
from fieldkit.captures.model import Capture
from fieldkit.clouds.canopy import Outline
from fieldkit.clouds.volume import Volume
from fieldkit.evaluation.rasters import COARSE_M
from fieldkit.evaluation.traits import PlotOutline
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame, plot_from_enu
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.reconstruction.plot_frame import find_ground, moved_plane
from fieldkit.results.frame import Plane
from fieldkit.results.plan import Plan
from fieldkit.vocabulary import LEAST_POSITIONS

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
        sideways = moved_plane(ground, Similarity(1.0, np.eye(3), np.array([shift[0], shift[1], 0.0])))
        wanted = 0.0 if self.onto is None else _height_at_origin(self.onto)
        shift[2] = wanted - _height_at_origin(sideways)
        motion = Similarity(1.0, np.eye(3), shift)
        return motion, moved_plane(ground, motion) if self.onto is None else self.onto


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
    positions = _positions(capture)
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
        corners = drawn_outline(plot, reference.source)
        return PlacedVisit(settled, outline=None if corners is None else PlotOutline(corners))
    if capture.metric_source is None:
        return PlacedVisit(None, ("no positions: reconstructed in a frame and at a scale of its own",))
    if capture.origin is None:
        if not on_stations(capture, plan):
            note = "poses.csv is not in the plan's frame, and there is no GPS: the plot's place in it is not known"
            return PlacedVisit(None, (note,))
        own = SourceFrame(capture.metric_source, LocalFrame(plot.latitude_deg, plot.longitude_deg), _own_axes(plot))
        corners = drawn_outline(plot, own)
        source = SourceFrame(capture.metric_source, None, Similarity.identity())
        known = KnownPlot(source, visit_volume(plan, corners), None, settle=Settling(None, height, None, seed))
        return PlacedVisit(known, outline=_known_or_not(corners))
    origin = LocalFrame(plot.latitude_deg, plot.longitude_deg, capture.origin.altitude_m, capture.origin.datum)
    source = SourceFrame(capture.metric_source, origin, _own_axes(plot))
    accuracy = _accuracy_m(capture)
    coarse = accuracy > COARSE_M
    notes: tuple[str, ...] = ()
    if coarse:
        note = f"positions are good to {accuracy:.1f} m only: the plot is taken to lie where the cameras look"
        notes = (note,)
    settle = Settling(aim if coarse else None, height, None, seed)
    corners = None if coarse else drawn_outline(plot, source)
    outline = _known_or_not(corners)
    if coarse and (plot.shape is not None or plot.size_m is not None):
        outline = PlotOutline(
            None, f"positions are good to {accuracy:.1f} m only, so the plot's outline cannot be placed"
        )
    known = KnownPlot(source, visit_volume(plan, corners), None, settle=settle)
    return PlacedVisit(known, notes, outline, at_origin=coarse)


def drawn_outline(plot: CampaignPlot, source: SourceFrame) -> Outline | None:
    """Corners (x, y) of a plot in the plot frame that a source frame leads into, from the polygon that it is drawn as,
    or else its length and width; None where nobody said either, or the source lies nowhere on Earth.
    """
    if source.origin is None:
        return None
    own = LocalFrame(plot.latitude_deg, plot.longitude_deg, source.origin.altitude_m, source.origin.datum)
    if plot.shape is not None:
        latitude, longitude = np.array(plot.shape, dtype=np.float64).T
    elif plot.size_m is not None:
        x, y = 0.5 * plot.size_m[0], 0.5 * plot.size_m[1]
        ring = np.array([(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)]) @ plot_from_enu(plot.row_heading_deg)
        latitude, longitude, _ = own.to_geodetic(ring)
    else:
        return None
    corners = source.from_source.apply(source.origin.to_local(latitude, longitude, source.origin.altitude_m))
    return tuple((float(x), float(y)) for x, y, _ in corners)


def visit_volume(plan: Plan, outline: Outline | None) -> Volume:
    """The volume of interest of a visit: above the plot's outline where it is known, else `plan_volume`."""
    volume = plan_volume(plan)
    if outline is None:
        return volume
    low, high = np.min(outline, axis=0), np.max(outline, axis=0)
    return Volume((*low.tolist(), volume.lower[2]), (*high.tolist(), volume.upper[2]))


def _known_or_not(corners: Outline | None) -> PlotOutline:
    return PlotOutline() if corners is None else PlotOutline(corners)


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


def _positions(capture: Capture) -> FloatArray:
    return np.array([p.position for p in capture.priors.values() if p.position is not None], dtype=np.float64)


def _accuracy_m(capture: Capture) -> float:
    """Standard deviation of one position, median: errors of GPS are common to a visit, so they do not average out."""
    stated = [p.position_sigma_m for p in capture.priors.values() if p.position is not None]
    return float(np.median(stated)) if stated else 0.0


def _height_at_origin(plane: Plane) -> float:
    return float(plane.offset_m / plane.normal[2])
