"""Photographs of several lenses, bands and cameras in one folder: one camera's make a capture, the others are named."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from fieldkit.captures import Capture, read_capture
from fieldkit.captures.one_camera import sensor_of
from fieldkit.results.finding import Finding
from tests.captures.photographs import MakePhoto, dji_xmp, exif_block

WIDE, ZOOM, THERMAL = (160, 120), (128, 96), (64, 51)


def dji(model: str = "M3T", focal: float = 4.4, serial: str | None = None) -> Image.Exif:
    return exif_block(base={271: "DJI", 272: model}, detail={37386: focal} | ({42033: serial} if serial else {}))


def others(capture: Capture) -> list[Finding]:
    assert all(finding.left_out for finding in capture.findings if finding.code == "other-camera")
    return [finding for finding in capture.findings if finding.code == "other-camera"]


@pytest.mark.parametrize(
    ("name", "sensor"),
    [
        ("DJI_20230601101010_0001_W.JPG", "wide"),
        ("DJI_20230601101010_0001_Z.JPG", "zoom"),
        ("DJI_20230601101010_0001_T.JPG", "thermal"),
        ("DJI_20230601101010_0001_V.JPG", "visible"),
        ("DJI_20230601101010_0001_D.JPG", "visible"),
        ("DJI_20230601101010_0001_S.JPG", "split screen"),
        ("DJI_20230601101010_0001_T_Waypoint1.JPG", "thermal"),
        ("DJI_0001_T.JPG", "thermal"),
        ("dji_0001_t.jpg", "thermal"),
        ("DJI_0001_R.JPG", "thermal"),
        ("101MEDIA/DJI_0001_T.JPG", "thermal"),
        ("DJI_20230601101010_0001_MS_G.TIF", "green"),
        ("DJI_20230601101010_0001_MS_R.TIF", "red"),
        ("DJI_20230601101010_0001_MS_RE.TIF", "red edge"),
        ("DJI_20230601101010_0001_MS_NIR.TIF", "near infrared"),
        ("DJI_0001.JPG", ""),
        ("DJI_20230601101010_0001.JPG", ""),
        ("plot_W.jpg", ""),
        ("T.jpg", ""),
        ("north_red.jpg", ""),
        ("IMG_0001_1.jpg", ""),
    ],
)
def test_names_of_files(name: str, sensor: str) -> None:
    assert sensor_of(name, None, (), "RGB") == sensor


@pytest.mark.parametrize(
    ("source", "bands", "mode", "sensor"),
    [
        ("InfraredCamera", (), "RGB", "thermal"),
        ("WideCamera", (), "RGB", "wide"),
        ("ZoomCamera", (), "RGB", "zoom"),
        ("VisibleCamera", (), "RGB", "visible"),
        ("RGB_CAMERA", (), "RGB", "visible"),
        ("MS_NIR_CAMERA", ("NIR",), "I;16", "near infrared"),
        ("MS_RE_CAMERA", (), "I;16", "red edge"),
        ("MS_G_CAMERA", (), "I;16", "green"),
        (None, ("Red edge",), "I;16", "red edge"),
        (None, ("RedEdge",), "I;16", "red edge"),
        (None, ("Red edge-705",), "I;16", "red edge"),
        (None, ("Green-531",), "I;16", "green"),
        (None, ("Panchro",), "I;16", "panchromatic"),
        (None, ("LWIR",), "I;16", "thermal"),
        (None, ("Red", "Green", "Blue"), "RGB", "visible"),
        (None, ("Red", "Green", "NIR"), "RGB", "red and green and near infrared"),
        ("Default", (), "RGB", ""),
        (None, (), "L", "grey"),
        (None, (), "I;16B", "grey"),
    ],
)
def test_what_the_metadata_say(source: str | None, bands: tuple[str, ...], mode: str, sensor: str) -> None:
    assert sensor_of("x.tif", source, bands, mode) == sensor


def three_lenses(photo_file: MakePhoto, count: int = 4, *, named: bool = True) -> Path:
    """A DJI payload's photographs, told by their names or by XMP ImageSource only."""
    lenses: Mapping[str, tuple[str, tuple[int, int], float]] = {
        "T": ("InfraredCamera", THERMAL, 9.1),
        "W": ("WideCamera", WIDE, 4.4),
        "Z": ("ZoomCamera", ZOOM, 30.0),
    }
    path = Path()
    for number in range(count):
        for k, (letter, (source, size, focal)) in enumerate(lenses.items()):
            name = f"DJI_{number:04}_{letter}.JPG" if named else f"DJI_{3 * number + k:04}.JPG"
            xmp = {} if named else {"xmp": dji_xmp(ImageSource=source)}
            path = photo_file(name, size=size, exif=dji(focal=focal), **xmp)
    return path.parent


