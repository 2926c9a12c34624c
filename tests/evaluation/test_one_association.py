"""Which photograph is which station: flight logs, evaluations, field checks and mission checks say the same."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.evaluation.adherence import kept
from fieldkit.fieldcheck.placement import place_tags
from fieldkit.flightlogs import Gimbal, Place, Trigger
from fieldkit.flightlogs.adherence import PlannedPose, PoseRow, adherence
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.stations import MOST_OFFSET_M, PoseArray, associate
from fieldkit.missions.autopilots.execution import Photograph
from fieldkit.missions.check_photographs import deviations
from fieldkit.results.evaluation import AdherenceEntry
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.routing.mission import GeoPoint, Home, Shot
from fieldkit.sites.site import Site, SiteHome, SitePlot
from tests.fieldcheck.test_field_check import capture_of

FRAME = LocalFrame(52.3, 10.4, 81.0, "ellipsoid")
HOME = Home(52.3, 10.4, 81.0)

Pairs = dict[int, int]


def grid(columns: int, rows: int, step: float = 1.0) -> PoseArray:
    """With one heading."""
    x, y = (each.ravel() * step for each in np.meshgrid(np.arange(columns), np.arange(rows)))
    count = columns * rows
    return PoseArray(np.stack([x, y, np.full(count, 1.6)], axis=1), np.full(count, 90.0), np.full(count, -60.0))


def ring(count: int, radius: float = 1.4) -> PoseArray:
    angle = 2.0 * np.pi * np.arange(count) / count
    positions = np.stack([radius * np.sin(angle), radius * np.cos(angle), np.full(count, 1.3)], axis=1)
    return PoseArray(positions, (np.degrees(angle) + 180.0) % 360.0, np.full(count, -35.0))


@dataclass(frozen=True, eq=False)
class Flight:
    """Stations, the photographs that were taken at them, and whose station each truly is."""

    stations: PoseArray
    photographs: PoseArray
    true: Pairs


def flown(stations: PoseArray, chosen: list[int], offset: np.ndarray, noise_m: float, seed: int) -> Flight:
    rng = np.random.default_rng(seed)
    order = rng.permutation(chosen)
    there = stations[order]
    photographs = PoseArray(
        there.positions + offset + rng.normal(0.0, noise_m, (len(order), 3)),
        (there.yaws + rng.normal(0.0, 0.5, len(order))) % 360.0,
        there.pitches + rng.normal(0.0, 0.3, len(order)),
    )
    return Flight(stations, photographs, dict(enumerate(order.tolist())))


def by_log(flight: Flight) -> AdherenceEntry:
    latitude, longitude, _ = FRAME.to_geodetic(flight.stations.positions)
    planned = [
        PlannedPose(str(k), float(latitude[k]), float(longitude[k]), float(p[2]), float(yaw), float(pitch))
        for k, (p, yaw, pitch) in enumerate(
            zip(flight.stations.positions, flight.stations.yaws, flight.stations.pitches, strict=True)
        )
    ]
    latitude, longitude, _ = FRAME.to_geodetic(flight.photographs.positions)
    triggers = [
        Trigger(
            float(k),
            None,
            k,
            Place(float(latitude[k]), float(longitude[k]), None, float(p[2])),
            None,
            Gimbal(0.0, float(pitch), float(yaw), "north", "reported"),
            0.0,
            None,
            "CAMERA_FEEDBACK",
        )
        for k, (p, yaw, pitch) in enumerate(
            zip(flight.photographs.positions, flight.photographs.yaws, flight.photographs.pitches, strict=True)
        )
    ]
    return adherence(planned, triggers, [str(k) for k in range(len(triggers))])


def rows(poses: PoseArray) -> dict[str, PoseRow]:
    values = zip(poses.positions.tolist(), poses.yaws.tolist(), poses.pitches.tolist(), strict=True)
    return {str(k): (tuple(position), yaw, pitch) for k, (position, yaw, pitch) in enumerate(values)}


def by_evaluation(flight: Flight) -> Pairs:
    names = [str(k) for k in range(len(flight.photographs))]
    found = kept(names, rows(flight.stations), {"tagged": rows(flight.photographs)}, np.eye(3))
    return {} if found is None else {int(error.image): int(error.station) for error in found.stations}


def cameras(poses: PoseArray) -> list[Pose]:
    return [
        Pose.from_yaw_pitch(p, float(yaw), float(pitch))
        for p, yaw, pitch in zip(poses.positions, poses.yaws, poses.pitches, strict=True)
    ]


def by_field_check(flight: Flight) -> Pairs:
    site = Site(
        home=SiteHome(latitude_deg=52.3, longitude_deg=10.4, ellipsoid_m=81.0),
        plots=(SitePlot(latitude_deg=52.3, longitude_deg=10.4),),
    )
    capture = capture_of(list(cameras(flight.photographs)), FRAME)
    return dict(place_tags(capture, plan_from_poses(cameras(flight.stations)), site, site.plots[0]).station_of)


def by_mission_check(flight: Flight) -> Pairs:
    def places(poses: PoseArray) -> list[GeoPoint]:
        latitude, longitude, height = FRAME.to_geodetic(poses.positions)
        return [
            GeoPoint(float(a), float(b), float(h) - 81.0) for a, b, h in zip(latitude, longitude, height, strict=True)
        ]

    planned = [
        Shot.at(place, float(flight.stations.yaws[k]), float(flight.stations.pitches[k]), "p", k)
        for k, place in enumerate(places(flight.stations))
    ]
    taken = [
        Photograph(k, k, place, float(flight.photographs.yaws[k]), float(flight.photographs.pitches[k]), k)
        for k, place in enumerate(places(flight.photographs))
    ]
    names = [shot.name for shot in planned]
    return {found.photograph: names.index(found.planned.name) for found in deviations(taken, planned, HOME)}


def offset_of(size: float, towards: float, up: float) -> np.ndarray:
    angle = np.radians(towards)
    return np.array([size * np.sin(angle), size * np.cos(angle), up])


@given(
    layout=st.sampled_from(["grid 4×3", "grid 5×2", "ring 9", "ring 13"]),
    size=st.one_of(st.sampled_from([0.0, 0.5, 1.0, 1.5, MOST_OFFSET_M - 0.1]), st.floats(0.0, MOST_OFFSET_M - 0.1)),
    towards=st.floats(0.0, 360.0),
    up=st.floats(-30.0, 30.0),
    missing=st.integers(0, 3),
    twice=st.integers(0, 3),
    seed=st.integers(0, 10_000),
)
def test_all_four_give_the_same_pairs(layout, size, towards, up, missing, twice, seed) -> None:
    """Corners of a grid are always photographed: without an edge it may lie in more than one way."""
    kind, shape = layout.split()
    stations = ring(int(shape)) if kind == "ring" else grid(*(int(n) for n in shape.split("×")))
    rng = np.random.default_rng(seed)
    extent = stations.positions[:, :2]
    corners = (np.isin(extent[:, 0], (0.0, extent[:, 0].max())) & np.isin(extent[:, 1], (0.0, extent[:, 1].max()))) & (
        kind == "grid"
    )
    gone = rng.permutation(np.flatnonzero(~corners))[:missing]
    kept = [k for k in range(len(stations)) if k not in gone]
    kept += rng.choice(kept, twice, replace=False).tolist()
    flight = flown(stations, kept, offset_of(size, towards, up), 0.01, seed)
    log = by_log(flight)
    pairs = {int(error.image): int(error.station) for error in log.stations}
    assert by_evaluation(flight) == pairs
    assert by_field_check(flight) == pairs
    common = associate(flight.photographs, flight.stations)
    offset = common.offset_m
    checked = by_mission_check(
        Flight(stations, flight.photographs.moved(0.0, -offset, -common.heading_deg), flight.true)
    )
    assert pairs.items() <= checked.items()
    if not (missing and twice):  # else a second photograph may stand in for a missing neighbour's
        assert checked == pairs
        assert offset == pytest.approx(offset_of(size, towards, up), abs=0.05)
        assert all(flight.true[a] == b for a, b in pairs.items())
        assert set(pairs.values()) == set(kept)
    # What all have in common is an error of each.
    assert np.median([e.east_m for e in log.stations]) == pytest.approx(offset[0], abs=0.02)
    assert np.median([e.north_m for e in log.stations]) == pytest.approx(offset[1], abs=0.02)


def test_a_grid_with_one_heading_and_a_receiver_that_is_off() -> None:
    flight = flown(grid(4, 3), list(range(12)), np.array([1.5, 0.5, 0.0]), 0.0, 1)
    found = by_log(flight)
    assert not found.missing
    assert not found.extra
    for error in found.stations:
        assert flight.true[int(error.image)] == int(error.station)
        assert (error.east_m, error.north_m) == pytest.approx((1.5, 0.5), abs=1e-4)


def test_without_heights_headings_or_places() -> None:
    """What a log does not say of one photograph does not move the others."""
    flight = flown(grid(4, 3), list(range(12)), np.array([1.5, 0.5, 0.0]), 0.01, 2)
    positions, yaws = flight.photographs.positions.copy(), flight.photographs.yaws.copy()
    positions[:6, 2], yaws[3:] = np.nan, np.nan
    positions[11] = np.nan
    found = associate(PoseArray(positions, yaws, np.full(12, np.nan)), flight.stations)
    assert found.station_of == {a: b for a, b in flight.true.items() if a != 11}
    assert associate(PoseArray(np.full((3, 3), np.nan), yaws[:3], yaws[:3]), flight.stations).station_of == {}


def test_beyond_the_limit_it_is_another_plot() -> None:
    flight = flown(grid(4, 3), list(range(12)), np.array([MOST_OFFSET_M + 4.0, 0.0, 0.0]), 0.0, 3)
    assert {int(e.image): int(e.station) for e in by_log(flight).stations} != flight.true
    assert by_evaluation(flight) != flight.true
    assert by_field_check(flight) == flight.true  # there the user has said of which plot the photographs are


def test_a_photograph_that_looks_elsewhere_is_of_the_station_at_its_place() -> None:
    """A mission's heading may be any: the check says by how much it is off."""
    flight = flown(grid(4, 3), list(range(12)), np.zeros(3), 0.0, 4)
    yaws = flight.photographs.yaws.copy()
    yaws[5] += 170.0
    turned = Flight(flight.stations, PoseArray(flight.photographs.positions, yaws, flight.photographs.pitches), {})
    assert by_mission_check(turned) == flight.true
