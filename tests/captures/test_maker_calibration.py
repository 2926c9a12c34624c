"""DJI's calibration in the XMP: whose it is, at which size, and what is not believed."""

import cv2
import numpy as np
import pytest

from fieldkit.captures import read_capture
from fieldkit.captures.maker_calibration import calibration_of
from tests.captures.photographs import MakePhoto, dji_xmp, exif_block

DATA = "2019-09-10;1913.3,1913.3,1.5,-3.0,-0.3942,0.2456,0.001,-0.002,0.0"
"""As of a Phantom 4 Multispectral, 1600 × 1300."""
MIDDLE = {"center_x": "800.000000", "center_y": "650.000000"}


@pytest.mark.parametrize(
    ("fields", "size", "model", "params"),
    [
        ({}, (1600, 1300), "OPENCV", (1913.3, 1913.3, 801.5, 647.0, -0.3942, 0.2456, 0.001, -0.002)),
        (MIDDLE, (800, 650), "OPENCV", (956.65, 956.65, 400.75, 323.5, -0.3942, 0.2456, 0.001, -0.002)),
        ({"dewarp_flag": "1"}, (1600, 1300), "PINHOLE", (1913.3, 1913.3, 801.5, 647.0)),
        (MIDDLE, (1600, 900), "", ()),  # a crop of it
        ({"dewarp_flag": ""}, (1600, 1300), "", ()),
        ({"dewarp": DATA.replace("1913.3", "19.1")}, (1600, 1300), "", ()),
        ({"dewarp": DATA.replace("-0.3942", "-39.42")}, (1600, 1300), "", ()),
        ({"dewarp": DATA.replace("1.5", "nan")}, (1600, 1300), "", ()),
        ({"dewarp": "2019-09-10;1913.3,1913.3"}, (1600, 1300), "", ()),
    ],
)
def test_what_is_made_of_it(fields, size, model, params) -> None:
    found = calibration_of({"dewarp_flag": "0", "dewarp": DATA, **fields}, *size)
    assert ("" if found is None else found.model) == model
    assert (() if found is None else found.params) == pytest.approx(params)


def test_k3_goes_into_the_others_to_a_pixel() -> None:
    camera = calibration_of({"dewarp_flag": "0", "dewarp": DATA[:-3] + "-0.1219"}, 1600, 1300)
    matrix = np.array([[1913.3, 0.0, 801.5], [0.0, 1913.3, 647.0], [0.0, 0.0, 1.0]])
    rays = np.random.default_rng(0).uniform((-0.41, -0.33, 1.0), (0.41, 0.33, 1.0), (400, 3))
    bend = np.array([-0.3942, 0.2456, 0.001, -0.002, -0.1219])
    truth = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, bend)[0].reshape(-1, 2)
    assert np.abs(camera.project(rays) - truth).max() < 1.0


def test_a_photographs_own_is_its_cameras(photo_file: MakePhoto) -> None:
    data = {"DewarpFlag": "0", "DewarpData": "2024-01-01;60.0,60.0,0.5,0.0,-0.1,0.0,0.0,0.0,0.0"}
    for name in ("a.jpg", "b.jpg"):
        folder = photo_file(name, size=(64, 48), xmp=dji_xmp(**data)).parent
    (group,) = read_capture(folder).groups
    assert (group.source, group.fixed, group.photos) == ("XMP", False, ("a.jpg", "b.jpg"))
    assert group.intrinsics.params == pytest.approx((60.0, 60.0, 32.5, 24.0, -0.1, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("focal", "x", "used"),
    [
        ("63.0", "32.0", 63.0),
        ("126.0", "64.0", 63.0),
        ("83.0", "32.0", 35 * 80 / 43.2666),
        ("63.0", "", 35 * 80 / 43.2666),
    ],
)
def test_a_designed_focal_length_that_contradicts_the_exif_is_not_used(photo_file: MakePhoto, focal, x, used) -> None:
    xmp = dji_xmp(CalibratedFocalLength=focal, CalibratedOpticalCenterX=x, CalibratedOpticalCenterY="48.0")
    capture = read_capture(photo_file("a.jpg", size=(64, 48), exif=exif_block(detail={41989: 35}), xmp=xmp).parent)
    assert capture.groups[0].intrinsics.fx == pytest.approx(used, rel=1e-4)
    assert ("focal-implausible" in {f.code for f in capture.findings}) is (focal == "83.0")


def test_a_panorama_is_no_photograph(photo_file: MakePhoto) -> None:
    photo_file("a.jpg", size=(64, 48))
    folder = photo_file("p.jpg", size=(64, 32), xmp=dji_xmp(prefix="GPano", ProjectionType="equirectangular")).parent
    capture = read_capture(folder)
    assert capture.names == ("a.jpg",)
    assert [(f.subject, f.code, f.left_out) for f in capture.findings] == [("p.jpg", "other-camera", True)]
