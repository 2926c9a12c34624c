"""Signs of coordinates and altitudes, of EXIF and XMP together, and stated accuracies."""

from pathlib import Path

import pytest
from PIL.TiffImagePlugin import IFDRational

from fieldkit.captures import Capture, GeoTag, read_capture
from tests.captures.photographs import MakePhoto, dji_xmp, exif_block, gps_tags

SOUTH = (-33.9, 151.2)


def folder_of(photo_file: MakePhoto, *gps: dict, xmp: bytes | tuple[bytes, ...] = b"") -> Path:
    """A folder with one photograph per GPS directory."""
    path = Path()
    for index, tags in enumerate(gps):
        own = xmp[index] if isinstance(xmp, tuple) else xmp
        path = photo_file(f"{index}.jpg", seed=index, exif=exif_block(gps=tags), xmp=own)
    return path.parent


def tags_of(capture: Capture) -> list[GeoTag]:
    return [photo.geotag for photo in capture.photos if photo.geotag is not None]


def said(capture: Capture, code: str) -> list[str]:
    return [finding.message for finding in capture.findings if finding.code == code]


def unlettered(latitude: float, longitude: float, *letters: int) -> dict:
    """GPS tags without the letter of the latitude (1) or of the longitude (3)."""
    return {k: v for k, v in gps_tags(latitude, longitude, 200.0).items() if k not in (letters or (1,))}


@pytest.mark.parametrize("letter", [None, "", "?"])
def test_a_latitude_that_nothing_puts_north_or_south_is_refused(photo_file: MakePhoto, letter: str | None) -> None:
    tags = [unlettered(-33.9 + 1e-4 * k, 151.2) | ({} if letter is None else {1: letter}) for k in range(3)]
    capture = read_capture(folder_of(photo_file, *tags))
    assert tags_of(capture) == []
    assert capture.metric_source is None
    messages = said(capture, "gps-hemisphere")
    assert len(messages) == 3
    assert "no GPSLatitudeRef" in messages[0]
    assert "geo.txt" in messages[0]


def test_xmp_gives_the_sign_that_the_letter_does_not(photo_file: MakePhoto) -> None:
    xmp = dji_xmp(GpsLatitude="-33.9000000", GpsLongtitude="+151.2000000")
    capture = read_capture(folder_of(photo_file, unlettered(*SOUTH, 1, 3), xmp=xmp))
    (tag,) = tags_of(capture)
    assert (tag.latitude_deg, tag.longitude_deg) == (pytest.approx(-33.9), pytest.approx(151.2))
    assert said(capture, "gps-hemisphere") == []


def test_a_letter_that_contradicts_xmp_is_reported_and_not_used(photo_file: MakePhoto) -> None:
    xmp = dji_xmp(GpsLatitude="-33.9", GpsLongitude="-151.2")
    capture = read_capture(folder_of(photo_file, gps_tags(33.9, 151.2, 20.0), xmp=xmp))
    (tag,) = tags_of(capture)
    assert (tag.latitude_deg, tag.longitude_deg) == (pytest.approx(-33.9), pytest.approx(-151.2))
    assert len(said(capture, "gps-hemisphere")) == 2


@pytest.mark.parametrize(
    ("exif", "reference", "xmp", "expected", "reported"),
    [
        (198.6, 1, "+198.60", 198.6, True),
        (198.6, 0, "-198.60", -198.6, True),
        (198.6, 1, "-198.60", -198.6, False),
        (198.6, 1, "+151.30", 198.6, True),  # heights of two datums
        (0.0, 0, "+198.60", 198.6, False),
        (2.0, 0, "+2.10", 2.0, False),
    ],
)
def test_the_sign_of_an_altitude_is_that_of_xmp(photo_file, exif, reference, xmp, expected, reported) -> None:
    gps = gps_tags(52.0, 13.0, exif, reference)
    capture = read_capture(folder_of(photo_file, gps, xmp=dji_xmp(AbsoluteAltitude=xmp)))
    assert tags_of(capture)[0].altitude_m == pytest.approx(expected)
    assert bool(said(capture, "altitude-sign")) is reported


@pytest.mark.parametrize(
    ("fields", "datum"),
    [
        ({"RtkFlag": "50"}, "unknown"),  # a Phantom 4 RTK, which writes reference 0 beside ellipsoidal heights
        ({"RtkFlag": "34"}, "unknown"),
        ({"RtkFlag": "0"}, "sea level"),
        ({"RtkFlag": "50", "AltitudeType": "RtkAlt"}, "ellipsoid"),
        ({"RtkFlag": "0", "AltitudeType": "GpsFusionAlt"}, "sea level"),
    ],
)
def test_sea_level_is_not_believed_of_rtk(photo_file: MakePhoto, fields: dict[str, str], datum: str) -> None:
    capture = read_capture(folder_of(photo_file, gps_tags(52.0, 13.0, 80.0), xmp=dji_xmp(**fields)))
    assert tags_of(capture)[0].datum == datum


VOID = {1: "N", 2: (0.0, 0.0, 0.0), 3: "E", 4: (0.0, 0.0, 0.0), 6: 0.0}


@pytest.mark.parametrize(
    ("gps", "code"),
    [
        (VOID, "gps-zero"),
        (VOID | {2: (123.0, 0.0, 0.0)}, "gps-implausible"),
        (gps_tags(46.0, 7.0) | {2: (1.0, 2.0, 3.0, 4.0)}, "gps-damaged"),
        (gps_tags(46.0, 7.0) | {2: (IFDRational(1, 0), 0.0, 0.0)}, "gps-damaged"),
        ({1: "N", 2: (46.0, 0.0, 0.0)}, "gps-damaged"),
    ],
)
def test_xmp_gives_the_position_where_the_exif_s_is_void(photo_file: MakePhoto, gps: dict, code: str) -> None:
    xmp = dji_xmp(GpsLatitude="46.8427", GpsLongitude="-91.994", AbsoluteAltitude="+198.5")
    capture = read_capture(folder_of(photo_file, gps, xmp=xmp))
    (tag,) = tags_of(capture)
    assert (tag.latitude_deg, tag.longitude_deg, tag.altitude_m) == (46.8427, -91.994, 198.5)
    assert "the XMP has another one, which is used" in said(capture, code)[0]
    void = read_capture(folder_of(photo_file, gps, xmp=dji_xmp(GpsLatitude="0.0", GpsLongitude="0.0")))
    assert tags_of(void) == []
    assert said(void, code)[0].endswith("; not used")
