"""From a plan to mission files, and back."""

import json
from pathlib import Path

import numpy as np
import pytest

from fieldkit.errors import UsageError
from fieldkit.missions.check import Surroundings, check_mission
from fieldkit.missions.export import route_plan
from fieldkit.missions.export_mission import export_mission
from fieldkit.missions.files.formats import read_mission
from fieldkit.missions.settings import MissionSettings
from fieldkit.results.mission import load_mission
from fieldkit.results.plan import Plan, PlanPlants, Station
from fieldkit.routing.mission import Shot
from fieldkit.sites.plot_plants import with_plant_height
from fieldkit.sites.site import Site
from fieldkit.sites.site_file import load_site
from fieldkit.sites.site_obstacles import site_obstacles
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit_sim.simulation import ring

SITES = Path(__file__).parents[2] / "missions" / "sites"
VEHICLE = load_vehicle("ardupilot-pitch")


HEIGHT_M = 0.85
"""Of the plots' plants: no more than those of `planned`, so that these stay as they are."""
LOW_M = 0.3
"""Of plants beside those of `planned`, where plots reach farther: its stations stand clear of them."""


def site(plots: Path | None = None, height_m: float = HEIGHT_M) -> Site:
    return with_plant_height(load_site(SITES / "example.toml", plots), None, height_m)


def planned(count: int = 7, *, height_m: float = 1.2, plants: bool = True) -> Plan:
    stations = []
    for pose in ring(count, 1.3, height_m):
        yaw, pitch, _ = pose.yaw_pitch_roll_deg()
        x, y, z = (float(v) for v in pose.center)
        stations.append(Station(position_m=(x, y, z), yaw_deg=yaw, pitch_deg=pitch))
    rng = np.random.default_rng(0)
    points = rng.uniform((-0.3, -0.3, 0.0), (0.3, 0.3, 0.9), (200, 3)).round(3)
    kept = PlanPlants(points_m=tuple((x, y, z) for x, y, z in points.tolist()), cell_m=0.05) if plants else None
    return Plan(fieldkit="0", stations=tuple(stations), plants=kept)


@pytest.mark.parametrize(
    ("vehicle", "form", "suffix"),
    [
        ("ardupilot-pitch", "plan", ".plan"),
        ("ardupilot-pan", "plan", ".plan"),
        ("px4-gimbal", "waypoints", ".waypoints"),
        ("dji-mavic-3-enterprise", "wpml", ".kmz"),
        ("dji-mini-4-pro", "litchi", ".csv"),
    ],
)
def test_what_is_written_passes_its_check_against_the_plan(tmp_path, vehicle, form, suffix) -> None:
    plan, profile = planned(height_m=2.0, plants=False), load_vehicle(vehicle)
    slope = {"slope_percent": 12.0, "uphill_heading_deg": 310.0, "row_heading_deg": 75.0}
    field = site().with_each(lambda plot: plot.model_copy(update=slope))
    done = export_mission(
        plan, vehicle, field, tmp_path / "mission", MissionSettings(format=form, adjust=True), picture=False
    )
    assert [file.name for file in done.files] == [f"mission{suffix}", "mission.json", "mission.geojson"]
    read = read_mission(done.files[0])
    shots = tuple(stop for each in done.routed.flights for stop in each.mission.stops if isinstance(stop, Shot))
    report = check_mission(
        read,
        profile,
        Surroundings(planned=shots, obstacles=site_obstacles(field, profile.clearance_m, plan), origin=field.home),
    )
    assert {finding.code for finding in report.findings} == ({"heading-mode"} if form == "litchi" else set())
    off = [(pose.metres, abs(pose.heading_deg or 0.0), abs(pose.pitch_deg or 0.0)) for pose in report.deviations]
    assert len(report.taken) == len(off) == len(plan.stations)
    assert all(metres < 0.010 and max(turns) < 0.01 for metres, *turns in off)
    # One duration, in the export's words, in its record, and in the check's.
    assert done.routed.time_s == pytest.approx(report.seconds)
    assert done.routed.length_m == pytest.approx(report.length_m)
    assert load_mission(done.files[1]).flights[0].length_m == pytest.approx(report.length_m)
    assert load_mission(done.files[1]).flights[0].time_s == pytest.approx(report.seconds)
    assert done.routed.flights[0].flight.time.battery == pytest.approx(report.seconds / profile.battery.usable_s)


