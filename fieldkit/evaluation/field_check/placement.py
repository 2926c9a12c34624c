"""Photographs' tags in the plan's frame, and which photograph is of which station.

What is common to all photographs is found and taken out: a receiver's offset of metres, the datum of heights, a
compass's error. What is left is the shape, which tells a photograph that is not where the others say it should be.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from fieldkit.captures import Capture
from fieldkit.evaluation.field_check.model import Placement
from fieldkit.geometry.angles import wrapped_deg
from fieldkit.missions.plan_site.placement import PlotFrame
from fieldkit.missions.plan_site.site import Site, SitePlot
from fieldkit.results.plan import Plan

REACH_M = 3.0
"""A photograph that is farther from a station, headings weighed in, does not belong to it."""
_METRES_PER_DEGREE = 1.0 / 30.0
"""Weight of the heading, as `fieldkit.captures.flight_logs.adherence` has it."""
_SHIFT_PRICE = 0.02
_BEST = 12
_ROUNDS = 4
_STEP_DEG = 4.0
_ALIKE_M = 0.15
_FITS_WELL_M = 0.2
_FAR_BETTER = 0.5
_LEAST = 3

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Tags:
    """What is written of n photographs.

    Attributes:
        names: of the photographs.
        positions: (n, 3) metres; NaN where nothing is known.
        yaws, pitches: (n,) degrees; NaN where nothing is known.
        sigma_m: of a position against the others'.
        sigma_deg: of the angles.
    """

    names: tuple[str, ...]
    positions: Array
    yaws: Array
    pitches: Array
    sigma_m: float
    sigma_deg: float

    def moved(self, turn_deg: float, shift: Array, compass_deg: float = 0.0) -> Tags:
        """Turned clockwise about z, then shifted; headings turn along, and by the compass's error besides."""
        c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
        rotation = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return replace(
            self, positions=self.positions @ rotation.T + shift, yaws=self.yaws + turn_deg + compass_deg
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Placed:
    """Photographs among the stations.

    Attributes:
        tags: in the plan's frame, without what is common to all.
        station_of: index of a photograph to its station.
        placement: how they were put there.
        shift_m: (3,) by which all photographs lay beside the plan; NaN where that cannot be told.
        turn_deg: by which all headings were off; None without headings.
        scatter_m: of positions about their stations, per axis (1.48 times the median).
        ambiguous: whether another assignment fits as well.
    """

    tags: Tags
    station_of: Mapping[int, int]
    placement: Placement
    shift_m: Array
    turn_deg: float | None
    scatter_m: float
    ambiguous: bool = False


def place_tags(capture: Capture, plan: Plan, site: Site | None = None, plot: SitePlot | None = None) -> Placed:
    """Put a capture's tags into the plan's frame and assign photographs to stations.

    Args:
        capture: as read; its positions from tags, sidecars or a flight log.
        plan: whose stations are looked for.
        site, plot: where the plan's frame lies; None fits by the plan's row heading, or by shape.
    """
    tags = _read_tags(capture)
    stations = Tags(
        tuple(str(k) for k in range(len(plan.stations))),
        np.array([s.position_m for s in plan.stations], dtype=np.float64),
        np.array([s.yaw_deg for s in plan.stations], dtype=np.float64),
        np.array([s.pitch_deg for s in plan.stations], dtype=np.float64), 0.0, 0.0,
    )  # fmt: skip
    known = np.isfinite(tags.positions).all(axis=1)
    if not known.any():
        return Placed(tags, {}, "none", np.full(3, np.nan), None, float("nan"))
    if capture.origin is None:
        return _upright(tags, stations, 0.0, "poses.csv") or _unplaced(tags)
    if site is not None and plot is not None:
        return _fitted(_in_plot(tags, capture, site, plot), stations, 0.0, "site") or _unplaced(tags)
    if plan.row_heading_deg is not None:
        found = _upright(tags, stations, 90.0 - plan.row_heading_deg, "row heading")
        return _unplaced(tags) if found is None else _without_shift(found)
    return _by_shape(tags, stations) or _unplaced(tags)


def _upright(tags: Tags, stations: Tags, turn_deg: float, placement: Placement) -> Placed | None:
    """Turned as it should be; by shape where that fits far better."""
    found = _fitted(tags, stations, turn_deg, placement)
    if found is not None and _mean_cost(found, stations) <= _FITS_WELL_M:
        return found
    shape = _by_shape(tags, stations)
    if found is None or shape is None:
        return shape or found
    return shape if _mean_cost(shape, stations) < _FAR_BETTER * _mean_cost(found, stations) else found


def _read_tags(capture: Capture) -> Tags:
    count = len(capture.photos)
    positions, yaws, pitches = np.full((count, 3), np.nan), np.full(count, np.nan), np.full(count, np.nan)
    sigmas, angles = [], []
    for k, name in enumerate(capture.names):
        prior = capture.priors.get(name)
        if prior is None:
            continue
        if prior.position is not None:
            positions[k] = prior.position
            sigmas.append(prior.position_accuracy_m or 0.0)
        if prior.yaw_deg is not None and prior.pitch_deg is not None:
            yaws[k], pitches[k] = prior.yaw_deg, prior.pitch_deg
            angles.append(prior.angle_accuracy_deg or 0.0)
    return Tags(
        capture.names, positions, yaws, pitches, float(np.median(sigmas)) if sigmas else 0.0,
        float(np.median(angles)) if angles else 0.0,
    )  # fmt: skip


def _in_plot(tags: Tags, capture: Capture, site: Site, plot: SitePlot) -> Tags:
    """Tags of a georeferenced capture in the frame of a site's plot; heights as well as home's is known."""
    assert capture.origin is not None
    frame = PlotFrame.of(site, plot)
    known = np.asarray(np.isfinite(tags.positions).all(axis=1))
    latitude, longitude, altitude = capture.origin.to_geodetic(np.where(known[:, None], tags.positions, 0.0))
    datums = {"ellipsoid": site.home.ellipsoid_m, "sea level": site.home.amsl_m}
    home = datums.get(capture.origin.datum)
    above = altitude - (capture.origin.altitude_m if home is None else home)
    positions = frame.to_plot(latitude, longitude, above)
    yaws = frame.yaws(latitude, longitude, np.nan_to_num(tags.yaws))
    pitches = frame.planned_pitches(yaws, np.nan_to_num(tags.pitches))
    return replace(
        tags, positions=np.where(known[:, None], positions, np.nan),
        yaws=np.where(np.isfinite(tags.yaws), yaws, np.nan),
        pitches=np.where(np.isfinite(tags.pitches), pitches, np.nan),
    )  # fmt: skip


def _fitted(tags: Tags, stations: Tags, turn_deg: float, placement: Placement, *, free: bool = False) -> Placed | None:
    """The shift, found by the pairs that suggest one, under which photographs fit the stations best."""
    turned = tags.moved(turn_deg, np.zeros(3))
    known = np.flatnonzero(np.isfinite(turned.positions).all(axis=1))
    shifts = (stations.positions[None] - turned.positions[known][:, None]).reshape(-1, 3)
    shifts = np.concatenate([np.zeros((1, 3)), shifts])
    prices = [
        np.minimum(_costs(turned.moved(0.0, shift), stations)[known].min(axis=1), REACH_M).mean()
        + _SHIFT_PRICE * float(np.linalg.norm(shift[:2]))
        for shift in shifts
    ]
    best: Placed | None = None
    for index in np.argsort(prices, kind="stable")[:_BEST]:
        found = _settled(tags, stations, turn_deg, shifts[index], placement, free=free)
        if found is not None and (best is None or _mean_cost(found, stations) < _mean_cost(best, stations) - 1e-9):
            best = found
    return best


def _settled(
    tags: Tags, stations: Tags, turn_deg: float, shift: Array, placement: Placement, *, free: bool
) -> Placed | None:
    """Assign, and take out what is common to the assigned, a few times."""
    compass = 0.0
    pairs: dict[int, int] = {}
    for _ in range(_ROUNDS):
        moved = tags.moved(turn_deg, shift, compass)
        pairs = assign(moved, stations)
        if not pairs:
            return None
        photos, places = np.array(list(pairs)), np.array(list(pairs.values()))
        if free and len(photos) >= _LEAST:
            turn_deg += _turn_between(moved.positions[photos], stations.positions[places])
        turned = tags.moved(turn_deg, np.zeros(3), compass)
        shift = np.median(stations.positions[places] - turned.positions[photos], axis=0)
        errors = wrapped_deg(stations.yaws[places] - turned.yaws[photos])
        errors = errors[np.isfinite(errors)]
        compass += float(np.median(errors)) if len(errors) >= _LEAST else 0.0
    moved = tags.moved(turn_deg, shift, compass)
    pairs = assign(moved, stations)
    if not pairs:
        return None
    apart = moved.positions[list(pairs)] - stations.positions[list(pairs.values())]
    scatter = 1.4826 * float(np.median(np.abs(apart)))
    headings = bool(np.isfinite(tags.yaws).any())
    return Placed(moved, pairs, placement, -shift, -compass if headings else None, scatter)


def assign(tags: Tags, stations: Tags) -> dict[int, int]:
    """Photographs to stations with the least sum of distances and headings; pairs beyond `REACH_M` are none."""
    costs = _costs(tags, stations)
    worth = np.where(np.isfinite(costs), np.minimum(costs - REACH_M, 0.0), 0.0)
    return {int(a): int(b) for a, b in zip(*linear_sum_assignment(worth), strict=True) if worth[a, b] < 0.0}


def _costs(tags: Tags, stations: Tags) -> Array:
    """(n, m) metres, headings weighed in; NaN for photographs without a position."""
    distance = np.linalg.norm(tags.positions[:, None] - stations.positions[None], axis=2)
    turn = wrapped_deg(tags.yaws[:, None] - stations.yaws[None])
    costs: Array = distance + np.abs(np.nan_to_num(turn)) * _METRES_PER_DEGREE
    return costs


def _mean_cost(found: Placed, stations: Tags) -> float:
    """Of all photographs with a position, those without a station at the reach."""
    costs = _costs(found.tags, stations)
    known = np.isfinite(costs).all(axis=1)
    fitting = sum(float(costs[a, b]) for a, b in found.station_of.items())
    return (fitting + REACH_M * (int(known.sum()) - len(found.station_of))) / max(int(known.sum()), 1)


def _by_shape(tags: Tags, stations: Tags) -> Placed | None:
    """Turned and shifted until it fits: headings say by how much to turn, or all turns are tried."""
    differences = (stations.yaws[None] - tags.yaws[:, None]).ravel()
    differences = differences[np.isfinite(differences)]
    turns = np.arange(0.0, 360.0, _STEP_DEG)
    if len(differences):
        # The right turn is suggested by one pair of every photograph.
        near = np.abs(wrapped_deg(turns[:, None] - differences[None])) <= 1.5 * _STEP_DEG
        turns = turns[np.argsort(-near.sum(axis=1), kind="stable")[:24]]
    known = np.isfinite(tags.positions).all(axis=1)
    middle = np.median(tags.positions[known], axis=0)
    centred = tags.moved(0.0, -middle)
    found = [each for turn in turns if (each := _fitted(centred, stations, float(turn), "shape", free=True))]
    if not found:
        return None
    found.sort(key=lambda each: _mean_cost(each, stations))
    best = found[0]
    others = [
        each for each in found[1:]
        if sum(each.station_of.get(a) != b for a, b in best.station_of.items()) > len(best.station_of) // 2
    ]  # fmt: skip
    alike = any(_mean_cost(each, stations) < _mean_cost(best, stations) + _ALIKE_M for each in others)
    return replace(_without_shift(best), ambiguous=alike, turn_deg=None)


def _turn_between(source: Array, target: Array) -> float:
    """Clockwise turn about z, degrees, that brings points (k, 3) nearest to others, shifts left out."""
    a, b = (p[:, :2] - np.median(p[:, :2], axis=0) for p in (source, target))
    return float(np.degrees(np.arctan2((a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]).sum(), (a * b).sum())))


