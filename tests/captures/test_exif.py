"""EXIF and DJI XMP, good and bad."""

from datetime import datetime, timedelta
from pathlib import Path

import pytest
from PIL.TiffImagePlugin import IFDRational

from fieldkit.captures import Photo, read_capture
from fieldkit.captures.xmp import parse_xmp, read_fields
from fieldkit.documents.xml_tree import XmlError
from tests.captures.photographs import MakePhoto, dji_xmp, exif_block, gps_tags

CAMERA = {271: "DJI", 272: "FC6310\0\0"}
DETAIL = {36867: "2024:06:23 16:31:59", 37521: "25", 37386: 8.8, 41989: 24, 42033: "0K8TH1\0", 42036: "Zoom 24mm"}


def only(path: Path) -> tuple[Photo, list[str]]:
    capture = read_capture(path.parent)
    assert len(capture.photos) == 1
    # A single position is too few for a scale, which is not what these tests are about.
    codes = [finding.code for finding in capture.findings if finding.code != "too-few-positions"]
    return capture.photos[0], codes


def test_everything_a_drone_writes(photo_file: MakePhoto) -> None:
    exif = exif_block(base=CAMERA, detail=DETAIL, gps=gps_tags(-33.5, 151.25, 45.5))
    xmp = dji_xmp(
        GimbalYawDegree="+45.00",
        GimbalPitchDegree="-89.90",
        GimbalRollDegree="+0.00",
        FlightYawDegree="46.0",
        RelativeAltitude="+39.80",
        RtkFlag="16",
    )
    photo, findings = only(photo_file("a.jpg", exif=exif, xmp=xmp, size=(300, 200)))
    assert findings == []
    assert (photo.make, photo.model, photo.serial, photo.lens) == ("DJI", "FC6310", "0K8TH1", "Zoom 24mm")
    assert (photo.focal_mm, photo.focal_35mm) == (8.8, 24.0)
    assert photo.focal_px == pytest.approx(200.0)
    assert photo.captured_at == datetime(2024, 6, 23, 16, 31, 59, 250000)
    assert (photo.yaw_deg, photo.pitch_deg, photo.roll_deg, photo.flight_yaw_deg) == (45.0, -89.9, 0.0, 46.0)
    tag = photo.geotag
    assert (tag.latitude_deg, tag.longitude_deg) == pytest.approx((-33.5, 151.25))
    assert (tag.altitude_m, tag.datum, tag.relative_altitude_m, tag.rtk) == (45.5, "sea level", 39.8, False)


@pytest.mark.parametrize(
    ("base", "detail", "gps", "expected"),
    [
        ({}, {36867: "2024:06:23 16:31:59"}, {}, "2024-06-23T16:31:59"),
        ({}, {36867: "2024-06-23T16:31:59"}, {}, "2024-06-23T16:31:59"),
        ({}, {36867: "2024-06-23T16:31:59.250+02:00"}, {}, "2024-06-23T16:31:59.250000"),
        ({}, {36867: "2024-06-23 16:31:59Z"}, {}, "2024-06-23T16:31:59"),
        ({}, {36867: "2024:06:23 16:31:59.123456789"}, {}, "2024-06-23T16:31:59.123456"),
        ({}, {36867: "2024:06:23 16:31:59.5", 37521: "25"}, {}, "2024-06-23T16:31:59.500000"),
        ({}, {36867: "2024:06:23 16:31:59", 37521: "7 "}, {}, "2024-06-23T16:31:59.700000"),
        ({}, {36867: "0000:00:00 00:00:00", 36868: "2024:06:23 16:31:59"}, {}, "2024-06-23T16:31:59"),
        ({306: "2024:06:23 16:31:59"}, {36867: "    :  :     :  :  "}, {}, "2024-06-23T16:31:59"),
        ({}, {}, {29: "2024:06:23", 7: (14.0, 31.0, 59.5)}, "2024-06-23T14:31:59.500000"),
        ({}, {}, {29: "2024-06-23", 7: (14.0, 31.0, 59.0)}, "2024-06-23T14:31:59"),
        ({}, {36867: "2024:06:23 16:31:59"}, {29: "2024:06:23", 7: (14.0, 31.0, 59.0)}, "2024-06-23T16:31:59"),
        ({}, {}, {29: "2024:06:23"}, None),
        ({}, {}, {29: "2024:06:23", 7: (25.0, 31.0, 59.0)}, None),
        ({}, {36867: "2024:13:23 16:31:59"}, {}, None),
        ({}, {36867: "yesterday"}, {}, None),
    ],
)
def test_ways_to_write_the_time(photo_file, base, detail, gps, expected) -> None:
    photo, _ = only(photo_file("a.jpg", exif=exif_block(base=base, detail=detail, gps=gps)))
    assert photo.captured_at == (expected and datetime.fromisoformat(expected))


@pytest.mark.parametrize(
    ("reference", "altitude", "altitude_type", "expected", "datum"),
    [
        (0, 120.0, None, 120.0, "sea level"),
        (1, 5.0, None, -5.0, "sea level"),
        (2, 160.0, None, 160.0, "ellipsoid"),
        (None, 120.0, None, 120.0, "unknown"),
        (0, 160.0, "RtkAlt", 160.0, "ellipsoid"),
    ],
)
def test_the_altitude_says_what_it_is_measured_from(
    photo_file: MakePhoto,
    reference: int | None,
    altitude: float,
    altitude_type: str | None,
    expected: float,
    datum: str,
) -> None:
    xmp = dji_xmp(AltitudeType=altitude_type) if altitude_type else b""
    exif = exif_block(gps=gps_tags(52.0, 13.0, altitude, reference))
    photo, _ = only(photo_file("a.jpg", exif=exif, xmp=xmp))
    assert photo.geotag.altitude_m == pytest.approx(expected)
    assert photo.geotag.datum == datum


