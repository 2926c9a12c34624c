"""Whether a plan fits a plot, and what is said where it does not."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.arrays import FloatArray
from fieldkit.campaign.create import CampaignSources, init_campaign
from fieldkit.geometry import Intrinsics
from fieldkit.missions.export import route_plan
from fieldkit.results.finding import Refused
from fieldkit.results.plan import Plan, PlanPlants, Plans
from fieldkit.results.plan_file import save_plan
from fieldkit.routing.mission import Home
from fieldkit.sites.fit import CODES, fit_plot, fit_report
from fieldkit.sites.placement import PlotFrame, SiteFrame
from fieldkit.sites.plot_plants import PlanFacts, row_spacing_m, with_plant_height
from fieldkit.sites.site import Site, SitePlot
from fieldkit.sites.site_obstacles import site_obstacles
from fieldkit.vehicles.vehicle_file import load_vehicle
from tests.missions.test_export import planned

VEHICLE = load_vehicle("ardupilot-pitch")
CAMERA = Intrinsics("PINHOLE", 2000, 1500, (1700.0, 1700.0, 1000.0, 750.0))


def rows_of_plants(spacing: float, *, rows: int = 3, turn_deg: float = 0.0, seed: int = 0) -> FloatArray:
    """(n, 3) points of plants in rows along x: stems, and leaves that hang into the gaps higher up."""
    rng = np.random.default_rng(seed)
    found = []
    for row in range(rows):
        for along in np.arange(-1.5, 1.5, 0.18):
            foot = np.array([along, (row - (rows - 1) / 2) * spacing, 0.0]) + rng.normal(0, (0.02, 0.02, 0.0))
            stem = foot + np.column_stack([rng.normal(0, 0.01, (12, 2)), np.linspace(0.05, 0.6, 12)])
            leaves = foot + rng.normal(0, (0.12, 0.12, 0.12), (25, 3)) + [0.0, 0.0, 0.65]
            found += [stem, leaves]
    points = np.concatenate(found)
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turned: FloatArray = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return turned


def with_plants(plan: Plan, points: FloatArray) -> Plan:
    rows = tuple((float(x), float(y), float(z)) for x, y, z in points)
    return plan.model_copy(update={"plants": PlanPlants(points_m=rows, cell_m=0.05)})


def site_with(*plots: dict[str, Any]) -> Site:
    home = Home(latitude_deg=50.8649, longitude_deg=6.4473)
    return Site(
        home=home,
        plots=tuple(
            SitePlot(**{"name": f"p{k}", "latitude_deg": 50.8650 + 2e-4 * k, "longitude_deg": 6.4473, **plot})
            for k, plot in enumerate(plots)
        ),
    )


PLAN, BARE, HIGH, LOW = planned(), planned(plants=False), planned(height_m=2.2), planned(height_m=1.5)
OVER = LOW.model_copy(
    update={
        "stations": (
            *LOW.stations,
            LOW.stations[0].model_copy(update={"position_m": (0.0, 0.0, 1.7), "pitch_deg": -90.0}),
        )
    }
)
IN_ROWS, LOW_IN_ROWS = (with_plants(planned(height_m=height), rows_of_plants(0.75)) for height in (2.0, 1.2))
UNKNOWN = {"plant-height-unknown": ["error: ", "--plant-height METRES"]}
LARGE = {"length_m": 12.0, "width_m": 3.0}
UPHILL = {"uphill_heading_deg": 90.0}


def headed(heading_deg: float | None) -> Plan:
    return PLAN.model_copy(update={"row_heading_deg": heading_deg})


@pytest.mark.parametrize(
    ("plan", "plot", "expected"),
    [
        (PLAN, {}, {}),
        (PLAN, {"plant_height_m": None}, UNKNOWN),
        (LOW, {"plant_height_m": 0.93}, {}),
        (
            HIGH,
            {"plant_height_m": 1.4},
            {"plants-higher": ["warning: ", "plants of 1.40 m are 0.50 m higher than the plan's"]},
        ),
        (
            OVER,
            {"plant_height_m": 1.4},
            {"plants-higher": ["warning: ", "higher than the plan's"]},
        ),
        (
            BARE,
            {"plant_height_m": 1.5, "row_spacing_m": 0.75},
            {"plants-unknown": ["warning: ", "not checked against plants"]},
        ),
        (
            planned(8),
            LARGE,
            {"plot-size": ["warning: ", "12.0 × 3.0 m reaches beyond", "on 0.6 × 0.6 m"]},
        ),
        (IN_ROWS, {"row_spacing_m": 0.78}, {}),
        (IN_ROWS, {"row_spacing_m": 0.5}, {"row-spacing": ["rows are 0.50 m apart, the plan's 0.7"]}),
        (LOW_IN_ROWS, {"row_spacing_m": 0.5}, {"row-spacing": ["warning: "]}),
        (PLAN, {"slope_percent": 8.0, **UPHILL}, {}),
        (PLAN, {"slope_percent": 14.0, **UPHILL}, {"slope-steep": ["warning: ", "plans have been tried to 10 %"]}),
    ],
)
def test_what_is_found(plan: Plan, plot: dict[str, Any], expected: dict[str, list[str]]) -> None:
    """On a plot whose plants are those of `planned`, unless it says otherwise."""
    (known,) = site_with({"plant_height_m": 0.9, **plot}).plots
    found = {finding.code: finding for finding in fit_plot(PlanFacts(plan), known)}
    assert found.keys() == expected.keys()
    for code, words in expected.items():
        text = f"{found[code].severity}: {found[code].message} {found[code].remedy}"
        assert [word for word in words if word not in text] == []


RANDOM = np.random.default_rng(3)
NO_ROWS = {
    "evenly spread": RANDOM.uniform((-1, -1, 0), (1, 1, 0.9), (3000, 3)),
    "one row": rows_of_plants(0.75, rows=1),
    "few points": rows_of_plants(0.75)[:20],
    "no numbers": np.full((100, 3), np.nan),
    "nothing": np.zeros((0, 3)),
    "rows along y": rows_of_plants(0.75, turn_deg=90.0),
    "kilometres apart": 1e6 * RANDOM.normal(size=(100, 3)),
    "three single plants beside each other": np.concatenate(
        [RANDOM.normal((0.0, 0.3 * k, 0.3), (0.03, 0.03, 0.1), (200, 3)) for k in range(3)]
    ),
}


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        *((rows_of_plants(spacing, turn_deg=turn), spacing) for spacing in (0.4, 0.5, 0.75, 1.0) for turn in (0, 8)),
        *((points, None) for points in NO_ROWS.values()),
    ],
)
def test_row_spacing(points: FloatArray, expected: float | None) -> None:
    assert row_spacing_m(points) == (expected and pytest.approx(expected, rel=0.06))


def test_heights_that_are_given_for_all_plots_or_not_known() -> None:
    plan, site, nobody = planned(), site_with({}, {"plant_height_m": 1.2}), site_with({}, {})
    top_m = PlanFacts(plan).top_m

    def heights(site: Site, plans: Plans | None, given: float | Literal["unknown"] | None) -> list[float | None]:
        return [plot.plant_height_m for plot in with_plant_height(site, plans, given).plots]

    assert heights(site, plan, None) == heights(site, plan, "unknown") == [pytest.approx(1.56), 1.2]
    assert heights(site, plan, 1.64) == [1.64, 1.64]
    assert heights(nobody, plan, None) == heights(nobody, planned(plants=False), "unknown") == [None, None]
    assert heights(nobody, plan, "unknown") == [pytest.approx(1.3 * top_m)] * 2
    assert (
        heights(nobody, {"p0": plan.model_copy(update={"plant_height_m": 1.1})}, "unknown") == [pytest.approx(1.43)] * 2
    )


@pytest.mark.parametrize(("plan", "plot"), [(OVER, {"plant_height_m": 1.4}), (LOW_IN_ROWS, {"row_spacing_m": 0.5})])
def test_stations_in_plants_that_are_higher_or_elsewhere_are_refused(plan: Plan, plot: dict[str, Any]) -> None:
    found = fit_report(plan, site_with({"plant_height_m": 0.9, **plot}), VEHICLE).findings
    assert "among-plants" in {each.code for each in found if each.severity == "error"}


@settings(max_examples=15)
@given(st.floats(0.9, 2.5))
def test_what_is_flown_keeps_clear_of_plants_as_high_as_said(height: float) -> None:
    plan = planned(5, height_m=2.2)
    routed = route_plan(plan, VEHICLE, site_with({"plant_height_m": height}))
    top = PlanFacts(plan).top_m
    assert top is not None
    assert max(height, top) - 1e-6 <= routed.plants[:, 2].max() <= max(height, top) + 0.05
    assert routed.plants_m > VEHICLE.clearance_m - 0.07


def test_stations_nearer_than_a_receiver_holds_them_need_rtk() -> None:
    without, field = load_vehicle("dji-mavic-3-enterprise"), site_with({"plant_height_m": 0.9})
    plan = planned(40, height_m=1.5)  # 0.2 m from each other, and 1.1 m from the nearest plants

    def needed(plan: Plan, **changes: Any) -> list[str]:
        found = fit_report(plan, field, without.model_copy(update=changes)).findings
        return [f"{each.severity} {each.message}" for each in found if each.code == "needs-rtk"]

    apart, near = needed(plan, clearance_m=0.7)
    assert apart.startswith("warning needs RTK: two stations are 0.20 m apart")
    assert near.startswith("warning needs RTK: a station is 1.1")
    assert near.endswith("may be 0.5 m off and keeps 0.7 m clear")
    assert needed(plan, clearance_m=0.7, gps_accuracy_m=0.1) == needed(planned(height_m=2.0)) == []


@given(st.floats(0.2, 20), st.floats(0.2, 20))
def test_all_of_an_outline_is_kept_clear_of_and_leaves_make_it_higher(length: float, width: float) -> None:
    """Of a plot that is flown and of a neighbour, however low the plan's own plants are."""
    plan = planned()
    size = {"length_m": length, "width_m": width, "plant_height_m": 1.0}
    site = site_with(size, size)
    site = site.model_copy(update={"plots": site.plots[:1], "neighbours": site.plots[1:]})
    obstacles, clearance = site_obstacles(site, 0.5, plan), 0.5 - 0.02
    rng = np.random.default_rng(0)
    for plot in site.all_plots:
        places = np.column_stack([rng.uniform(-0.5, 0.5, (300, 2)) * [length, width], rng.uniform(0.2, 2.0, 300)])
        local = SiteFrame(site.home).to_local(*PlotFrame.of(site, plot).to_geodetic(places))
        blocked = obstacles.blocked(local, local)
        assert blocked[places[:, 2] < 1.0 + clearance].all()
        assert not blocked[places[:, 2] > 1.0 + 0.5].any()
    tall = with_plants(plan, np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 1.3)]))
    assert (
        site_obstacles(site, 0.5, tall).plants_top_m(
            SiteFrame(site.home).to_local(site.plots[0].latitude_deg, site.plots[0].longitude_deg, 5.0)
        )
        > 1.3 + 0.4
    )