def _without_shift(found: Placed) -> Placed:
    return replace(found, shift_m=np.full(3, np.nan))


def _unplaced(tags: Tags) -> Placed:
    return Placed(tags, {}, "none", np.full(3, np.nan), None, float("nan"))


def axis_turn_deg(yaw_a: float, pitch_a: float, yaw_b: float, pitch_b: float) -> float:
    """Angle between two optical axes, degrees."""
    a, b = (_axis(*angles) for angles in ((yaw_a, pitch_a), (yaw_b, pitch_b)))
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _axis(yaw_deg: float, pitch_deg: float) -> Array:
    yaw, pitch = np.radians([yaw_deg, pitch_deg])
    return np.array([np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)])


def costs_to_stations(placed: Placed, plan: Plan) -> dict[int, float]:
    """Metres, headings weighed in, from photographs to the stations that they are assigned to."""
    costs = {}
    for k, s in placed.station_of.items():
        station, yaw = plan.stations[s], float(placed.tags.yaws[k])
        turn = abs(wrapped_deg(yaw - station.yaw_deg)) if np.isfinite(yaw) else 0.0
        distance = float(np.linalg.norm(placed.tags.positions[k] - np.array(station.position_m)))
        costs[k] = distance + turn * _METRES_PER_DEGREE
    return costs
