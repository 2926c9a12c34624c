"""From the plot frame to WGS 84."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.arrays import FloatArray
from fieldkit.results.plan import Plan, Station
from fieldkit.routing.mission import GeoPoint, Home
from fieldkit.sites.placement import PlotFrame, SiteFrame, place
from fieldkit.sites.site import Site, SitePlot

SITL = Path(__file__).parents[2] / "sim" / "sitl"
PLACES = {
    "field": (50.8650, 6.4473),
    "south": (-33.45, -70.65),
    "date line, east of it": (-17.9, -179.9999),
    "date line, west of it": (68.5, 179.9999),
    "on the date line": (-16.5, 180.0),
    "equator": (0.0, 0.0),
    "near the north pole": (89.9995, 30.0),
    "north pole": (90.0, 0.0),
    "south pole": (-90.0, 0.0),
}
"""Latitude and longitude of home and of the plot's origin."""


def site_at(latitude: float, longitude: float, ellipsoid: float | None = 140.0, **plot: Any) -> Site:
    home = Home(latitude_deg=latitude, longitude_deg=longitude, ellipsoid_m=ellipsoid)
    return Site(home=home, plots=(SitePlot(latitude_deg=latitude, longitude_deg=longitude, **plot),))


def plan_of(*stations: tuple[float, float, float, float, float], **more: Any) -> Plan:
    rows = tuple(Station(position_m=(x, y, z), yaw_deg=yaw, pitch_deg=pitch) for x, y, z, yaw, pitch in stations)
    return Plan(fieldkit="0", stations=rows, **more)


def proj_topocentric(latitude: float, longitude: float, height: float) -> Any:
    """PROJ's transformation from latitude, longitude, ellipsoidal height to east, north, up at an origin."""
    pyproj = pytest.importorskip("pyproj")
    return pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=axisswap +order=2,1 +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        "+step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lat_0={latitude!r} +lon_0={longitude!r} +h_0={height!r}"
    )


def geodesic_m(a: GeoPoint, b: GeoPoint) -> float:
    pyproj = pytest.importorskip("pyproj")
    _, _, metres = pyproj.Geod(ellps="WGS84").inv(a.longitude_deg, a.latitude_deg, b.longitude_deg, b.latitude_deg)
    return float(metres)


def turned(points: FloatArray, row_heading: float) -> FloatArray:
    """Plot frame to east-north-up, by unit vectors: x points to the heading, y to 90° left of it."""
    along, left = (np.radians(row_heading), np.radians(row_heading - 90.0))
    x = np.array([np.sin(along), np.cos(along), 0.0])
    y = np.array([np.sin(left), np.cos(left), 0.0])
    enu: FloatArray = points @ np.stack([x, y, np.array([0.0, 0.0, 1.0])])
    return enu