@pytest.mark.parametrize(
    ("vehicle", "form", "interval_s"),
    [
        ("ardupilot-pitch", "plan", 1.0),
        ("px4-gimbal", "plan", 1.5),
        ("dji-mavic-3-enterprise", "wpml", 1.0),
        ("dji-mini-4-pro", "litchi", 1.0),
    ],
)
def test_bursts_stand_still_where_the_plan_says(tmp_path: Path, vehicle: str, form: str, interval_s: float) -> None:
    plan, field, profile = planned(height_m=2.0, plants=False), site(), load_vehicle(vehicle)
    exported = {
        burst: export_mission(
            plan,
            vehicle,
            field,
            tmp_path / f"m{burst}",
            MissionSettings(format=form, adjust=True, burst=burst),
            picture=False,
        )
        for burst in (1, 3)
    }
    done = exported[3]
    (each,) = done.routed.flights
    report = check_mission(
        read_mission(done.files[0]), profile, Surroundings(planned=each.mission.shots, origin=field.home)
    )
    assert report.ok, report.findings
    assert not {f.code for f in report.findings} - {"heading-mode"}
    assert (len(report.taken), report.burst, done.routed.stations, done.routed.photographs) == (21, 3, 7, 21)
    # Three at each station in turn, with its pose, one interval apart.
    assert [found.planned for found in report.deviations] == [shot for shot in each.mission.shots for _ in range(3)]
    assert max(found.metres for found in report.deviations) < 0.01
    for first in range(0, 21, 3):
        stands = [shot.after_s for shot in report.taken[first : first + 3]]
        assert np.diff(stands) == pytest.approx([-interval_s] * 2)
        assert stands[-1] == pytest.approx(profile.trigger.exposure_s)
    assert done.routed.bursts_s == pytest.approx(7 * 2 * interval_s)
    assert done.routed.time_s == pytest.approx(exported[1].routed.time_s + done.routed.bursts_s)
    (flight,) = load_mission(done.files[1]).flights
    assert flight.burst is not None
    assert (flight.burst.photographs, flight.burst.interval_s, flight.photographs) == (3, interval_s, 21)
    assert "burst" not in exported[1].files[1].read_text()


def test_a_station_that_lost_photographs_is_named(tmp_path: Path) -> None:
    field, file = site(), tmp_path / "m.plan"
    done = export_mission(planned(), VEHICLE, field, file, MissionSettings(burst=4), picture=False)
    document = json.loads(file.read_text())
    items = document["mission"]["items"]
    shutters = [k for k, item in enumerate(items) if item["command"] == 2000]
    del items[shutters[13] : shutters[13] + 2]
    file.write_text(json.dumps(document))
    shots = done.routed.flights[0].mission.shots
    report = check_mission(read_mission(file), VEHICLE, Surroundings(planned=shots, origin=field.home))
    assert report.ok
    (short,) = (each for each in report.findings if each.code == "short-burst")
    assert short.message == f"{shots[3].name} has 3 of 4 photographs"
    assert (short.station, short.photograph) == (shots[3].station, 12)


@pytest.mark.parametrize(
    ("vehicle", "form", "burst", "flights"),
    [
        ("ardupilot-pitch", "plan", 1, 1),
        ("ardupilot-pitch", "plan", 5, 2),
        ("dji-mini-4-pro", "litchi", 1, 2),
    ],
)
def test_files_hold_what_vehicle_and_app_take(
    tmp_path: Path, vehicle: str, form: str, burst: int, flights: int
) -> None:
    field = site(SITES / "plots.geojson", LOW_M)
    flown_by = load_vehicle(vehicle).model_copy(update={"max_items": 300 if form == "plan" else None})
    plan = planned(5 if form == "plan" else 13, height_m=3.0)
    done = export_mission(
        plan, flown_by, field, tmp_path / "m", MissionSettings(format=form, burst=burst, adjust=True), picture=False
    )
    assert len(done.routed.flights) == flights
    for file, each in zip(done.files, done.routed.flights, strict=False):
        read = read_mission(file)
        assert (len(read.items) < 300) if read.items else (len(read.stops) <= 99)
        assert each.flight.time.battery < 1.0


