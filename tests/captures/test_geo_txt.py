"""ODM's geo.txt."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.captures.geo_txt import GeoRow, parse_geo_txt
from fieldkit.errors import FieldkitError, MetadataError
from fieldkit.geometry.geodesy import geodetic_to_ecef


@pytest.mark.parametrize("header", ["EPSG:4326", "epsg:4979", "WGS84", "WGS 84", "+proj=longlat +datum=WGS84 +no_defs"])
def test_geographic_coordinates_are_longitude_and_latitude(header: str) -> None:
    rows, findings = parse_geo_txt(
        f"{header}\nDJI_0028.JPG -91.9942096 46.84252125 198.609\nDJI_0032.JPG -91.99 46.84\n"
    )
    assert rows[0] == GeoRow(46.84252125, -91.9942096, 198.609, image="DJI_0028.JPG")
    assert rows[1] == GeoRow(46.84, -91.99, image="DJI_0032.JPG")
    assert findings == []


@pytest.mark.parametrize(
    "header", ["EPSG:32615", "WGS84 UTM 15N", "wgs84 utm 15n", "+proj=utm +zone=15 +datum=WGS84 +units=m +no_defs"]
)
def test_projected_coordinates(header: str) -> None:
    pyproj = pytest.importorskip("pyproj", reason="pyproj (extra 'geo') is not installed")
    x, y = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32615", always_xy=True).transform(-91.994, 46.8426)
    rows, _ = parse_geo_txt(f"{header}\na.jpg {x!r} {y!r} 198.6\n")
    assert rows[0].latitude_deg == pytest.approx(46.8426, abs=1e-9)
    assert rows[0].longitude_deg == pytest.approx(-91.994, abs=1e-9)
    assert rows[0].altitude_m == 198.6


def test_accuracies_angles_and_extras() -> None:
    lines = ["a.jpg 13 52 30 10 -90 0 0.02 0.05 some label", "b.jpg 13 52 30 0 0 0 0 0", "c.jpg 13 52 30 0 0 0 label"]
    rows, findings = parse_geo_txt("\n".join(["EPSG:4326", *lines]))
    assert (rows[0].horizontal_accuracy_m, rows[0].vertical_accuracy_m, rows[0].has_angles) == (0.02, 0.05, True)
    assert (rows[1].horizontal_accuracy_m, rows[1].vertical_accuracy_m, rows[1].has_angles) == (None, None, False)
    assert rows[2].horizontal_accuracy_m is None
    assert [finding.code for finding in findings] == ["angles-not-used"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["line 1"]),
        ("\nEPSG:4326\n", ["line 1"]),
        ("EPSG:4326\n", ["no photograph"]),
        ("a.jpg 13 52\n", ["line 1", "names no projection"]),
        ("EPSG:4326\na.jpg 13\n", ["line 2", "2 fields"]),
        ("EPSG:4326\na.jpg 13 north\n", ["line 2", "column y", "'north'"]),
        ("EPSG:4326\na.jpg 13 52 nan\n", ["line 2", "column z"]),
        ("EPSG:4326\na.jpg 52 130\n", ["line 2", "latitude 130"]),
        ("EPSG:4326\na.jpg 500000 5000000\n", ["line 2", "latitude 5e+06"]),
        ("EPSG:4326\na.jpg 13 52\na.jpg 13 53\n", ["line 3", "a.jpg", "line 2"]),
        ("WGS84 UTM 61N\na.jpg 13 52\n", ["no UTM zone 61"]),
        ("EPSG:999999\na.jpg 13 52\n", ["EPSG:999999"]),
        ("+proj=nonsense\na.jpg 13 52\n", ["+proj=nonsense"]),
    ],
)
def test_mistakes_name_the_line(text: str, words: list[str]) -> None:
    with pytest.raises(MetadataError) as caught:
        parse_geo_txt(text)
    assert all(word in caught.value.message for word in words), caught.value.message


@given(st.one_of(st.text(max_size=150), st.text(alphabet="EPSG:4326 a.jpg0-9\n\t#", max_size=150)))
def test_any_text_is_read_or_refused(text: str) -> None:
    for candidate in (text, f"EPSG:4326\n{text}"):
        try:
            rows, _ = parse_geo_txt(candidate)
        except FieldkitError:
            continue
        assert all(abs(row.latitude_deg) <= 90 for row in rows)


SURVEY_FOOT = 1200 / 3937


def of_minnesota(header: str, z: str) -> str:
    """A photograph in a projection, with accuracies in the units of its heights."""
    pyproj = pytest.importorskip("pyproj", reason="pyproj (extra 'geo') is not installed")
    crs = pyproj.CRS.from_user_input(header)
    x, y = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(-91.994, 46.8426)
    return f"{header}\na.jpg {x!r} {y!r} {z}\n"


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("EPSG:26849+6360", SURVEY_FOOT),  # Minnesota North with NAVD88, both in US survey feet
        ("EPSG:26849+5703", 1.0),  # with NAVD88 in metres
        ("EPSG:32615", 1.0),
        ("EPSG:4269", 1.0),
        ("+proj=utm +zone=15 +datum=WGS84 +units=us-ft +vunits=us-ft", SURVEY_FOOT),
    ],
)
def test_heights_and_accuracies_have_the_projections_unit(header: str, unit: float) -> None:
    rows, _ = parse_geo_txt(of_minnesota(header, "651.48 0 0 0 0.066 0.098"))
    assert (rows[0].latitude_deg, rows[0].longitude_deg) == pytest.approx((46.8426, -91.994), abs=1e-5)
    lengths = (rows[0].altitude_m, rows[0].horizontal_accuracy_m, rows[0].vertical_accuracy_m)
    assert lengths == pytest.approx((651.48 * unit, 0.066 * unit, 0.098 * unit))


@pytest.mark.parametrize("header", ["EPSG:26849", "EPSG:2222", "+proj=utm +zone=15 +datum=WGS84 +units=us-ft"])
def test_heights_whose_unit_nothing_says_are_refused(header: str) -> None:
    with pytest.raises(MetadataError, match="does not say whether heights are, too") as caught:
        parse_geo_txt(of_minnesota(header, "651.48"))
    assert "EPSG:26849+6360" in caught.value.remedy
    rows, _ = parse_geo_txt(of_minnesota(header, ""))
    assert rows[0].altitude_m is None


@pytest.mark.parametrize("header", ["EPSG:4978", "+proj=geocent +datum=WGS84 +units=m"])
def test_geocentric_coordinates(header: str) -> None:
    pytest.importorskip("pyproj", reason="pyproj (extra 'geo') is not installed")
    ((x, y, z),) = geodetic_to_ecef(46.8426, -91.994, 165.25)
    rows, _ = parse_geo_txt(f"{header}\na.jpg {x:.4f} {y:.4f} {z:.4f}\n")
    assert (rows[0].latitude_deg, rows[0].longitude_deg) == pytest.approx((46.8426, -91.994), abs=1e-8)
    assert rows[0].altitude_m == pytest.approx(165.25, abs=1e-3)
    assert rows[0].datum == "ellipsoid"
    with pytest.raises(MetadataError, match="line 2: geocentric coordinates need z"):
        parse_geo_txt(f"{header}\na.jpg {x:.4f} {y:.4f}\n")


@pytest.mark.parametrize("header", ["EPSG:32615", "EPSG:26849", "WGS84 UTM 15N"])
def test_degrees_under_a_projection_are_refused(header: str) -> None:
    pytest.importorskip("pyproj", reason="pyproj (extra 'geo') is not installed")
    with pytest.raises(MetadataError, match="look like degrees") as caught:
        parse_geo_txt(f"{header}\na.jpg -91.994 46.8426 198\nb.jpg -91.9941 46.8427 198\n")
    assert "EPSG:4326" in caught.value.remedy
