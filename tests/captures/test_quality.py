"""Sharpness and exposure."""

import os

import cv2
import numpy as np
import pytest

from fieldkit.captures import assess_quality, flag_set, measure_quality, quality_findings, read_capture, read_image
from fieldkit.captures.decode import decoders_complaints
from tests.captures.photographs import MakePhoto, texture


def gray_texture(seed: int = 0, width: int = 400, height: int = 300) -> np.ndarray:
    return cv2.cvtColor(np.asarray(texture(seed, width, height)), cv2.COLOR_RGB2GRAY)


def motion_blur(gray: np.ndarray, length: int) -> np.ndarray:
    return cv2.filter2D(gray, -1, np.full((1, length), 1 / length, np.float32))


def test_a_larger_copy_of_the_same_picture_is_as_sharp() -> None:
    large = gray_texture(0, 2048, 1536)
    small = cv2.resize(large, (1024, 768), interpolation=cv2.INTER_AREA)
    assert measure_quality(large).sharpness == pytest.approx(measure_quality(small).sharpness, rel=0.01)


@pytest.mark.parametrize(
    ("value", "flags"), [(0, {"empty", "under-exposed"}), (128, {"empty"}), (255, {"empty", "over-exposed"})]
)
def test_blank_images(value: int, flags: set[str]) -> None:
    assert set(measure_quality(np.full((90, 120), value, np.uint8)).flags) == flags


def test_exposure() -> None:
    gray = gray_texture().astype(float)
    dark = measure_quality(np.clip(gray / 10 - 12, 0, 255).astype(np.uint8))
    bright = measure_quality(np.clip(gray * 1.5 + 110, 0, 255).astype(np.uint8))
    assert dark.clipped_dark > 0.5
    assert "under-exposed" in dark.flags
    assert bright.clipped_bright > 0.5
    assert "over-exposed" in bright.flags


def test_a_plant_before_black_cloth_is_well_exposed() -> None:
    gray = np.zeros((300, 400), np.uint8)
    gray[100:200, 150:250] = gray_texture()[100:200, 150:250]
    quality = measure_quality(gray)
    assert quality.clipped_dark > 0.8
    assert quality.flags == ()


def test_a_blurred_image_stands_out_from_its_set() -> None:
    qualities = {str(seed): measure_quality(gray_texture(seed)) for seed in range(5)}
    qualities["blurred"] = measure_quality(motion_blur(gray_texture(9), 9))
    qualities["glare"] = measure_quality(np.clip(gray_texture(8).astype(int) + 110, 0, 255).astype(np.uint8))
    flagged = flag_set(qualities)
    assert {name: quality.flags for name, quality in flagged.items() if quality.flags} == {
        "blurred": ("blurred",),
        "glare": ("over-exposed",),
    }
    assert [(finding.subject, finding.code, finding.left_out) for finding in quality_findings(flagged)] == [
        ("blurred", "blurred", False),
        ("glare", "over-exposed", False),
    ]


def test_cameras_are_judged_apart_and_masks_are_used(photo_file: MakePhoto) -> None:
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        photo_file(name)
    soft = cv2.GaussianBlur(np.asarray(texture(5, 160, 90)), (0, 0), 3)
    path = photo_file("d.png")
    cv2.imwrite(str(path), soft)
    mask = np.zeros((90, 120), np.uint8)
    mask[:10, :10] = 255
    cv2.imwrite(str(path.parent / "a.mask.png"), mask)
    (path.parent / "b.mask.png").write_bytes(b"not a mask")
    capture = read_capture(path.parent)
    quality = assess_quality(capture)
    assert list(quality) == list(capture.names)
    assert all(quality[name].flags == () for name in ("a.jpg", "b.jpg", "c.jpg"))
    assert "blurred" not in quality["d.png"].flags or quality["d.png"].sharpness < 3
    grey = {name: read_image(capture.photo(name), gray=True) for name in ("a.jpg", "c.jpg")}
    assert quality["a.jpg"] == measure_quality(grey["a.jpg"], mask > 0) != measure_quality(grey["a.jpg"])
    assert quality["c.jpg"] == measure_quality(grey["c.jpg"]) != measure_quality(grey["c.jpg"], mask > 0)


def test_damage_that_the_decoder_reports_is_told_by_file(photo_file: MakePhoto, capfd) -> None:
    for name in "abcd":
        path = photo_file(f"{name}.jpg", size=(640, 480))
    data = bytearray(path.read_bytes())
    del data[len(data) // 2 : len(data) // 2 + 500]
    path.write_bytes(bytes(data))
    assert [(f.subject, f.code) for f in quality_findings(assess_quality(read_capture(path.parent)))] == [
        ("d.jpg", "damaged")
    ]
    capfd.readouterr()
    with decoders_complaints() as complaints:
        os.write(2, b"another library's words\nCorrupt JPEG data: 3 extraneous bytes\n")
    assert complaints == ["Corrupt JPEG data: 3 extraneous bytes"]
    assert capfd.readouterr().err == "another library's words\n"