def test_some_plots_are_flown_and_the_others_stay_in_the_way(tmp_path: Path) -> None:
    field = site(SITES / "plots.geojson", LOW_M)
    names = [plot.name for plot in field.plots]
    done = export_mission(
        planned(5), VEHICLE, field, tmp_path / "m", MissionSettings(only=[names[5], names[1]]), picture=False
    )
    record = load_mission(tmp_path / "m.mission.json")
    assert sorted(record.flights[0].plots) == sorted([names[1], names[5]])
    assert {plot.name for plot in record.neighbours} == set(names) - {names[1], names[5]}
    assert set(done.routed.clear_m) == set(names)
    with pytest.raises(UsageError, match=f"no plot {names[1]}x or 9") as caught:
        export_mission(planned(5), VEHICLE, field, tmp_path / "n", MissionSettings(only=[f"{names[1]}x", "9"]))
    assert caught.value.remedy.startswith(f"Is {names[1]} meant?")


def test_no_file_takes_more_than_a_battery(tmp_path: Path) -> None:
    """Also where a flight as planned would just do, and holds in whole seconds are too much."""
    flown_by = VEHICLE.model_copy(update={"trigger": VEHICLE.trigger.model_copy(update={"settle_s": 3.05})})
    field = site(SITES / "plots.geojson", LOW_M)
    planned_s = route_plan(planned(5), flown_by, field).time_s
    tired = {"endurance_s": 1.001 * planned_s / (1.0 - flown_by.battery.reserve)}
    flown_by = flown_by.model_copy(update={"battery": flown_by.battery.model_copy(update=tired)})
    assert len(route_plan(planned(5), flown_by, field).flights) == 1
    done = export_mission(planned(5), flown_by, field, tmp_path / "m", picture=False)
    assert len(done.routed.flights) == 2
    for file, each in zip(done.files, done.routed.flights, strict=False):
        report = check_mission(read_mission(file), flown_by)
        assert "endurance" not in {finding.code for finding in report.findings}
        assert each.flight.time.total_s == pytest.approx(report.seconds)


def test_many_plots_take_several_flights_in_numbered_files(tmp_path: Path) -> None:
    vehicle = VEHICLE.model_copy(update={"battery": VEHICLE.battery.model_copy(update={"endurance_s": 320.0})})
    done = export_mission(
        planned(5),
        vehicle,
        SITES / "example.toml",
        tmp_path / "field.plan",
        MissionSettings(plant_height=LOW_M),
        plots=SITES / "plots.geojson",
    )
    plots = [plot for each in done.routed.flights for plot in each.flight.plots]
    assert len(done.routed.flights) > 1
    assert len(plots) == len(set(plots)) > 1
    assert done.routed.photographs == 5 * len(plots)
    assert all(each.flight.time.battery <= 1.0 for each in done.routed.flights)
    assert [file.name for file in done.files[:2]] == ["field-1.plan", "field-2.plan"]
    assert done.files[-1].read_bytes()[:4] == b"\x89PNG"
    names = {each.mission.name for each in done.routed.flights}
    assert len(names) == len(done.routed.flights)


def test_files_are_kept_and_wrong_names_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "m.plan"
    file.write_text("mine")
    with pytest.raises(UsageError, match="exists already"):
        export_mission(planned(), VEHICLE, site(), file, picture=False)
    assert file.read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.plan"]
    export_mission(planned(), VEHICLE, site(), file, picture=False, overwrite=True)
    assert len(read_mission(file).items) > 20
    with pytest.raises(UsageError, match=r"waypoints missions are \.waypoints files"):
        export_mission(planned(), VEHICLE, site(), file, MissionSettings(format="waypoints"))
    with pytest.raises(UsageError, match="no such format"):
        export_mission(planned(), VEHICLE, site(), file, MissionSettings(format="gpx"))
