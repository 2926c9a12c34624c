"""Which source of positions counts, in which frame, how exact."""

from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures import Capture, read_capture
from fieldkit.captures.priors import unit_doubt
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import LocalFrame, utm_epsg_of
from fieldkit.reconstruction.known_poses import known_poses
from tests.captures.photographs import MakePhoto, dji_xmp, exif_block, gps_tags

FRAME = LocalFrame(52.0, 13.0, 100.0)
PLACES = {f"{letter}.jpg": (8.0 * i, 3.0 * (i % 2), 20.0 + 0.1 * i) for i, letter in enumerate("abcdef")}


def geotagged(photo_file: MakePhoto, *, absolute_noise: float = 0.0, names: str = "abcdef", **xmp: str) -> Path:
    """Photographs at PLACES above FRAME, as a DJI drone would tag them."""
    rng = np.random.default_rng(0)
    folder = Path()
    for name, place in PLACES.items():
        if name[0] not in names:
            continue
        (latitude,), (longitude,), (altitude,) = FRAME.to_geodetic([place])
        exif = exif_block(gps=gps_tags(latitude, longitude, round(altitude + rng.normal(0, absolute_noise), 3)))
        fields = {"GimbalYawDegree": "90.0", "GimbalPitchDegree": "-60.0", "GimbalRollDegree": "0.0"}
        fields |= {"RelativeAltitude": f"{place[2]:+.2f}"} | xmp
        folder = photo_file(name, exif=exif, xmp=dji_xmp(**fields)).parent
    return folder


def positions(capture: Capture) -> np.ndarray:
    return np.array([capture.priors[name].position for name in capture.names], dtype=float)


def codes(capture: Capture) -> set[tuple[str, str]]:
    return {(finding.subject, finding.code) for finding in capture.findings}


def test_gps_becomes_east_north_up_metres_about_the_centroid(photo_file: MakePhoto) -> None:
    capture = read_capture(geotagged(photo_file))
    truth = np.array(list(PLACES.values()))
    assert (capture.metric_source, utm_epsg_of(capture.origin)) == ("EXIF GPS", 32633)
    assert (capture.origin.datum, capture.height_source) == ("sea level", "relative altitude")
    np.testing.assert_allclose(positions(capture), truth - truth.mean(0), atol=2e-3)
    prior = capture.priors["a.jpg"]
    assert (prior.yaw_deg, prior.pitch_deg, prior.roll_deg, prior.angle_sigma_deg) == (90.0, -60.0, 0.0, 3.0)
    assert (prior.position_sigma_m, prior.source) == (3.0, "EXIF GPS")
    assert capture.findings == ()


def test_a_receivers_jump_between_flights_can_be_taken_out(photo_file: MakePhoto) -> None:
    """The other heights, if the matches fit them better: those above the one take-off place."""
    folder = geotagged(photo_file)
    names = ("a.jpg", "b.jpg", "c.jpg")
    for name in names:
        (latitude,), (longitude,), (altitude,) = FRAME.to_geodetic([PLACES[name]])
        exif = exif_block(gps=gps_tags(latitude, longitude, round(altitude + 15.0, 3)))
        photo_file(name, exif=exif, xmp=dji_xmp(RelativeAltitude=f"{PLACES[name][2]:+.2f}"))
    capture = read_capture(folder)
    known = known_poses(capture).raised(capture.to_take_off_m)
    heights = np.array([known.by_name[name].position[2] for name in capture.names])
    truth = np.array([place[2] for place in PLACES.values()])
    np.testing.assert_allclose(heights - heights.mean(), truth - truth.mean(), atol=2e-3)
    assert np.ptp(positions(capture)[:, 2]) > 14.0


