"""Photographs' tags in the plan's frame, their angles as they are meant, and which photograph is of which station."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.captures import Capture
from fieldkit.evaluation.recorded_angles import LEAST_COMPARED, read_angles, without_angles
from fieldkit.fieldcheck.model import Placement, finding_of
from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.geometry.stations import PoseArray, associate, turn_between
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan
from fieldkit.sites.placement import PlotFrame
from fieldkit.sites.site import Site, SitePlot
from fieldkit.vocabulary import SIGMA_OF_MEDIAN
from fieldkit.wording import listed

_MUCH_WORSE = 2.0
"""Factor from which heights scatter much more than positions, as barometers' do."""
_STEEP_DEG = 75.0
"""Pitch below which a rolled camera's yaw is no heading, degrees."""
_ROLLED_DEG = 20.0
"""Roll from which it is none, degrees."""


_BOUND_DEG = 30.0
"""Conventions are 90° apart and more, and vehicles keep to a plan's angles within some degrees."""
_NOTHING = "Nothing to do: mapping tells it by the matches, too."


@dataclass(frozen=True, eq=False)
class Tags:
    """What is written of n photographs."""

    names: tuple[str, ...]
    poses: PoseArray
    """NaN where nothing is known."""
    rolls: FloatArray
    """(n,) degrees about the optical axes."""
    sigma_m: float
    """Of a position against the others'."""

    @property
    def known(self) -> BoolArray:
        """(n,) which have a position."""
        return np.asarray(np.isfinite(self.poses.positions).all(axis=1))

    def pose(self, k: int) -> Pose:
        """Of a photograph with position and angles."""
        angles = (float(self.poses.yaws[k]), float(self.poses.pitches[k]), float(self.rolls[k]))
        return Pose.from_yaw_pitch(self.poses.positions[k], *angles)

    @property
    def for_assignment(self) -> PoseArray:
        """Without yaws of cameras that look down and are rolled: these are no headings of pictures there."""
        unclear = (self.poses.pitches < -_STEEP_DEG) & (np.abs(self.rolls) > _ROLLED_DEG)
        return replace(self.poses, yaws=np.where(unclear, np.nan, self.poses.yaws))


@dataclass(frozen=True, eq=False)
class Placed:
    """Photographs among the stations."""

    tags: Tags
    """In the plan's frame, without what is common to all."""
    placement: Placement = "none"
    station_of: Mapping[int, int] = field(default_factory=dict)
    """Index of a photograph to its station."""
    shift_m: FloatArray = field(default_factory=lambda: np.full(3, np.nan))
    """(3,) by which all photographs lay beside the plan; NaN where that cannot be told."""
    turn_deg: float | None = None
    """By which all headings were off; None without headings."""
    scatter_m: float = float("nan")
    """Of positions about their stations, per axis (1.48 times the median); of heights if much worse."""


def place_tags(capture: Capture, plan: Plan, site: Site | None = None, plot: SitePlot | None = None) -> Placed:
    """Put a capture's tags into the plan's frame and assign photographs to stations.

    ``site`` and ``plot`` say where the plan's frame lies; without them its row heading says how to turn photographs
    that lie somewhere on the Earth.
    """
    tags = read_tags(capture)
    stations = PoseArray.of([(s.position_m, s.yaw_deg, s.pitch_deg) for s in plan.stations])
    if not tags.known.any():
        return Placed(tags)
    if capture.origin is None:
        return _fitted(tags, stations, 0.0, "poses.csv") or Placed(tags)
    if site is not None and plot is not None:
        return _fitted(_in_plot(tags, capture, site, plot), stations, 0.0, "site") or Placed(tags)
    if plan.row_heading_deg is not None:
        found = _fitted(tags, stations, 90.0 - plan.row_heading_deg, "row heading")
        return Placed(tags) if found is None else replace(found, shift_m=np.full(3, np.nan))
    return Placed(tags)


def read_tags(capture: Capture) -> Tags:
    """What is written of a capture's photographs, in its own frame."""
    count = len(capture.photos)
    positions, yaws, pitches = np.full((count, 3), np.nan), np.full(count, np.nan), np.full(count, np.nan)
    rolls = np.zeros(count)
    sigmas = []
    for k, name in enumerate(capture.names):
        prior = capture.priors.get(name)
        if prior is None:
            continue
        if prior.position is not None:
            positions[k] = prior.position
            sigmas.append(prior.position_sigma_m)
        if prior.yaw_deg is not None and prior.pitch_deg is not None:
            yaws[k], pitches[k], rolls[k] = prior.yaw_deg, prior.pitch_deg, prior.roll_deg
    return Tags(capture.names, PoseArray(positions, yaws, pitches), rolls, float(np.median(sigmas)) if sigmas else 0.0)


