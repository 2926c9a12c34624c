"""Missions of passes: a pattern's lines over a field, written and read back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.errors import MissionError, UsageError
from fieldkit.geometry.pose import rotation_about_z, wrapped_deg
from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.export_mission import export_mission
from fieldkit.missions.files.formats import read_mission
from fieldkit.missions.items import Command
from fieldkit.missions.settings import MissionSettings
from fieldkit.results.mission import Home, load_mission
from fieldkit.results.pattern import Look, Pattern
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import save_plan
from fieldkit.scenes.plot_description import TrialDescription
from fieldkit.sites.placement import SiteFrame
from fieldkit.sites.site import Site, SitePlot
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit_sim.surveys import pattern_over
from fieldkit_sim.trial.files import new_trial

PATTERN = Pattern((Look(0.0, -60.0), Look(180.0, -60.0)), 8.0, 2.1, 2.2)
FORMS = [
    ("ardupilot-pitch", "plan"),
    ("px4-gimbal", "plan"),
    ("dji-mavic-3-enterprise", "wpml"),
    ("dji-mini-4-pro", "litchi"),
]


def field(ranges: int = 2, columns: int = 5, slope_percent: float = 0.0, height_m: float = 1.8) -> Site:
    """Plots of 4 × 1.5 m with rows to the north, some 20 m north of home."""
    home = Home(48.1, 11.5, 450.0)
    places = np.array([(1.5 * c, 20.0 + 5.0 * r, 0.0) for r in range(ranges) for c in range(columns)])
    latitudes, longitudes, _ = SiteFrame(home).to_geodetic(places)
    plots = [
        SitePlot(
            name=f"{k + 1}",
            latitude_deg=latitude,
            longitude_deg=longitude,
            height_m=0.01 * slope_percent * float(north - 20.0),
            datum="home",
            row_heading_deg=0.0,
            slope_percent=slope_percent,
            uphill_heading_deg=0.0,
            length_m=4.0,
            width_m=1.5,
            plant_height_m=height_m,
        )
        for k, (latitude, longitude, north) in enumerate(
            zip(latitudes.tolist(), longitudes.tolist(), places[:, 1].tolist(), strict=True)
        )
    ]
    return Site(home=home, plots=tuple(plots))


def exported(tmp_path: Path, site: Site, vehicle: str = "ardupilot-pitch", form: str = "plan", plan=None, **more):
    plan = Plan(fieldkit="0", pattern=PATTERN) if plan is None else plan
    done = export_mission(
        plan, vehicle, site, tmp_path / "mission", MissionSettings(format=form, **more), picture=False, overwrite=True
    )
    return done, load_mission(tmp_path / "mission.json")


@pytest.mark.parametrize(("vehicle", "form"), FORMS)
def test_photographs_are_taken_on_lines_and_nowhere_else(tmp_path, vehicle, form):
    done, record = exported(tmp_path, field(), vehicle, form)
    lines = {shot.line for flight in record.flights for shot in flight.passings}
    assert lines == set(range(len(lines)))
    read = read_mission(done.files[0])
    assert not read.refused
    if not read.items:
        assert sum(len(stop.onwards) for stop in read.stops) == len(lines)
        return
    starts = {Command.DO_SET_CAM_TRIGG_DIST: 0, Command.IMAGE_START_CAPTURE: 1}
    on, switched = False, 0
    for item in read.items:
        if item.command in (*starts, Command.IMAGE_STOP_CAPTURE):
            before, on = on, item.params[starts.get(item.command, 0)] > 0.0
            assert on != before
            switched += on
        elif item.command == Command.NAV_LAND:
            assert not on
    assert switched == len(lines)


def test_heights_follow_the_ground_in_few_waypoints(tmp_path):
    site = field(ranges=6, slope_percent=8.0)
    done, record = exported(tmp_path, site)
    for shot in record.flights[0].passings:
        north = SiteFrame(site.home).points([shot.place])[0, 1]
        ground = 0.08 * (north - 20.0)
        assert abs(north - 32.5) > 20.0 or shot.height_m - ground == pytest.approx(8.0, abs=0.25)
    waypoints = [item for item in read_mission(done.files[0]).items if item.command == Command.NAV_WAYPOINT]
    assert len(waypoints) < 5 * len({shot.line for shot in record.flights[0].passings})


def test_the_same_lines_are_flown_again_from_anywhere(tmp_path):
    done, first = exported(tmp_path / "first", field())
    site = field()
    elsewhere = site.model_copy(update={"home": Home(48.1003, 11.4998, 450.0), "plots": site.plots[:3]})
    more, again = exported(tmp_path / "again", elsewhere, plan=tmp_path / "first" / "mission.json", lines=[2, 4])
    assert again.passes == first.passes
    assert {shot.line for shot in again.flights[0].passings} == {1, 3}
    before = [shot for shot in done.routed.flights[0].mission.passings if shot.line in (1, 3)]
    frame = SiteFrame(site.home)
    there, here = (
        frame.points([s.place for s in shots]) for shots in (before, more.routed.flights[0].mission.passings)
    )
    assert there[:, :2] == pytest.approx(here[:, :2], abs=0.002)
    with pytest.raises(UsageError, match="no such line: 99"):
        exported(tmp_path / "no", elsewhere, plan=tmp_path / "first" / "mission.json", lines=[99])


def test_passes_too_low_over_plants_or_out_of_reach_are_refused(tmp_path):
    with pytest.raises(MissionError, match="plants"):
        exported(tmp_path, field(height_m=7.8))
    flat = Plan(fieldkit="0", pattern=Pattern((Look(0.0, 40.0),), 8.0, 2.1, 2.2))
    with pytest.raises(MissionError, match="beyond the mount"):
        exported(tmp_path, field(), plan=flat)


def test_flights_are_split_between_lines(tmp_path):
    done, record = exported(tmp_path, field(8, 40))
    assert len(record.flights) > 1
    assert all(each.flight.time.battery <= 1.0 for each in done.routed.flights)
    of_flights = [sorted({shot.line for shot in flight.passings}) for flight in record.flights]
    assert [line for lines in of_flights for line in lines] == list(range(of_flights[-1][-1] + 1))
    ring = shapely.Polygon(record.passes.outline)
    assert ring.contains(shapely.Point(48.1003, 11.5002))


def test_a_vehicle_that_cannot_shoot_in_passing_stops_for_every_photograph(tmp_path):
    vehicle = load_vehicle("ardupilot-pitch")
    trigger = vehicle.trigger.model_copy(update={"passing": "never"})
    moving, _ = exported(tmp_path, field())
    done, record = exported(tmp_path, field(), vehicle.model_copy(update={"trigger": trigger}))
    assert not any(flight.passings for flight in record.flights)
    places = [shot.place for flight in record.flights for shot in flight.shots]
    assert places == [shot.place for each in moving.routed.flights for shot in each.mission.passings]
    assert record.flights[0].shots[0].plot == "1"
    assert all(each.flight.time.battery <= 1.0 for each in done.routed.flights)


def test_a_plan_of_a_pattern_is_read_from_its_file(tmp_path):
    save_plan(tmp_path / "plan.json", Plan(fieldkit="0", pattern=PATTERN))
    _, record = exported(tmp_path, field(), plan=tmp_path / "plan.json")
    assert record.plots[0].plan.name == "plan.json"


@given(
    looks=st.lists(st.tuples(st.floats(0.0, 359.0), st.floats(-90.0, -45.0)), min_size=1, max_size=3),
    height=st.floats(5.0, 15.0),
    along=st.floats(0.8, 3.0),
    between=st.floats(1.5, 5.0),
    offset=st.floats(0.0, 1.0),
    speed=st.floats(0.3, 5.0),
    slope=st.sampled_from([0.0, 6.0]),
)
@settings(max_examples=12, deadline=None)
@pytest.mark.parametrize(("vehicle", "form"), FORMS)
def test_every_photograph_is_foretold_and_where_the_pattern_wants_one(
    tmp_path_factory, vehicle, form, looks, height, along, between, offset, speed, slope
):
    pattern = Pattern(tuple(Look(*look) for look in looks), height, along, between, offset, speed)
    folder, site, profile = tmp_path_factory.mktemp("passes"), field(slope_percent=slope), load_vehicle(vehicle)
    done, record = exported(folder, site, vehicle, form, plan=Plan(fieldkit="0", pattern=pattern))
    frame = SiteFrame(site.home)
    poses = {(look.heading_deg % 360.0, look.pitch_deg) for look in pattern.looks}
    for flight, file, routed in zip(record.flights, done.files, done.routed.flights, strict=False):
        flown = interpret(replace(read_mission(file), home=site.home), profile, profile.dialect)
        taken = [shot for shot in flown.photographs if not shot.never]
        foretold, planned = flight.passings, routed.mission.passings
        assert [shot.time_s for shot in foretold] == pytest.approx([shot.time_s for shot in taken], abs=0.1)
        there = frame.points([shot.place for shot in foretold])
        assert np.abs(there - frame.points([shot.place for shot in taken])).max() < 0.05
        assert all(
            min(abs(wrapped_deg(shot.yaw_deg - yaw)) + abs(shot.pitch_deg - pitch) for yaw, pitch in poses) < 0.02
            for shot in foretold
        )
        for line in {shot.line for shot in planned}:
            wanted, given_ = (
                frame.points([shot.place for shot in shots if shot.line == line]) for shots in (planned, foretold)
            )
            apart = np.linalg.norm(wanted[:, None] - given_, axis=2)
            assert apart.min(axis=1).max() < 0.5 * along + 0.25
            assert apart.min(axis=0).max() < along + 0.25


@given(
    heading=st.floats(0.0, 359.0),
    along=st.floats(0.5, 1.5),
    between=st.floats(1.0, 4.0),
    offset=st.floats(0.0, 1.0),
    speed=st.floats(0.3, 5.0),
)
@settings(max_examples=3, deadline=None)
@pytest.mark.parametrize(("vehicle", "form"), FORMS[:3])
def test_long_lines_to_and_fro_lose_no_photograph(
    tmp_path_factory, vehicle, form, heading, along, between, offset, speed
):
    """None where a turn is not over in time, and none by distances that are noticed late, or written rounded."""
    pattern = Pattern(
        (Look(heading, -80.0), Look((heading + 180.0) % 360.0, -60.0)), 9.0, along, between, offset, speed
    )
    profile, site = load_vehicle(vehicle), field(1, 20)
    profile = profile.model_copy(update={"trigger": profile.trigger.model_copy(update={"passing": "distance"})})
    done, record = exported(
        tmp_path_factory.mktemp("long"), site, profile, form, plan=Plan(fieldkit="0", pattern=pattern)
    )
    frame = SiteFrame(site.home)
    for routed, flight in zip(done.routed.flights, record.flights, strict=True):
        planned = routed.mission.passings
        for line in {shot.line for shot in planned}:
            wanted, taken = (
                frame.points([shot.place for shot in shots if shot.line == line])
                for shots in (planned, flight.passings)
            )
            assert 0 <= len(taken) - len(wanted) <= 1
            assert np.linalg.norm(wanted - taken[: len(wanted)], axis=1).max() < 0.4


@pytest.mark.parametrize("heading_deg", [0.0, 90.0001, 250.0])
def test_a_simulated_flight_takes_the_photographs_that_its_mission_foresees(tmp_path, heading_deg):
    scene = replace(new_trial(TrialDescription(ranges=2, columns=3)), row_heading_deg=heading_deg)
    home, (length_m, width_m) = Home(52.2955, 10.437, 81.0), scene.plot.trial.size_m
    plot = {"latitude_deg": 52.296, "longitude_deg": 10.437, "height_m": 0.0, "datum": "home", "plant_height_m": 1.2}
    block = SitePlot(name="b", row_heading_deg=heading_deg, length_m=length_m, width_m=width_m, **plot)
    pattern = Pattern((Look(30.0, -60.0),), 8.0, 2.1, 2.2)
    _, record = exported(tmp_path, Site(home=home, plots=(block,)), plan=Plan(fieldkit="0", pattern=pattern))
    shots = record.flights[0].passings
    poses = pattern_over(pattern, scene)
    turned = np.array([pose.center for pose in poses]) @ rotation_about_z(np.radians(90.0 - heading_deg)).T
    level = SiteFrame(Home(52.296, 10.437, 81.0)).points([shot.place for shot in shots])
    away = np.linalg.norm(level[:, None, :2] - turned[None, :, :2], axis=2)
    assert len(poses) == len(shots)
    assert max(away.min(axis=0).max(), away.min(axis=1).max()) < 0.6 * pattern.along_m