def test_all_that_speaks_against_a_plan_is_one_list() -> None:
    """Of all plots and stations, each with what to do; people get what is the same once."""
    plan = planned(4, height_m=0.6)
    site = site_with({}, {"plant_height_m": 0.9, "length_m": 3.0, "width_m": 3.0}, {"plant_height_m": 0.5})
    report = fit_report(plan, site.model_copy(update={"ceiling_m": 4.0}), VEHICLE)
    found = [(each.subject, each.code, each.station) for each in report.findings if each.severity == "error"]
    assert found[:2] == [("p0", "plant-height-unknown", None), ("p0", "out-of-reach", 0)]
    assert set(found[1:13]) == {(f"p{plot}", "out-of-reach", station) for plot in range(3) for station in range(4)}
    assert set(found[13:]) == {("", "height", None), *(("p1", "among-plants", station) for station in range(4))}
    assert all(CODES[each.code] == each.severity and each.remedy for each in report.findings)
    with pytest.raises(Refused) as caught:
        report.require()
    assert caught.value.exit_code == 5
    assert caught.value.findings == report.findings
    assert "- 12 photographs (station 1, 2, 3 and 4 of p0, p1 and p2): 0.60 m above the ground" in caught.value.message
    assert "--adjust" in caught.value.remedy
    fit_report(planned(height_m=2.0), site_with({"plant_height_m": 0.9}), VEHICLE).require()


@pytest.mark.parametrize(("focal", "refused"), [(1700.0, False), (2600.0, True), (1100.0, True)])
def test_a_plan_for_another_camera_is_refused(tmp_path: Path, focal: float, refused: bool) -> None:
    """By the export, and before by the campaign that has this vehicle."""
    camera = Intrinsics.pinhole(2000, 1500, focal)
    plan = planned(4, height_m=2.0).model_copy(update={"camera": camera})
    report = fit_report(plan, site_with({"plant_height_m": 0.9}), VEHICLE, adjust=True)
    assert [each.code for each in report.findings if each.severity == "error"] == ["other-camera"] * refused
    place = "latitude_deg = 50.8649\nlongitude_deg = 6.4473\n"
    (tmp_path / "site.toml").write_text(f"format = 1\n[home]\n{place}[[plots]]\n{place}plant_height_m = 0.9\n")
    save_plan(tmp_path / "plan.json", plan)
    sources = CampaignSources(tmp_path / "plan.json", tmp_path / "site.toml", vehicle="ardupilot-pitch")
    with pytest.raises(Refused, match="the plan's camera sees") if refused else nullcontext():
        init_campaign(tmp_path / "season", sources)
