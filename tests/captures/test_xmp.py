"""Tags of drones other than DJI's, and what they mean in DJI's convention."""

import pytest

from fieldkit.captures.xmp import XmpData, parse_xmp

RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
SPACES = {
    "drone-dji": "http://www.dji.com/drone-dji/1.0/",
    "drone-skydio": "https://www.skydio.com/drone-skydio/1.0/",
    "drone-parrot": "http://www.parrot.com/drone-parrot/1.0/",
    "drone": "http://www.autelrobotics.com/drone/1.0/",
    "Camera": "http://pix4d.com/camera/1.0/",
    "exif": "http://ns.adobe.com/exif/1.0/",
}


def packet(attributes: dict[str, str] | None = None, inside: str = "") -> bytes:
    spaces = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in SPACES.items())
    given = " ".join(f'{name}="{value}"' for name, value in (attributes or {}).items())
    text = f'<rdf:RDF xmlns:rdf="{RDF}"><rdf:Description rdf:about="" {spaces} {given}>{inside}</rdf:Description>'
    return f'<x:xmpmeta xmlns:x="adobe:ns:meta/">{text}</rdf:RDF></x:xmpmeta>'.encode()


def angles(data: XmpData) -> tuple[float | None, float | None, float | None]:
    return data.gimbal_yaw_deg, data.gimbal_pitch_deg, data.gimbal_roll_deg


@pytest.mark.parametrize(
    ("own", "expected"),
    [
        ((40.0, 0.0, 0.0), (40.0, -90.0, 0.0)),
        ((146.781036, 38.011101, -0.041258), (146.848038, -51.988888, -0.052789)),  # Parrot's documentation has both
        ((40.0, 90.0, 0.0), (40.0, 0.0, 0.0)),
        ((90.0, 0.0, 10.0), (0.0, -80.0, 90.0)),  # rolled right at nadir: it sees what lies left, here the north
    ],
)
def test_pix4d_counts_pitch_from_straight_down(own, expected) -> None:
    names = ("Camera:Yaw", "Camera:Pitch", "Camera:Roll")
    data = parse_xmp(packet(dict(zip(names, map(str, own), strict=True))))
    assert angles(data) == pytest.approx(expected, abs=1e-3)


def test_pix4d_tags_in_any_of_their_namespaces() -> None:
    for uri in ("http://ns.sensefly.com/Camera/1.0/", "http://pix4d.com/camera/1.0", "https://support.pix4d.com/hc/x"):
        text = packet({"Camera:Yaw": "10", "Camera:Pitch": "0"}).replace(SPACES["Camera"].encode(), uri.encode())
        assert angles(parse_xmp(text)) == pytest.approx((10.0, -90.0, 0.0))


@pytest.mark.parametrize(
    "inside",
    [
        (
            '<drone-skydio:CameraOrientationNED drone-skydio:Roll="0.19" drone-skydio:Pitch="-7.47" '
            'drone-skydio:Yaw="127.4"/>'
        ),
        (
            '<drone-skydio:CameraOrientationNED rdf:parseType="Resource"><drone-skydio:Roll>0.19</drone-skydio:Roll>'
            "<drone-skydio:Pitch>-7.47</drone-skydio:Pitch><drone-skydio:Yaw>127.4</drone-skydio:Yaw>"
            "</drone-skydio:CameraOrientationNED>"
        ),
        (
            '<drone-skydio:CameraOrientationNED><rdf:Description drone-skydio:Roll="0.19" drone-skydio:Pitch="-7.47" '
            'drone-skydio:Yaw="127.4"/></drone-skydio:CameraOrientationNED>'
        ),
    ],
)
def test_skydio(inside: str) -> None:
    other = (
        '<drone-skydio:CameraOrientationFLU drone-skydio:Roll="1" drone-skydio:Pitch="2" drone-skydio:Yaw="3"/>'
        '<drone-skydio:VehicleOrientationNED drone-skydio:Roll="4" drone-skydio:Pitch="5" drone-skydio:Yaw="6"/>'
    )
    given = {
        "drone-skydio:Latitude": "32.2",
        "drone-skydio:Longitude": "-110.9",
        "drone-skydio:AbsoluteAltitude": "1034.4",
    }
    for text in (inside + other, other + inside):
        data = parse_xmp(packet(given, text))
        assert angles(data) == (127.4, -7.47, 0.19)
        assert (data.latitude_deg, data.longitude_deg, data.absolute_altitude_m) == (32.2, -110.9, 1034.4)
        assert "skydio" in data.makers


def test_parrot_wins_over_its_pix4d_tags() -> None:
    parrot = {"drone-parrot:CameraRollDegree": "-0.05", "drone-parrot:CameraPitchDegree": "-51.99"}
    pix4d = {"Camera:Roll": "-0.04", "Camera:Pitch": "38.0", "Camera:Yaw": "146.7"}
    assert angles(parse_xmp(packet(parrot | {"drone-parrot:CameraYawDegree": "146.85"} | pix4d))) == (
        146.85,
        -51.99,
        -0.05,
    )
    # Directions of two makers are never mixed: Parrot's yaw is missing here.
    assert angles(parse_xmp(packet(parrot | pix4d))) == pytest.approx((146.765, -52.0, -0.051), abs=1e-3)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("33,54.0S", -33.9), ("33,54,0S", -33.9), ("33,54.0N", 33.9), ("-33.9", -33.9), ("33.9S", None)],
)
def test_coordinates_with_letters(text: str, expected: float | None) -> None:
    assert parse_xmp(packet({"exif:GPSLatitude": text})).latitude_deg == (expected and pytest.approx(expected))


def test_names_of_other_makers_mean_nothing_elsewhere() -> None:
    assert parse_xmp(packet({"exif:Yaw": "1", "exif:Pitch": "2", "exif:Latitude": "3"})) == XmpData()
