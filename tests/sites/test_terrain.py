"""Plots on slopes: how a slope is given, and where a plan comes to lie on it."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from fieldkit.arrays import FloatArray
from fieldkit.errors import MetadataError
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.routing.mission import Home
from fieldkit.sites.placement import PlotFrame, SiteFrame, grounds_m, place
from fieldkit.sites.plots_file import load_plots
from fieldkit.sites.site import Site, SitePlot
from fieldkit.sites.site_obstacles import site_obstacles
from fieldkit.vehicles.vehicle_file import load_vehicle
from tests.missions.test_export import planned
from tests.sites.test_placement import plan_of
from tests.sites.test_site_file import geojson, point

VEHICLE = load_vehicle("ardupilot-pitch")
LATITUDE, LONGITUDE = 50.8650, 6.4473
HEADINGS = st.floats(-360, 360)
SLOPES = st.floats(0.5, 40)


def site_with(home: Home | None = None, **plot: Any) -> Site:
    home = home or Home(latitude_deg=50.8649, longitude_deg=LONGITUDE, ellipsoid_m=140.0)
    return Site(
        home=home, plots=(SitePlot(**{"plant_height_m": 0.85, **plot}, latitude_deg=LATITUDE, longitude_deg=LONGITUDE),)
    )


def uphill(east: FloatArray, north: FloatArray, percent: float, heading: float) -> Any:
    """Height of a plane by its definition: the way towards the heading, times the grade."""
    angle = math.radians(heading)
    return 0.01 * percent * (east * math.sin(angle) + north * math.cos(angle))


@given(HEADINGS, SLOPES, HEADINGS, st.lists(st.tuples(*[st.floats(-20, 20)] * 2, st.floats(0.5, 5)), min_size=1))
def test_stations_keep_their_height_above_the_plane_and_their_place(row, percent, heading, points) -> None:
    plan = plan_of(*((*point, 30.0, -40.0) for point in points))
    sloping = site_with(row_heading_deg=row, slope_percent=percent, uphill_heading_deg=heading)
    shots, level = place(plan, sloping), place(plan, site_with(row_heading_deg=row))
    frame = LocalFrame(LATITUDE, LONGITUDE, 140.0)
    for shot, flat, (_, _, z) in zip(shots, level, points, strict=True):
        there, before = (
            frame.to_local(s.place.latitude_deg, s.place.longitude_deg, 140.0 + s.place.height_m)[0]
            for s in (shot, flat)
        )
        np.testing.assert_allclose(there[:2], before[:2], atol=1e-6)
        assert there[2] - uphill(there[0], there[1], percent, heading) == pytest.approx(z, abs=1e-6)
        assert shot.yaw_deg == pytest.approx(flat.yaw_deg, abs=1e-6)
    heights = np.array([shot.place.height_m for shot in shots]) - grounds_m(sloping, shots)
    np.testing.assert_allclose(heights, [point[2] for point in points], atol=1e-4)  # d²/2R


@given(HEADINGS, SLOPES, HEADINGS, st.floats(0, 359), st.floats(-89, 20), st.floats(0.2, 8))
def test_a_camera_looks_at_the_same_place_of_the_slope(row, percent, heading, yaw, pitch, reach) -> None:
    """What the optical axis meets on the level plot, it meets at the same height above the ground on the slope."""
    site = site_with(row_heading_deg=row, slope_percent=percent, uphill_heading_deg=heading)
    frame = PlotFrame.of(site, site.plots[0])
    start = np.array([2.0, -1.0, 1.5])
    target = start + reach * Pose.from_yaw_pitch(start, yaw, pitch).forward
    (turned,) = frame.pitches(yaw, pitch).tolist()
    there, seen = frame.upright(np.stack([start, target]))
    aim = (seen - there) / np.linalg.norm(seen - there)
    np.testing.assert_allclose(Pose.from_yaw_pitch(there, yaw, turned).forward, aim, atol=1e-9)
    assert abs(turned - pitch) <= math.degrees(math.atan(0.01 * percent)) + 1e-9
    assert frame.planned_pitches(yaw, turned)[0] == pytest.approx(pitch, abs=1e-9)


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        ({"slope_percent": 5.0}, "rises by 5 %, but where to"),
        ({"length_m": 5.0}, "belong together"),
    ],
)
def test_what_no_ground_is(given_: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        SitePlot.model_validate({"latitude_deg": LATITUDE, "longitude_deg": LONGITUDE, **given_})


def test_plots_files_give_slopes_and_plants(tmp_path: Path) -> None:
    more = {"row_heading_deg": 90, "slope_percent": 10.0, "plant_height_m": 1.2, "row_spacing_m": 0.75}
    (plot,) = load_plots(geojson(tmp_path, point(uphill_heading_deg=0, **more)))
    assert plot.gradient == pytest.approx((0.0, 0.1))  # y is north
    assert (plot.plant_height_m, plot.row_spacing_m, plot.size_m) == (1.2, 0.75, None)
    with pytest.raises(MetadataError, match=r"feature 1: .*rises by 10 %, but where to"):
        load_plots(geojson(tmp_path, point(**more)))
    with pytest.raises(MetadataError, match="Did you mean slope_percent"):
        load_plots(geojson(tmp_path, point(row_heading_deg=90, slope_deg=3)))


@pytest.mark.parametrize("clearance", [0.5, 3.0])
def test_the_ground_stops_legs_and_no_station(clearance: float) -> None:
    """A leg that is as high above the lower end as a station, but not above the upper end."""
    plan = planned(plants=False)
    site = site_with(slope_percent=30.0, uphill_heading_deg=90.0)
    frame, local = PlotFrame.of(site, site.plots[0]), SiteFrame(site.home)
    obstacles = site_obstacles(site, clearance, plan)
    stations = np.array([station.position_m for station in plan.stations])
    places = local.to_local(*frame.to_geodetic(stations))
    assert not obstacles.blocked(places, places).any()
    west, east = local.to_local(*frame.level.to_geodetic([(-1.3, 0.0, 0.3), (1.3, 0.0, 0.3)]))
    (problem,) = {str(p).partition(" at ")[0] for p in obstacles.leg_problems(west, east)}
    assert problem == "comes too near to the ground of plot"
    above = min(clearance, 1.2) + 0.001
    low, high = local.to_local(*frame.to_geodetic([(-1.3, 0.0, above), (1.3, 0.0, above)]))
    assert not obstacles.blocked(low[None], high[None]).any()
