"""How near what is flown comes to plants, and what plots hide from each other, against brute force."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.missions.export import route_plan
from fieldkit.routing.mission import Home
from fieldkit.sites.placement import PlotFrame, SiteFrame
from fieldkit.sites.site import Site, SitePlot
from fieldkit.sites.site_obstacles import Canopy
from fieldkit.vehicles.vehicle_file import load_vehicle
from tests.missions.test_export import planned

VEHICLE = load_vehicle("ardupilot-pitch")
_STEP_M = 0.02


def field(seed: int, plots: int) -> Site:
    """Plots in a row 9 m apart, the last a neighbour, of random sizes, headings, heights and, some, slopes."""
    rng = np.random.default_rng(seed)
    made = [
        SitePlot(
            name=f"p{k}",
            latitude_deg=50.8650,
            longitude_deg=6.4473 + 1.3e-4 * k,
            row_heading_deg=rng.uniform(0, 360),
            length_m=rng.uniform(0.5, 6),
            width_m=rng.uniform(0.5, 3),
            plant_height_m=rng.uniform(0.2, 1.2),
            slope_percent=float(rng.choice([0.0, 6.0])),
            uphill_heading_deg=40.0,
        )
        for k in range(plots)
    ]
    home = Home(latitude_deg=50.8649, longitude_deg=6.4473)
    return Site(home=home, plots=tuple(made[:-1]), neighbours=tuple(made[-1:]), takeoff_m=2.5, transit_m=2.5)


def brute_m(site: Site, ways: list[np.ndarray]) -> float:
    """Least distance between places every 2 cm along ways and the boxes of all plots, the ground taken as it lies."""
    places = np.concatenate(
        [
            a + np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(b - a) / _STEP_M))[:, None] * (b - a)
            for way in ways
            for a, b in pairwise(way)
        ]
    )
    earth = SiteFrame(site.home).to_geodetic(places)
    least = np.inf
    for plot in site.all_plots:
        local = PlotFrame.of(site, plot).to_plot(*earth)
        beyond = np.maximum(np.abs(local[:, :2]) - 0.5 * np.array(plot.size_m), 0.0)
        above = np.maximum(local[:, 2] - plot.plant_height_m, 0.0)
        least = min(least, float(np.sqrt((beyond**2).sum(axis=1) + above**2).min()))
    return least


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 5))
def test_the_nearest_plants_are_those_of_brute_force(seed: int, plots: int) -> None:
    site, rng = field(seed, plots), np.random.default_rng(seed)
    canopy = Canopy.of(site, None)
    ways = [rng.uniform((-8, -3, 0.3), (9 * plots, 25, 4.0), (3, 3)) for _ in range(4)]
    level = all(plot.slope_percent == 0.0 for plot in site.all_plots)
    slack = _STEP_M if level else 0.15 + 0.06 * 6.0  # strips of a slope are flat, and heights there are not distances
    assert abs(canopy.nearest_m(ways) - brute_m(site, ways)) <= slack
    if level:
        assert canopy.nearest_m(ways) <= brute_m(site, ways) + 1e-6


def test_stations_over_other_plots_are_told_and_those_too_near_refused() -> None:
    ring = planned(8, height_m=2.4)
    near = [
        SitePlot(
            name=f"p{k}",
            latitude_deg=50.8650,
            longitude_deg=6.4473 + 1e-6 * metres * 14.22,
            length_m=1.0,
            width_m=1.0,
            plant_height_m=0.9,
        )
        for k, metres in enumerate((0.0, 1.2, 6.0))
    ]
    home = Home(latitude_deg=50.8649, longitude_deg=6.4473)
    site = Site(home=home, plots=(near[0],), neighbours=tuple(near[1:]), takeoff_m=3.0, transit_m=3.0)
    (told,) = (each for each in route_plan(ring, VEHICLE, site).fit if each.code == "plots-near")
    assert told.severity == "warning"
    assert told.message.startswith("1 of 8 stations stand over other plots, whose plants hide ")
    assert told.message.endswith("plots nearer than 0.9 m need another way of flying")
    alone = site.model_copy(update={"neighbours": site.neighbours[1:]})
    assert "plots-near" not in {each.code for each in route_plan(ring, VEHICLE, alone).fit}