def test_damaged_exif_does_not_stop_the_reading(photo_file: MakePhoto) -> None:
    for block in (b"II*\0\xff\xff\xff\xff", b"garbage", b"MM\0*\0\0\0\x08\0\x05" + b"\xff" * 40):
        photo, _ = only(photo_file("a.jpg", exif=b"Exif\0\0" + block))
        assert photo.make is None


@pytest.mark.parametrize("attributes", [True, False])
@pytest.mark.parametrize("prefix", ["drone-dji", "drone", "x1"])
def test_xmp_in_both_forms_and_under_any_prefix(attributes: bool, prefix: str) -> None:
    packet = dji_xmp(attributes, prefix, GimbalPitchDegree="-90.0", RelativeAltitude="+3.5", RtkFlag="50")
    data = parse_xmp(packet + b"\0" * 30)
    assert (data.gimbal_pitch_deg, data.relative_altitude_m, data.rtk_flag) == (-90.0, 3.5, 50)


def test_entities_are_never_expanded() -> None:
    laughs = b'<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>'
    for packet in (
        laughs + dji_xmp(False, GimbalYawDegree="&b;"),
        b'<!DOCTYPE x SYSTEM "file:///etc/hostname">' + dji_xmp(GimbalYawDegree="1"),
    ):
        with pytest.raises(XmlError):
            read_fields(packet)


@pytest.mark.parametrize(
    ("detail", "focal_px", "codes"),
    [
        ({37386: 3.6, 41989: 20}, 20 * 250 / 43.2666, []),
        ({37386: 3.6, 41989: 20, 41988: 2.0}, 40 * 250 / 43.2666, ["digital-zoom"]),
        ({37386: 3.6, 41989: 20, 41988: 0.0}, 20 * 250 / 43.2666, []),
        ({37386: 3.6, 41989: 20, 41988: 1.0}, 20 * 250 / 43.2666, []),
        ({37386: 3.6, 41989: 20, 41988: IFDRational(0, 0)}, 20 * 250 / 43.2666, []),
        ({37386: 3.6, 41989: 4}, None, ["focal-implausible"]),
        ({37386: 3.6, 41989: 7}, None, ["focal-implausible"]),
        ({37386: 8.8, 41989: 9}, None, ["focal-implausible"]),  # the lens's own focal length under the wrong tag
        ({37386: 3.6, 41989: 200}, None, ["focal-implausible"]),  # a sensor of 0.8 mm
        ({37386: 35.0, 41989: 35}, 35 * 250 / 43.2666, []),
        ({37386: 119.9, 41989: 556}, 556 * 250 / 43.2666, []),
        ({41989: 12000}, None, ["focal-implausible"]),
        ({41989: 0}, None, []),
        ({37386: 8.8}, None, []),
        ({37386: 8.8, 41486: 3000.0, 41488: 3, 40962: 4000}, 8.8 * 300 * 200 / 4000, []),
        ({37386: 8.8, 41989: 4, 41486: 3000.0, 41488: 3, 40962: 4000}, 8.8 * 300 * 200 / 4000, ["focal-implausible"]),
        ({37386: 8.8, 41486: 3000.0, 41488: 3, 40962: 4000, 41988: 1.5}, 8.8 * 450 * 200 / 4000, ["digital-zoom"]),
    ],
)
def test_focal_lengths(photo_file: MakePhoto, detail: dict, focal_px: float | None, codes: list[str]) -> None:
    path = photo_file("a.jpg", exif=exif_block(base=CAMERA, detail=detail), size=(200, 150))
    photo, findings = only(path)
    assert photo.focal_px == (None if focal_px is None else pytest.approx(focal_px, rel=1e-4))
    assert findings == codes


@pytest.mark.parametrize(
    ("clock", "offset", "gps", "hours"),
    [
        ("2026:06:30 23:20:00", "+00:00", None, 0.0),
        ("2026:06:30 23:20:00", "-03:30", None, -3.5),
        ("2026:06:30 23:20:00", "+99:00", None, None),
        ("2026:06:30 23:20:00", None, ("2026:06:30", (13.0, 19.0, 40.0)), 10.0),
        ("2026:06:30 23:20:00", "+00:00", ("2026:06:30", (13.0, 20.0, 5.0)), 10.0),  # the GPS knows
        ("2026:06:30 23:20:00", "+02:00", ("2020:01:01", (0.0, 0.0, 0.0)), 2.0),  # but not before its first fix
        ("2026:06:30 23:20:00", None, ("2026:06:30", (13.0, 12.0, 0.0)), None),
    ],
)
def test_what_zone_the_clock_is_on(
    photo_file: MakePhoto, clock: str, offset: str | None, gps: tuple | None, hours: float | None
) -> None:
    detail = {0x9003: clock} | ({} if offset is None else {0x9011: offset})
    photo, _ = only(photo_file("a.jpg", exif=exif_block(detail=detail, gps={29: gps[0], 7: gps[1]} if gps else None)))
    assert photo.clock_ahead == (None if hours is None else timedelta(hours=hours))