@pytest.mark.parametrize(("yaw", "told"), [("90.0", True), ("91.5", True), ("150.0", False)])
def test_a_place_that_repeats_is_doubted_where_the_camera_did_not_turn(photo_file: MakePhoto, yaw, told) -> None:
    folder = geotagged(photo_file)
    (latitude,), (longitude,), (altitude,) = FRAME.to_geodetic([PLACES["b.jpg"]])
    xmp = dji_xmp(RelativeAltitude="+20.20", GimbalYawDegree=yaw, GimbalPitchDegree="-60.0")
    photo_file("c.jpg", exif=exif_block(gps=gps_tags(latitude, longitude, round(altitude, 3))), xmp=xmp)
    capture = read_capture(folder)
    assert (("c.jpg", "gps-repeated") in codes(capture)) == told
    assert capture.priors["c.jpg"].position_sigma_m == pytest.approx(8.54 if told else 3.0, abs=0.1)
    assert capture.priors["d.jpg"].position_sigma_m == 3.0


def test_rtk_heights_are_used_as_they_are_and_never_believed_better_than_three_centimetres(photo_file) -> None:
    for options, sigma_m in (({"RtkStdHgt": "0.045", "RtkStdLon": "0.01"}, 0.045), ({"RtkStdLon": "0.005"}, 0.03)):
        capture = read_capture(geotagged(photo_file, RtkFlag="50", AltitudeType="RtkAlt", **options))
        assert (capture.height_source, capture.origin.datum) == ("RTK altitude", "ellipsoid")
        assert capture.priors["a.jpg"].position_sigma_m == sigma_m


def test_geo_txt_comes_before_gps_and_keeps_xmp_angles(photo_file: MakePhoto) -> None:
    folder = geotagged(photo_file)
    rows = ["EPSG:4326"]
    for name, place in PLACES.items():
        (latitude,), (longitude,), (altitude,) = FRAME.to_geodetic([np.array(place) * 2])
        rows.append(f"{name} {longitude:.10f} {latitude:.10f} {altitude:.4f} 0 0 0 0.02 0.04")
    (folder / "geo.txt").write_text("\n".join(rows))
    capture = read_capture(folder)
    truth = 2 * np.array(list(PLACES.values()))
    assert capture.metric_source == "geo.txt"
    np.testing.assert_allclose(positions(capture), truth - truth.mean(0), atol=1e-3)
    prior = capture.priors["a.jpg"]
    assert (prior.position_sigma_m, prior.yaw_deg, prior.source) == (0.04, 90.0, "geo.txt")


def test_poses_csv_comes_first_and_takes_no_angles_from_elsewhere(photo_file: MakePhoto) -> None:
    folder = geotagged(photo_file)
    lines = [f"{name},{x},{y},{z}" for name, (x, y, z) in PLACES.items()]
    (folder / "poses.csv").write_text("image,x_m,y_m,z_m\n" + "\n".join(lines))
    (folder / "geo.txt").write_text("nonsense that is not even read\n")
    capture = read_capture(folder)
    assert (capture.metric_source, capture.origin) == ("poses.csv", None)
    np.testing.assert_array_equal(positions(capture), list(PLACES.values()))
    prior = capture.priors["a.jpg"]
    assert (prior.position_sigma_m, prior.angles, prior.rotation) == (0.05, None, None)
    assert codes(capture) == {("geo.txt", "sidecar-unused")}


def test_rows_and_photographs_that_do_not_meet_are_named(photo_file: MakePhoto) -> None:
    for name in ("a.jpg", "b.jpg", "c.jpg", "d.jpg"):
        folder = photo_file(name).parent
    text = "image,x_m,y_m,z_m,yaw_deg,pitch_deg,accuracy_m\n"
    text += "a.jpg,0,0,1,10,-45,0.01\nB.JPG,1,0,1,,,\nimages/c.jpg,2,0,1,,,\nmissing.jpg,3,0,1,,,\n"
    (folder / "poses.csv").write_text(text)
    capture = read_capture(folder)
    assert codes(capture) == {("missing.jpg", "pose-without-photo"), ("d.jpg", "photo-without-pose")}
    assert list(capture.priors) == ["a.jpg", "b.jpg", "c.jpg"]
    assert capture.priors["a.jpg"].position_sigma_m == 0.01
    assert (capture.priors["a.jpg"].pitch_deg, capture.priors["a.jpg"].angle_sigma_deg) == (-45.0, 3.0)


