"""Plots on slopes: how a slope is given, and where a plan comes to lie on it."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from fieldkit.arrays import FloatArray
from fieldkit.errors import MetadataError
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.sites.placement import PlotFrame, SiteFrame, grounds_m, place
from fieldkit.sites.plots_file import load_plots
from fieldkit.sites.site import Site, SiteHome, SitePlot
from fieldkit.sites.site_file import load_site
from fieldkit.sites.site_obstacles import site_obstacles
from fieldkit.sites.terrain import plane_through
from fieldkit.vehicles.vehicle_file import load_vehicle
from tests.missions.test_export import planned
from tests.sites.test_placement import plan_of
from tests.sites.test_site_file import geojson, point

VEHICLE = load_vehicle("ardupilot-pitch")
LATITUDE, LONGITUDE = 50.8650, 6.4473
HEADINGS = st.floats(-360, 360)
SLOPES = st.floats(0.5, 40)


def site_with(home: SiteHome | None = None, **plot: Any) -> Site:
    home = home or SiteHome(latitude_deg=50.8649, longitude_deg=LONGITUDE, ellipsoid_m=140.0)
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


@given(
    SLOPES,
    st.floats(0, 359.9),
    st.floats(-50, 50),
    st.floats(0, 359),
    st.floats(5, 80),
    st.floats(40, 140),
    st.floats(5, 80),
)
def test_three_heights_give_their_plane(percent, heading, height, first, r1, apart, r2) -> None:
    angles = np.radians([first, first + apart, first + apart + 120.0])
    local = np.column_stack([np.array([r1, r2, r1]) * np.sin(angles), np.array([r1, r2, r1]) * np.cos(angles)])
    (a, b), (c, d) = local[1] - local[0], local[2] - local[0]
    assume(abs(a * d - b * c) > 1.0 * np.linalg.norm(np.ptp(local, axis=0)))  # not on one line
    heights = height + uphill(local[:, 0], local[:, 1], percent, heading)
    frame = LocalFrame(LATITUDE, LONGITUDE)
    latitudes, longitudes, _ = frame.to_geodetic(np.column_stack([local, np.zeros(3)]))
    points = list(zip(latitudes.tolist(), longitudes.tolist(), heights.tolist(), strict=True))
    plane = plane_through(LATITUDE, LONGITUDE, points)
    assert plane.slope_percent == pytest.approx(percent, abs=1e-4)
    assert plane.height_m == pytest.approx(height, abs=1e-5)
    assert abs((plane.uphill_heading_deg - heading + 180) % 360 - 180) < 1e-2
    plot = SitePlot.model_validate(
        {"latitude_deg": LATITUDE, "longitude_deg": LONGITUDE, "datum": "home", "ground_points": points}
    )
    assert (plot.slope_percent, plot.uphill_heading_deg) == (plane.slope_percent, plane.uphill_heading_deg)
    assert plot.height_m == plane.height_m
    assert SitePlot.model_validate(plot.model_dump()) == plot


def test_site_files_give_slopes_in_three_ways(tmp_path: Path) -> None:
    file = tmp_path / "site.toml"
    head = "format = 1\n[home]\nlatitude_deg = 50.8649\nlongitude_deg = 6.4473\namsl_m = 92.0\n[[plots]]\n"
    head += f"latitude_deg = {LATITUDE}\nlongitude_deg = {LONGITUDE}\n"
    north = LATITUDE + 8.99e-5  # 10 m
    for lines in (
        "slope_percent = 10\nuphill_heading_deg = 0\nheight_m = 91.0\n",
        "slope_deg = 5.710593\nuphill_heading_deg = 0\nheight_m = 91.0\n",
        f"ground_points = [[{LATITUDE}, {LONGITUDE}, 91.0], [{north}, {LONGITUDE}, 92.0], [{LATITUDE}, 6.4475, 91]]\n",
    ):
        file.write_text(head + 'datum = "amsl"\n' + lines, encoding="utf-8")
        (plot,) = load_site(file).plots
        assert plot.slope_percent == pytest.approx(10.0, abs=0.01)
        assert plot.height_m == pytest.approx(91.0)
        assert plot.gradient == pytest.approx((0.0, 0.1), abs=1e-4)


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        ({"slope_percent": 5.0}, "rises by 5 %, but where to"),
        ({"slope_percent": 5.0, "slope_deg": 3.0, "uphill_heading_deg": 0.0}, "gives its slope twice"),
        ({"slope_deg": 60.0, "uphill_heading_deg": 0.0}, "from 0 to 45"),
        ({"length_m": 5.0}, "belong together"),
        ({"ground_points": 3}, "ground_points should be three"),
        ({"ground_points": [[50.865, 6.4473, 1.0]] * 3}, "of one line"),
        ({"ground_points": [[6.4473, 50.865, 1], [6.45, 50.865, 1], [6.4473, 50.866, 1]]}, "latitude comes first"),
        ({"ground_points": [[50.865, 6.4473, 1], [50.8651, 6.4473, 90], [50.865, 6.4475, 1]]}, "mistyped"),
        ({"ground_points": [[50.865, 6.4473, 1]] * 3, "height_m": 3.0}, "follows from ground_points"),
        ({"ground_points": [[50.865, 6.4473, 1], [50.866, 6.4473, 1], [50.865, 6.448, 1]]}, "above what"),
    ],
)
def test_what_no_ground_is(given_: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        SitePlot.model_validate({"latitude_deg": LATITUDE, "longitude_deg": LONGITUDE, **given_})


def test_geojson_gives_slope_and_plants_with_the_longitude_first(tmp_path: Path) -> None:
    north = LATITUDE + 8.99e-5
    points = [[LONGITUDE, LATITUDE, 91.0], [LONGITUDE, north, 92.0], [6.4475, LATITUDE, 91.0]]
    more = {"row_heading_deg": 90, "datum": "amsl", "plant_height_m": 1.2, "row_spacing_m": 0.75}
    (plot,) = load_plots(geojson(tmp_path, point(ground_points=points, **more)))
    assert (plot.slope_percent, plot.height_m) == pytest.approx((10.0, 91.0), abs=0.01)
    assert (plot.plant_height_m, plot.row_spacing_m, plot.size_m) == (1.2, 0.75, None)
    with pytest.raises(MetadataError, match=r"feature 1: .*rises by 3 %, but where to"):
        load_plots(geojson(tmp_path, point(row_heading_deg=90, slope_percent=3)))
    odd: tuple[Any, ...] = ([[1]], "x", [[None, 2, 3]] * 3, [[1e999, 2, 3]] * 3, {}, [[], [], []])
    for hostile in odd:
        with pytest.raises(MetadataError, match="feature 1"):
            load_plots(geojson(tmp_path, point(row_heading_deg=90, datum="amsl", ground_points=hostile)))


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