def _in_plot(tags: Tags, capture: Capture, site: Site, plot: SitePlot) -> Tags:
    """Tags of a georeferenced capture in the frame of a site's plot; heights as well as home's is known."""
    assert capture.origin is not None
    frame = PlotFrame.of(site, plot)
    known, poses = tags.known[:, None], tags.poses
    latitude, longitude, altitude = capture.origin.to_geodetic(np.where(known, poses.positions, 0.0))
    datums = {"ellipsoid": site.home.ellipsoid_m, "sea level": site.home.amsl_m}
    home = datums.get(capture.origin.datum)
    above = altitude - (capture.origin.altitude_m if home is None else home)
    positions = frame.to_plot(latitude, longitude, above)
    yaws = frame.yaws(latitude, longitude, np.nan_to_num(poses.yaws))
    pitches = frame.planned_pitches(yaws, np.nan_to_num(poses.pitches))
    there = PoseArray(
        np.where(known, positions, np.nan),
        np.where(np.isfinite(poses.yaws), yaws, np.nan),
        np.where(np.isfinite(poses.pitches), pitches, np.nan),
    )
    return replace(tags, poses=there)


def _fitted(tags: Tags, stations: PoseArray, turn_deg: float, placement: Placement) -> Placed | None:
    """Turned clockwise, wherever the photographs lie."""
    found = associate(tags.for_assignment.moved(turn_deg), stations, most_offset_m=np.inf)
    if not found.station_of:
        return None
    moved = tags.poses.moved(turn_deg, -found.offset_m, -found.heading_deg)
    apart = moved.positions[list(found.station_of)] - stations.positions[list(found.station_of.values())]
    return Placed(
        replace(tags, poses=moved),
        placement,
        found.station_of,
        found.offset_m,
        found.heading_deg if np.isfinite(moved.yaws).any() else None,
        _scatter_m(apart),
    )


def _scatter_m(apart: FloatArray) -> float:
    """Per axis, of positions less stations (n, 3); that of heights where these are much worse, as barometers are."""
    together, up = (SIGMA_OF_MEDIAN * float(np.median(np.abs(each))) for each in (apart, apart[:, 2]))
    return up if up > _MUCH_WORSE * together else together


def axis_turn_deg(yaw_a: float, pitch_a: float, yaw_b: float, pitch_b: float) -> float:
    """Angle between two optical axes, degrees."""
    a, b = (Pose.from_yaw_pitch(np.zeros(3), *angles).forward for angles in ((yaw_a, pitch_a), (yaw_b, pitch_b)))
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def angles_as_meant(
    capture: Capture, plan: Plan, site: Site | None, plot: SitePlot | None
) -> tuple[Capture, list[Finding]]:
    """A capture with its recorded angles read as they are meant, and what a person should know of that.

    The plan tells it, by the stations that positions alone assign. Where most angles are the plan's, as fieldkit reads
    them, the others stay: they may tell of a photograph that was taken otherwise.
    """
    if all(prior.yaw_deg is None for prior in capture.priors.values()):
        return capture, []
    placed = place_tags(without_angles(capture), plan, site, plot)
    if len(placed.station_of) < LEAST_COMPARED:
        return capture, []
    names = [capture.names[k] for k in placed.station_of]
    before = np.array([capture.priors[name].position for name in names], dtype=np.float64)
    turned_rad = np.radians(turn_between(before, placed.tags.poses.positions[list(placed.station_of)]))
    turn = rotation_about_z(-turned_rad)
    planned = {capture.names[k]: plan.stations[s].pose.rotation for k, s in placed.station_of.items()}
    reading = read_angles(capture, planned, turn, _BOUND_DEG)
    if reading.as_recorded:
        return read_angles(capture, planned, turn, _BOUND_DEG, sound=True).capture, []
    if reading.convention:
        message = (
            f"the recorded angles are not as fieldkit reads them: {reading.convention}, says the plan of "
            f"{reading.compared} photographs"
        )
        return reading.capture, [finding_of("angles-read-otherwise", None, "", message, _NOTHING)]
    if reading.unused:
        message = (
            f"the recorded angles of {listed(list(reading.unused))} contradict the plan and are not used; no "
            "convention fits them all"
        )
        return reading.capture, [finding_of("angles-not-used", None, "", message, _NOTHING)]
    return reading.capture, []