@pytest.mark.parametrize("named", [True, False])
def test_the_wide_camera_of_three_makes_the_capture(photo_file: MakePhoto, named: bool) -> None:
    capture = read_capture(three_lenses(photo_file, named=named))
    assert {(photo.width, photo.height) for photo in capture.photos} == {WIDE}
    assert len(capture.photos) == 4
    assert len(capture.groups) == 1
    thermal, zoom = others(capture)
    assert thermal.message.startswith("4 photographs, up to DJI_00")
    assert "of the thermal camera (DJI M3T, 9.1 mm, 64×51)" in thermal.message
    assert "here of the wide camera (DJI M3T, 4.4 mm, 160×120)" in thermal.message
    assert "of the zoom camera (DJI M3T, 30 mm, 128×96)" in zoom.message
    assert "folder of their own" in zoom.message
    assert [finding.code for finding in capture.findings] == ["other-camera", "other-camera"]


def test_small_pictures_that_nothing_names_are_not_taken(photo_file: MakePhoto) -> None:
    for number in range(3):  # as Autel names and writes them
        photo_file(f"IRX_{number:04}.jpg", size=(40, 32), exif=dji("XT705", 9.1))
        path = photo_file(f"MAX_{number:04}.jpg", size=WIDE, exif=dji("XT705"))
    capture = read_capture(path.parent)
    assert {(photo.width, photo.height) for photo in capture.photos} == {WIDE}
    assert len(others(capture)) == 1


def test_a_folder_of_thermal_pictures_is_said_to_be_one(photo_file: MakePhoto) -> None:
    folder = three_lenses(photo_file)
    for path in folder.glob("*_[WZ].JPG"):
        path.unlink()
    capture = read_capture(folder)
    assert len(capture.photos) == 4
    (finding,) = capture.findings
    assert (finding.code, finding.left_out) == ("no-colours", False)
    assert "4 photographs are of the thermal camera" in finding.message


def test_a_camera_file_that_names_lenses_keeps_them(photo_file: MakePhoto) -> None:
    folder = three_lenses(photo_file)
    cameras = "".join(
        f'[[cameras]]\nmodel = "SIMPLE_PINHOLE"\nwidth = {w}\nheight = {h}\nparams = [200, 60, 45]\n'
        f'images = ["*_{k}.*"]\n'
        for k, (w, h) in {"W": WIDE, "Z": ZOOM, "T": THERMAL}.items()
    )
    (folder / "camera.toml").write_text(cameras, "utf-8")
    capture = read_capture(folder)
    assert {photo.sensor for photo in capture.photos} == {"wide", "zoom"}  # never thermal pictures among colours
    assert "thermal" in others(capture)[0].message
    (folder / "camera.toml").write_text(cameras[cameras.rindex("[[cameras]]") :], "utf-8")
    assert {photo.sensor for photo in read_capture(folder).photos} == {"thermal"}


def bands(folder: Path, names: list[str], *, count: int = 3) -> None:
    rng = np.random.default_rng(0)
    for number in range(count):
        for name in names:
            pixels = rng.integers(0, 65535, (90, 120), dtype=np.uint16)
            Image.fromarray(pixels).save(folder / name.format(number))


@pytest.mark.parametrize(
    ("colour", "others_names"),
    [
        ("DJI_20230601_{:04}_D.JPG", [f"DJI_20230601_{{:04}}_MS_{band}.TIF" for band in ("G", "R", "RE", "NIR")]),
        (
            "IMG_160917_131713_{:04}_RGB.JPG",
            [f"IMG_160917_131713_{{:04}}_{b}.TIF" for b in ("GRE", "RED", "REG", "NIR")],
        ),
        ("DJI_{:03}0.JPG", [f"DJI_{{:03}}{band}.TIF" for band in range(1, 6)]),  # Phantom 4 Multispectral
    ],
)
def test_bands_do_not_mix_with_colours(photo_file: MakePhoto, colour: str, others_names: list[str]) -> None:
    for number in range(3):
        folder = photo_file(colour.format(number), exif=dji("FC")).parent
    bands(folder, others_names)
    capture = read_capture(folder)
    assert len(capture.photos) == 3
    assert {photo.format for photo in capture.photos} == {"JPEG"}
    assert len(others(capture)) in (1, len(others_names))  # one where nothing tells the bands apart


@pytest.mark.parametrize(
    ("options", "kept"),
    [
        ({"exif": dji("FC6310")}, False),  # another model
        ({"exif": dji(focal=29.9)}, False),  # another lens of the same
        ({"exif": None, "size": (32, 24)}, False),  # a preview, or a camera that says nothing
        ({"exif": dji(serial="2")}, True),  # another drone of the model
        ({"exif": dji(), "size": WIDE[::-1]}, True),  # turned
        ({"exif": dji(), "size": (100, 75)}, True),  # smaller
        ({"exif": dji(focal=4.5)}, True),  # rounded otherwise
        ({"exif": None}, True),  # without EXIF
        ({"exif": dji("DJI M3T")}, True),
        ({"exif": dji(), "xmp": dji_xmp(ImageSource="WideCamera")}, True),  # an app has stripped the others' XMP
    ],
)
def test_cameras_differ_in_model_and_lens(photo_file: MakePhoto, options: dict[str, Any], kept: bool) -> None:
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        photo_file(name, size=WIDE, exif=dji(serial="1"))
    options = {"size": WIDE} | {key: value for key, value in options.items() if value is not None}
    capture = read_capture(photo_file("d.jpg", **options).parent)
    assert ("d.jpg" in capture.names) is kept
    assert bool(others(capture)) is not kept