@pytest.mark.parametrize(("name", "header"), [("poses.csv", "image,x_m,y_m,z_m"), ("geo.txt", "EPSG:4326")])
def test_a_sidecar_of_another_capture_is_refused(photo_file: MakePhoto, name: str, header: str) -> None:
    folder = photo_file("a.jpg").parent
    line = "other.jpg,1,2,3" if name == "poses.csv" else "other.jpg 13 52 30"
    (folder / name).write_text(f"{header}\n{line}\n")
    with pytest.raises(MetadataError, match=r"names no photograph.*other\.jpg.*a\.jpg") as caught:
        read_capture(folder)
    assert caught.value.path == folder / name


def _circle(radius: float, count: int = 60) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)


@pytest.mark.parametrize(
    ("radius", "doubted"), [(0.3, False), (3.0, False), (30.0, False), (300.0, True), (0.003, True)]
)
def test_a_rig_in_millimetres_is_noticed_by_its_spacing(radius: float, doubted: bool) -> None:
    assert bool(unit_doubt(_circle(radius))) == doubted


def test_poses_in_degrees_are_georeferenced(photo_file: MakePhoto) -> None:
    rows = []
    for k, (latitude, longitude) in enumerate([(46.8426, -91.994), (46.8427, -91.994), (46.8426, -91.9939)]):
        xmp = dji_xmp(GimbalYawDegree="30", GimbalPitchDegree="-90")
        folder = photo_file(f"{k}.jpg", seed=k, xmp=xmp).parent
        rows.append(f"{k},{longitude},{latitude},198.5,{'' if k else 200},{'' if k else -80},0.04\n")
    header = "#Label,X/Longitude,Y/Latitude,Z/Altitude,Yaw,Pitch,Accuracy_(m)\n"
    (folder / "poses.csv").write_text(header + "".join(rows))
    capture = read_capture(folder)
    assert capture.metric_source == "poses.csv"
    assert (capture.origin.latitude_deg, capture.origin.longitude_deg) == pytest.approx((46.84263, -91.99397), abs=1e-5)
    north = np.subtract(capture.priors["1.jpg"].position, capture.priors["0.jpg"].position)
    east = np.subtract(capture.priors["2.jpg"].position, capture.priors["0.jpg"].position)
    assert north == pytest.approx([0, 11.12, 0], abs=0.01)
    assert east == pytest.approx([7.62, 0, 0], abs=0.01)
    assert [capture.priors[f"{k}.jpg"].yaw_deg for k in range(3)] == [200.0, 30.0, 30.0]
    assert capture.priors["0.jpg"].position_sigma_m == 0.04


def test_angles_of_zero_in_all_photographs_are_none(photo_file: MakePhoto) -> None:
    zeros = {"GimbalYawDegree": "+0.00", "GimbalPitchDegree": "+0.00", "GimbalRollDegree": "+0.00"}
    capture = read_capture(geotagged(photo_file, **zeros))
    assert codes(capture) == {("a.jpg", "angles-zero")}
    assert {(p.angles, p.rotation) for p in capture.priors.values()} == {(None, None)}
    capture = read_capture(geotagged(photo_file, GimbalRollDegree="+0.00", GimbalYawDegree="+0.00"))
    assert capture.priors["a.jpg"].pitch_deg == -60.0


def test_a_stated_horizontal_accuracy_never_makes_a_barometric_height_exact(photo_file: MakePhoto) -> None:
    capture = read_capture(geotagged(photo_file, RtkStdLon="0.02", RtkStdHgt="1.5"))
    assert capture.height_source == "relative altitude"
    assert capture.priors["a.jpg"].position_sigma_m == 0.3
