"""The plot frame against PROJ, at the poles and across the antimeridian."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.geometry.geodesy import LocalFrame, ecef_to_geodetic, geodetic_to_ecef, great_circle_m, utm_epsg

latitudes = st.one_of(st.floats(-90, 90), st.sampled_from([-90.0, 90.0, 0.0, 89.999999, -89.999999]))
longitudes = st.one_of(st.floats(-180, 180), st.sampled_from([-180.0, 180.0, 0.0, 179.9999999]))
heights = st.floats(-500, 12000)
frames = st.builds(LocalFrame, latitudes, longitudes, heights)


def _random_places(count: int = 500) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    latitude = np.append(rng.uniform(-90, 90, count - 2), [90.0, -90.0])
    return latitude, rng.uniform(-180, 180, count), rng.uniform(-500, 9000, count)


def test_ecef_agrees_with_proj_to_a_micrometre() -> None:
    pyproj = pytest.importorskip("pyproj", reason="pyproj (extra 'geo') is not installed")
    latitude, longitude, height = _random_places()
    to_ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    expected = np.stack(to_ecef.transform(longitude, latitude, height), axis=1)
    np.testing.assert_allclose(geodetic_to_ecef(latitude, longitude, height), expected, rtol=0, atol=1e-6)


def test_local_frame_agrees_with_proj_topocentric() -> None:
    pyproj = pytest.importorskip("pyproj", reason="pyproj (extra 'geo') is not installed")
    frame = LocalFrame(46.8426, -91.994, 198.3, "sea level")
    rng = np.random.default_rng(1)
    latitude = frame.latitude_deg + rng.uniform(-0.02, 0.02, 200)
    longitude = frame.longitude_deg + rng.uniform(-0.02, 0.02, 200)
    height = frame.altitude_m + rng.uniform(-200, 200, 200)
    pipeline = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lat_0={frame.latitude_deg} +lon_0={frame.longitude_deg} "
        f"+h_0={frame.altitude_m}"
    )
    expected = np.stack(pipeline.transform(longitude, latitude, height), axis=1)
    local = frame.to_local(latitude, longitude, height)
    assert np.abs(local).max() > 1000
    np.testing.assert_allclose(local, expected, rtol=0, atol=1e-5)


@given(latitudes, longitudes, heights)
def test_ecef_round_trip(latitude: float, longitude: float, height: float) -> None:
    point = geodetic_to_ecef(latitude, longitude, height)
    back = geodetic_to_ecef(*ecef_to_geodetic(point))
    np.testing.assert_allclose(back, point, rtol=0, atol=1e-7)
    assert ecef_to_geodetic(point)[2][0] == pytest.approx(height, abs=1e-7)


@given(frames, st.lists(st.tuples(*[st.floats(-2000, 2000)] * 3), min_size=1, max_size=5))
def test_local_round_trip(frame: LocalFrame, points: list[tuple[float, float, float]]) -> None:
    latitude, longitude, altitude = frame.to_geodetic(points)
    assert (np.abs(latitude) <= 90).all()
    assert (np.abs(longitude) <= 180).all()
    np.testing.assert_allclose(frame.to_local(latitude, longitude, altitude), points, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("latitude", "longitude", "epsg"),
    [
        (46.84, -91.99, 32615),
        (52.5, 13.4, 32633),
        (-33.9, 18.4, 32734),
        (60.4, 5.3, 32632),
        (78.2, 15.6, 32633),
        (78.2, 8.9, 32631),
        (0.0, -180.0, 32601),
        (10.0, 180.0, 32601),
        (10.0, 179.9999, 32660),
        (-0.0001, 0.0, 32731),
    ],
)
def test_utm_zone(latitude: float, longitude: float, epsg: int) -> None:
    assert utm_epsg(latitude, longitude) == epsg


@pytest.mark.parametrize("values", [(91.0, 0.0, 0.0), (math.nan, 0.0, 0.0), (0.0, math.inf, 0.0)])
def test_impossible_origins_are_refused(values: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError):
        LocalFrame(*values)


def test_distances_along_the_ground_also_to_the_other_side_of_the_earth() -> None:
    """A tangent plane would say that a place's antipode is near."""
    found = great_circle_m([50.91, 50.9, -50.9], [6.4, 6.41, -173.6], 50.9, 6.4)
    assert found[:2] == pytest.approx([1112.6, 703.2], rel=1e-3)
    assert found[2] == pytest.approx(np.pi * 6.371e6, rel=0.05)
