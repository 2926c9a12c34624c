"""Pixels, and files that are not whole."""

import io
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from fieldkit.captures import read_capture, read_image
from fieldkit.captures.decode import jpeg_is_complete
from tests.captures.photographs import MakePhoto, exif_block, texture


def encoded(format_name: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    texture(3).save(buffer, format=format_name, **options)
    return buffer.getvalue()


def test_png_pixels_are_exact_and_rgb(photo_file: MakePhoto) -> None:
    path = photo_file("a.png", seed=4)
    np.testing.assert_array_equal(read_image(path), np.asarray(texture(4)))
    gray = read_image(path, gray=True)
    luma = np.asarray(texture(4)) @ [0.299, 0.587, 0.114]
    # libpng cuts where others round.
    np.testing.assert_allclose(gray, luma, atol=1.1)


def test_the_orientation_tag_is_not_applied(photo_file: MakePhoto) -> None:
    path = photo_file("a.jpg", exif=exif_block(base={274: 6}))
    (photo,) = read_capture(path.parent).photos
    assert read_image(photo).shape == (photo.height, photo.width, 3) == (90, 120, 3)
    assert photo.orientation == 6


@pytest.mark.parametrize("mode", ["L", "P", "RGBA", "I;16", "CMYK"])
def test_other_pixel_types_become_eight_bit_rgb(tmp_path: Path, mode: str) -> None:
    path = tmp_path / ("a.jpg" if mode == "CMYK" else "a.png")
    if mode == "I;16":
        Image.fromarray(np.linspace(0, 65535, 48 * 64).reshape(48, 64).astype(np.uint16)).save(path)
    else:
        texture(1, 64, 48).convert(mode).save(path)
    image = read_image(path)
    assert (image.shape, image.dtype) == ((48, 64, 3), np.uint8)
    assert image.max() > 150


@pytest.mark.parametrize("side", [64, 100, 160])
def test_shrinking_while_decoding_stays_on_the_pixel_grid(photo_file: MakePhoto, side: int) -> None:
    """Against area averaging of the whole image: the same picture, not shifted."""
    path = photo_file("a.jpg", size=(640, 480), quality=95)
    (photo,) = read_capture(path.parent).photos
    fast = read_image(photo, max_side=side, gray=True).astype(np.float32)
    whole = cv2.resize(read_image(photo, gray=True), fast.shape[::-1], interpolation=cv2.INTER_AREA).astype(np.float32)
    down, right = np.gradient(whole)
    shift = np.linalg.lstsq(np.stack([right.ravel(), down.ravel()], axis=1), (fast - whole).ravel(), rcond=None)[0]
    assert np.abs(shift).max() < 0.01
    assert np.abs(fast - whole).mean() < 1.0


@pytest.mark.parametrize("options", [{}, {"progressive": True}, {"optimize": True, "quality": 30}, {"subsampling": 2}])
def test_complete_jpegs_pass_with_anything_behind_them(options: dict) -> None:
    data = encoded("JPEG", **options)
    assert jpeg_is_complete(data)
    assert jpeg_is_complete(data + b"\0" * 100 + b"vendor data")


@given(st.floats(0, 1, exclude_max=True), st.booleans(), st.integers(0, 300))
def test_jpegs_cut_anywhere_are_noticed(share: float, progressive: bool, zeros: int) -> None:
    data = encoded("JPEG", progressive=progressive)
    cut = data[: int(share * (len(data) - 1))]
    assert not jpeg_is_complete(cut + bytes(zeros))
