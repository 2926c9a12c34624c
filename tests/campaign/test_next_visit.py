"""The next visit of a campaign: each plot's own stations, one mission, and visits that are compared with them."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fieldkit.campaign import Campaign, Visit, read_campaign
from fieldkit.campaign.next_visit import grown, heights_flown, next_plans, plan_next_visit
from fieldkit.campaign.reading import keep_visit
from fieldkit.clouds import Cloud
from fieldkit.errors import MissionError, UsageError
from fieldkit.missions.settings import MissionSettings
from fieldkit.planning.methods.optimise import Effort
from fieldkit.results.mission import load_mission
from fieldkit.results.plan import Plan, PlanEnvelope
from fieldkit.routing.mission import Home
from fieldkit.runtime.context import Context
from fieldkit.sites.site import Site, SitePlot
from fieldkit.vehicles.vehicle_file import load_vehicle
from tests.campaign.examples import PLAN, campaign_folder, field
from tests.evaluation.examples import evaluation_folder
from tests.scenes.conftest import make_row

FIELD = field(1, 3)
DATES = ("2026-06-18", "2026-06-25")
ENVELOPE = PlanEnvelope(
    lower_m=(-2.0, -2.0, 0.9), upper_m=(2.0, 2.0, 2.5), plant_distance_m=0.5, pitch_deg=(-90.0, 0.0)
)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fieldkit.campaign.next_visit._AROUND", Effort(moves=12))
    monkeypatch.setattr("fieldkit.campaign.next_visit._ANYWHERE", Effort(4, 1, 12))


@cache
def row() -> Cloud:
    cloud = make_row().cloud
    return cloud.select(np.arange(0, len(cloud), 6))


def season(tmp_path: Path, visited: Sequence[str] = ("r1c1", "r1c2"), plan: Plan = PLAN) -> Campaign:
    """Three plots; those named have a visit with a cloud, and a later one that came to nothing."""
    folder = campaign_folder(tmp_path, FIELD, plan.model_copy(update={"envelope": ENVELOPE}))
    site = folder / "site.toml"
    site.write_text(site.read_text().replace("latitude_deg = 52.296\n", "latitude_deg = 52.2957\n"))  # beside the plots
    for plot in visited:
        evaluation_folder(folder / "visits" / plot / DATES[0], {plot: row()})
        keep_visit(folder, Visit(plot=plot, date=DATES[0], folder=f"visits/{plot}/{DATES[0]}", images=8, right=8))
        keep_visit(folder, Visit(plot=plot, date=DATES[1], error="too dark"))
    return read_campaign(folder)


def test_plants_grow_about_their_feet() -> None:
    cloud = row()
    taller = grown(cloud, 1.2)
    low = cloud.points[:, 2] < cloud.points[:, 2].min() + 0.02
    assert np.ptp(taller.points[:, 2]) == pytest.approx(1.2 * np.ptp(cloud.points[:, 2]), rel=0.01)
    assert np.abs(taller.points[low, :2] - cloud.points[low, :2]).max() < 0.01  # no plant is elsewhere
    one_bush = Cloud(np.random.default_rng(0).uniform((-0.3, -0.2, 0.0), (0.3, 0.2, 0.4), (3000, 3)))
    wider = grown(one_bush, 1.5)
    np.testing.assert_allclose(np.ptp(wider.points, axis=0), 1.5 * np.ptp(one_bush.points, axis=0))
    np.testing.assert_allclose(wider.points[:, :2].mean(axis=0), one_bush.points[:, :2].mean(axis=0), atol=0.01)


def test_every_plot_with_a_cloud_has_its_own_plan_and_no_worse_score(tmp_path: Path) -> None:
    found = season(tmp_path)
    vehicle = load_vehicle("ardupilot-pitch")
    plans = next_plans(found, vehicle, Context(), growth=1.2)
    assert [each.plot for each in plans] == ["r1c1", "r1c2", "r1c3"]
    assert [each.date for each in plans] == [DATES[0], DATES[0], None]
    for each in plans[:2]:
        assert each.expected_m <= each.carried_m
        assert len(each.plan.stations) == len(PLAN.stations)
        assert min(station.position_m[2] for station in each.plan.stations) >= vehicle.min_height_m
        assert each.plan.plants is not None
        assert (each.plan.method.name, each.plan.method.repeats) == ("score", 0)
    assert plans[2].plan is found.plan


def test_visits_are_compared_with_the_plan_that_was_made_for_them(tmp_path: Path) -> None:
    found = season(tmp_path)
    with pytest.raises(MissionError, match="too low over the plants of r1c"):
        plan_next_visit(
            found, "2026-07-02", tmp_path / "next.plan", MissionSettings(), Context(), vehicle="ardupilot-pitch"
        )
    settings = MissionSettings(plant_height=0.6, adjust=True, only=["r1c1", "r1c3"])
    made = plan_next_visit(found, "2026-07-02", tmp_path / "next.plan", settings, Context(), vehicle="ardupilot-pitch")
    own = {each.plot: each.plan for each in made.plans}
    assert found.plan_of("r1c1", "2026-07-02").stations == own["r1c1"].stations
    assert found.plan_of("r1c1", "2026-07-03").stations == own["r1c1"].stations
    assert found.plan_of("r1c1", "2026-07-01") is found.plan
    assert found.plan_of("r1c3", "2026-07-02") is found.plan
    assert made.mission.routed.stations == 2 * len(PLAN.stations)
    (left,) = load_mission(tmp_path / "next.mission.json").neighbours
    assert left.name == "r1c2"
    assert left.plants.height_m == pytest.approx(1.15 * row().points[:, 2].max())  # grown since it was measured
    with pytest.raises(UsageError, match="exists already"):
        plan_next_visit(
            found, "2026-07-02", tmp_path / "b.plan", MissionSettings(), Context(), vehicle="ardupilot-pitch"
        )


def test_a_plan_for_a_kind_is_fitted_to_each_plots_plants(tmp_path: Path) -> None:
    """A visit is compared with the stations that were flown, and the next one is planned from them."""
    height_m = max(z for _, _, z in PLAN.plants.points_m)
    found = season(tmp_path, ("r1c1",), PLAN.model_copy(update={"plant_height_m": height_m}))
    sites = tuple(
        plot.model_copy(update={"plant_height_m": 1.2 * height_m if plot.name == "r1c3" else None})
        for plot in found.site.plots
    )
    found = replace(found, site=found.site.model_copy(update={"plots": sites}))
    assert found.plan_of("r1c1", DATES[0]) is found.plan
    flown = found.plan_of("r1c3", DATES[0])
    assert flown.fit.height == pytest.approx(1.2)
    plans = {each.plot: each.plan for each in next_plans(found, None, Context(), growth=1.2)}
    assert plans["r1c3"] == flown
    assert plans["r1c1"].plant_height_m is None  # for these plants: not to be fitted once more


def test_stations_keep_clear_of_the_whole_plot_whose_size_is_known(tmp_path: Path) -> None:
    found = season(tmp_path, ("r1c1",))
    size = {"length_m": 2.8, "width_m": 2.4, "plant_height_m": 1.6}
    sites = tuple(plot.model_copy(update=size) for plot in found.site.plots)
    sized = replace(found, site=found.site.model_copy(update={"plots": sites}))
    plans = [next_plans(each, None, Context(), growth=1.2)[0].plan for each in (found, sized)]
    stations = [np.array([station.position_m for station in plan.stations]) for plan in plans]
    side = 0.5 * np.array([2.8, 2.4, 3.2])
    away = [np.linalg.norm(np.maximum(np.abs(places) - side, 0.0), axis=1).min() for places in stations]
    assert away[0] < 0.48 <= away[1] + 0.02


def test_plants_that_nobody_knows_may_be_taller_than_measured_ones() -> None:
    stated = Site(
        home=Home(latitude_deg=52.2957, longitude_deg=10.438),
        plots=tuple(
            SitePlot(name=name, latitude_deg=52.296 + 1e-4 * k, longitude_deg=10.438, plant_height_m=height)
            for k, (name, height) in enumerate([("stated", 1.0), ("measured", 1.0), ("unknown", None), ("low", None)])
        ),
    )
    for given, expected in ((None, (1.0, 2.0, 2.6, 1.3)), (2.2, (2.2, 2.2, 2.2, 2.2))):
        measured, flown = heights_flown(stated, PLAN, given, {"measured": 2.0, "low": 0.5})
        assert tuple(plot.plant_height_m for plot in flown.plots) == pytest.approx(expected)
        assert [plot.plant_height_m for plot in measured.plots] == [1.0, 2.0, None, 0.5]
