"""Plans fitted to plots of higher, lower, larger and smaller plants."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.errors import MissionError
from fieldkit.missions.export_mission import export_mission
from fieldkit.missions.settings import MissionSettings
from fieldkit.results.plan import Plan, PlanEnvelope, PlanPlants
from fieldkit.results.plan_file import load_plan
from fieldkit.sites.fitted import fitted, fitted_to, fitted_to_height, flown_plans
from fieldkit.sites.plot_plants import BAND_M, Band, PlanFacts, no_fly_bands
from fieldkit.sites.site import SitePlot
from fieldkit.vehicles.vehicle_file import load_vehicle
from tests.missions.test_export import planned
from tests.sites.test_fit import site_with

VEHICLE = load_vehicle("ardupilot-pitch")
ENVELOPE = PlanEnvelope(
    lower_m=(-3.0, -3.0, 0.6), upper_m=(3.0, 3.0, 2.5), plant_distance_m=0.5, pitch_deg=(-90.0, 0.0)
)


def plot(**known: Any) -> SitePlot:
    return SitePlot(latitude_deg=50.0, longitude_deg=6.0, **known)


def plan_in_envelope(height_m: float = 1.3) -> Plan:
    return planned(height_m=height_m).model_copy(update={"envelope": ENVELOPE})


def aims(plan: Plan) -> np.ndarray:
    """(n, 3) places nearest the plants' middle that the stations look at."""
    points = PlanFacts(plan).points
    middle = np.append(0.5 * (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)), 0.5 * points[:, 2].max())
    poses = [station.pose for station in plan.stations]
    return np.array([p.center + float((middle - p.center) @ p.forward) * p.forward for p in poses])


def positions(plan: Plan) -> np.ndarray:
    return np.array([station.position_m for station in plan.stations])


def test_of_plants_larger_on_all_sides_the_pictures_are_the_same() -> None:
    """Everything twice as large and as far away: what is looked at is where it was in the picture."""
    plan = plan_in_envelope()
    top = PlanFacts(plan).top_m
    reach = 2.0 * np.abs(PlanFacts(plan).points[:, :2]).max(axis=0)
    found = fitted(plan, plot(plant_height_m=2.0 * top, length_m=2.0 * reach[0], width_m=2.0 * reach[1]))
    np.testing.assert_allclose(positions(found), 2.0 * positions(plan), atol=1e-9)
    for before, after in zip(plan.stations, found.stations, strict=True):
        assert after.pitch_deg == pytest.approx(before.pitch_deg)
        assert (after.yaw_deg - before.yaw_deg + 180.0) % 360.0 == pytest.approx(180.0, abs=1e-6)
    assert (found.fit.length, found.fit.width, found.fit.height) == pytest.approx((2.0, 2.0, 2.0))


@given(height=st.floats(0.5, 1.7), length=st.none() | st.floats(0.4, 1.1), station_m=st.floats(0.7, 2.2))
def test_whatever_the_plot_the_plan_keeps_its_limits_and_fits_once(height, length, station_m) -> None:
    plan = plan_in_envelope(station_m)
    there = plot(plant_height_m=height, **({} if length is None else {"length_m": length, "width_m": length}))
    found = fitted(plan, there)
    facts, before = PlanFacts(found), PlanFacts(plan)
    assert fitted(found, there) is found
    assert facts.top_m == pytest.approx(height, abs=0.051)
    assert positions(found)[:, 2].min() >= 0.6
    assert all(-90.0 <= station.pitch_deg <= 0.0 for station in found.stations)
    away, was = (
        np.linalg.norm(positions(p)[:, None] - f.points[None], axis=2).min(axis=1)
        for p, f in ((found, facts), (plan, before))
    )
    low, high = np.append(before.points[:, :2].min(axis=0), 0.0), before.points.max(axis=0)
    from_box = np.linalg.norm(positions(plan) - np.clip(positions(plan), low, high), axis=1)
    assert (away >= np.minimum(from_box, 0.5) - 1e-9).all()
    assert (was >= from_box - 1e-9).all()