@pytest.mark.parametrize("where", PLACES)
@pytest.mark.parametrize("row_heading", [90.0, 0.0, -123.4, 217.0])
def test_positions_are_projs_within_a_kilometre(where: str, row_heading: float) -> None:
    latitude, longitude = PLACES[where]
    site = site_at(latitude, longitude, row_heading_deg=row_heading, height_m=137.5, datum="ellipsoid")
    reach = 1000.0 / math.sqrt(2.0)
    points = np.array([(x * reach, y * reach, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (0.0, 1.5, 60.0)])
    shots = place(plan_of(*((*point, 0.0, -90.0) for point in points.tolist())), site)
    there = proj_topocentric(latitude, longitude, 137.5)
    heights = [shot.place.height_m + 140.0 for shot in shots]
    found = there.transform([s.place.latitude_deg for s in shots], [s.place.longitude_deg for s in shots], heights)
    np.testing.assert_allclose(np.stack(found, axis=1), turned(points, row_heading), atol=1e-6)


@pytest.mark.parametrize("where", PLACES)
def test_the_site_frame_is_projs_in_plan_and_level_in_height(where: str) -> None:
    latitude, longitude = PLACES[where]
    frame = SiteFrame(Home(latitude_deg=latitude, longitude_deg=longitude, ellipsoid_m=140.0))
    points = np.array([(x, y, z) for x in (-900.0, 0.5, 700.0) for y in (-800.0, 600.0) for z in (0.0, 3.0, 80.0)])
    latitudes, longitudes, heights = frame.to_geodetic(points)
    np.testing.assert_array_equal(heights, points[:, 2])
    east, north, up = proj_topocentric(latitude, longitude, 140.0).transform(latitudes, longitudes, 140.0 + heights)
    np.testing.assert_allclose(np.stack([east, north], axis=1), points[:, :2], atol=1e-6)
    # Up in the tangent plane falls below the level surface by d²/2R: it is not the height.
    drop = (points[:, 0] ** 2 + points[:, 1] ** 2) / (2 * 6.37e6)
    np.testing.assert_allclose(points[:, 2] - up, drop, rtol=0.01, atol=1e-6)
    np.testing.assert_allclose(frame.to_local(latitudes, longitudes, heights), points, atol=1e-6)


def test_a_plot_far_from_home_is_as_high_as_its_ground() -> None:
    """A kilometre from home the plane that touches the ellipsoid at home is 8 cm off; a station must not be."""
    home = Home(latitude_deg=50.0, longitude_deg=6.0, amsl_m=100.0)
    far = SitePlot(name="far", latitude_deg=50.009, longitude_deg=6.0, height_m=103.0, datum="amsl")
    (shot,) = place(plan_of((2.0, 1.0, 1.5, 0.0, -45.0)), Site(home=home, plots=(far,)))
    assert shot.place.height_m == pytest.approx(4.5, abs=1e-6)


@given(
    st.sampled_from(sorted(PLACES)),
    st.floats(-360, 360),
    st.floats(-360, 360),
    st.tuples(st.floats(-500, 500), st.floats(-500, 500), st.floats(0, 100)),
    st.floats(-10, 10),
)
def test_round_trips(where, row_heading, yaw, point, ground) -> None:
    site = site_at(*PLACES[where], row_heading_deg=row_heading, height_m=ground, datum="home")
    frame = PlotFrame.of(site, site.plots[0])
    (shot,) = place(plan_of((*point, yaw, -30.0)), site)
    assert 0.0 <= shot.yaw_deg < 360.0
    assert -180.0 <= shot.place.longitude_deg <= 180.0
    where_ = (shot.place.latitude_deg, shot.place.longitude_deg)
    np.testing.assert_allclose(frame.to_plot(*where_, shot.place.height_m), [point], atol=1e-6)
    back = frame.yaws(*where_, shot.yaw_deg)[0]
    assert 0.0 <= back < 360.0
    assert abs((back - yaw + 180.0) % 360.0 - 180.0) < 1e-4
    local = SiteFrame(site.home)
    (again,) = local.places(local.points([shot.place]))
    assert geodesic_m(again, shot.place) < 1e-6
    assert again.height_m == shot.place.height_m


@pytest.mark.parametrize("where", PLACES)
@pytest.mark.parametrize("row_heading", [90.0, 20.0])
@pytest.mark.parametrize("yaw", [0.0, 77.0, 200.0, -90.0])
def test_a_heading_points_at_what_the_camera_looks_at(where: str, row_heading: float, yaw: float) -> None:
    """Two stations, the second where the first looks: the geodesic between them leaves with the first's heading."""
    pyproj = pytest.importorskip("pyproj")
    site = site_at(*PLACES[where], row_heading_deg=row_heading)
    start = np.array([12.0, -7.0, 2.0])
    ahead = start + 5.0 * np.array([math.sin(math.radians(yaw)), math.cos(math.radians(yaw)), 0.0])
    first, second = place(plan_of((*start.tolist(), yaw, 0.0), (*ahead.tolist(), yaw, 0.0)), site)
    azimuth, _, metres = pyproj.Geod(ellps="WGS84").inv(
        first.place.longitude_deg, first.place.latitude_deg, second.place.longitude_deg, second.place.latitude_deg
    )
    assert abs((first.yaw_deg - azimuth + 180.0) % 360.0 - 180.0) < 1e-4
    assert metres == pytest.approx(5.0, abs=1e-3)