def test_a_plan_stated_for_plants_of_a_height_is_fitted_unless_it_must_not_be() -> None:
    """Its plants are those of several plots, of which one may be higher than the height it is stated for."""
    plan = plan_in_envelope().model_copy(update={"plant_height_m": 0.8})
    plots = [plot(name="a", plant_height_m=0.8), plot(name="b", plant_height_m=1.2), plot(name="c")]
    flown = flown_plans(plan, plots)
    assert isinstance(flown, dict)
    assert flown["a"] is flown["c"] is plan
    assert flown["b"].fit.height == pytest.approx(1.5)
    assert flown["b"].plant_height_m == pytest.approx(1.2)
    assert flown["b"].stations == fitted_to_height(plan, 1.2).stations
    assert flown_plans(plan, plots, fit=False) is plan
    assert flown_plans(flown, plots) is flown
    assert flown_plans(plan_in_envelope(), plots) == plan_in_envelope()
    assert fitted_to_height(plan_in_envelope(), 1.2) == plan_in_envelope()


@pytest.mark.parametrize(
    ("plan", "known", "message"),
    [
        (planned(plants=False), {"plant_height_m": 1.2}, "does not say where its plants are"),
        (planned(), {"plant_height_m": 2.4}, "too different"),
        (planned(), {"plant_height_m": 0.3}, "too different"),
        (planned(), {"length_m": 12.0, "width_m": 0.6}, "too different"),
    ],
)
def test_what_cannot_be_fitted_is_refused(plan: Plan, known: dict[str, Any], message: str) -> None:
    with pytest.raises(MissionError, match=message):
        fitted(plan, plot(**known))


def test_every_kind_of_plot_has_its_own_plan_and_its_file(tmp_path: Path) -> None:
    plan = plan_in_envelope()
    site = site_with(
        {"name": "as/planned", "plant_height_m": 0.9},
        {"name": "high/1", "plant_height_m": 1.2},
        {"name": "high:1", "plant_height_m": 1.1},
        {"name": "high/2", "plant_height_m": 1.2},
    )
    plans = fitted_to(plan, site.plots)
    assert plans["as/planned"] is plan
    done = export_mission(plan, VEHICLE, site, tmp_path / "m.plan", MissionSettings(fit=True), picture=False)
    assert {name: file.name for name, file in done.plans.items()} == {
        "high/1": "m-high%2F1.json",
        "high:1": "m-high%3A1.json",
        "high/2": "m-high%2F1.json",
    }
    for name, file in done.plans.items():
        assert load_plan(file).stations == plans[name].stations
    shots = [shot for each in done.routed.flights for shot in each.mission.shots]
    heights = {name: [s.place.height_m for s in shots if s.plot == name] for name in plans}
    assert sum(file.suffix == ".json" for file in done.files) == 3
    for name, found in heights.items():
        assert sorted(found) == pytest.approx(sorted(positions(plans[name])[:, 2]), abs=1e-6)


# The plants' no-fly volume.


def inside(bands: tuple[Band, ...], places: FloatArray) -> BoolArray:
    found = np.zeros(len(places), dtype=np.bool_)
    for band in bands:
        polygon = shapely.Polygon(band.corners)
        assert polygon.is_valid
        found |= shapely.contains_xy(polygon, places[:, 0], places[:, 1]) & (places[:, 2] < band.top_m)
    return found


def drawn(seed: int, count: int, clearance: float) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Whether random places are inside, their distances (places, points) and those in the plan, below points only."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((-1, -0.5, 0.0), (1, 0.5, 1.4), (count, 3)).round(3)
    plants = PlanPlants(points_m=tuple((x, y, z) for x, y, z in points.tolist()), cell_m=0.05)
    places = rng.uniform((-3, -3, 0), (3, 3, 3.5), (400, 3))
    apart = places[:, None] - points[None]
    below = np.where(apart[..., 2] < 0, np.linalg.norm(apart[..., :2], axis=2), np.inf)
    return inside(no_fly_bands(plants, clearance), places), np.linalg.norm(apart, axis=2), below


@given(st.integers(0, 10_000), st.integers(1, 60), st.floats(0.2, 1.5))
def test_what_is_near_or_below_a_plant_is_inside(seed: int, count: int, clearance: float) -> None:
    found, apart, below = drawn(seed, count, clearance)
    near = clearance - BAND_M - 0.02 - 0.02 * clearance  # a disc of sixteen sides lies 2 % inside the circle
    assert found[(apart < near).any(axis=1) | (below < near).any(axis=1)].all()


@given(st.integers(0, 10_000), st.integers(1, 2), st.floats(0.2, 1.5))  # more could surround a place
def test_what_keeps_the_distance_is_outside(seed: int, count: int, clearance: float) -> None:
    found, apart, below = drawn(seed, count, clearance)
    assert not found[(apart >= clearance).all(axis=1) & (below >= clearance).all(axis=1)].any()
