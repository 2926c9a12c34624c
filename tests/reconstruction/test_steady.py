"""A burst's steady photograph and how far leaves moved, on drawn photographs whose motion is known."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.cache import StageCache
from fieldkit.captures import Capture, Photo, read_capture, read_image
from fieldkit.captures.bursts import by_station
from fieldkit.reconstruction.steady import steady_capture, steady_photograph
from fieldkit.runtime.context import Context

WIDTH, HEIGHT = 640, 480
SWAYS = ((0.0, 0.0), (5.0, 2.0), (-4.0, -3.0), (2.0, 4.0), (-3.0, 1.0))
CAMERA = ((0.0, 0.0, 0.0), (9.0, -6.0, 0.4), (-7.0, 4.0, -0.3), (4.0, 12.0, 0.2), (3.0, 5.0, -0.5))


def warped(image: FloatArray, motion: FloatArray) -> FloatArray:
    return np.asarray(cv2.warpAffine(image, motion, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT))


def pictures(*, sways: float, parallax: float = 0.0) -> list[ByteArray]:
    """Textured soil under green bands, which move by so many times SWAYS, each its own way, in a camera that hovers."""
    rng = np.random.default_rng(0)

    def texture() -> FloatArray:
        fine, coarse = (cv2.resize(rng.normal(size=(HEIGHT // n, WIDTH // n)), (WIDTH, HEIGHT)) for n in (2, 8))
        return np.asarray(fine + coarse)

    soil = np.array([105, 85, 70]) + 14.0 * texture()[..., None]
    leaves = [(np.array([60, 130, 50]) + 12.0 * texture()[..., None], 60 + 110 * i) for i in range(5)]
    found = []
    for k, (x, y, turn) in enumerate(CAMERA):
        image = soil.copy()
        for i, (leaf, left) in enumerate(leaves):
            dx, dy = sways * np.roll(SWAYS, i, axis=0)[k] + parallax * np.array([x, y])
            mask = np.zeros((HEIGHT, WIDTH))
            mask[60:420, left : left + 50] = 1.0
            move = np.array([[1, 0, dx], [0, 1, dy]])
            over = warped(mask, move)[..., None]
            image = image * (1 - over) + over * warped(leaf, move)
        hover = cv2.getRotationMatrix2D((WIDTH / 2, HEIGHT / 2), turn, 1.0) + np.array([[0, 0, x], [0, 0, y]])
        image = warped(image, hover)
        found.append(np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8))
    return found


def burst(folder: Path, images: list[ByteArray]) -> tuple[Photo, ...]:
    photos = []
    for i, image in enumerate(images):
        path = folder / f"p{i}.png"
        assert cv2.imwrite(str(path), image[..., ::-1])
        photos.append(Photo(path, path.name, WIDTH, HEIGHT, "PNG", f"{i:064x}"))
    return tuple(photos)


@pytest.mark.parametrize("parallax", [0.0, 0.3])
def test_sway_is_what_moves_beside_the_camera(tmp_path: Path, parallax: float) -> None:
    still = steady_photograph(burst(tmp_path, pictures(sways=0.0, parallax=parallax)))
    moving = steady_photograph(burst(tmp_path, pictures(sways=1.0, parallax=parallax)))
    true = float(np.sqrt(np.var(SWAYS, axis=0, ddof=1).mean()))
    assert still.sway_px < 0.25 * true
    assert moving.sway_px == pytest.approx(true, rel=0.25)
    assert still.agrees.all()
    assert moving.agrees.all()


def test_the_steady_photograph_shows_leaves_and_camera_at_their_mean(tmp_path: Path) -> None:
    images = pictures(sways=1.0)
    steady = steady_photograph(burst(tmp_path, images)).image
    mean = np.mean(SWAYS, axis=0)[0] + np.mean(CAMERA, axis=0)[0]
    off = {"first": _middles(images[0]) - mean, "steady": _middles(steady) - mean}
    rms = {which: float(np.sqrt(np.mean(each**2))) for which, each in off.items()}
    assert rms["first"] > 3.0
    assert rms["steady"] < 0.55 * rms["first"]


def _middles(image: ByteArray) -> FloatArray:
    """Of the five leaves, columns less where they are drawn."""
    green = (image[200:280, :, 1].astype(int) - image[200:280, :, 0] > 30).mean(axis=0) > 0.5
    columns = np.flatnonzero(green)
    drawn = 60 + 110 * np.arange(5) + 24.5
    return np.array([columns[np.abs(columns - middle) < 45].mean() - middle for middle in drawn])


def test_another_view_is_told_and_not_used(tmp_path: Path) -> None:
    images = pictures(sways=0.0)
    other = np.ascontiguousarray(images[1][::-1, ::-1])
    found = steady_photograph(burst(tmp_path, [images[0], other, images[2]]))
    assert found.agrees.tolist() == [True, False, True]
    alone = steady_photograph(burst(tmp_path, [images[0], other]))
    assert np.isnan(alone.sway_px)
    np.testing.assert_array_equal(alone.image, images[0])


class TestCapture:
    def test_pictures_are_files_for_as_long_as_they_are_needed(self, tmp_path: Path) -> None:
        capture, cache = self.capture(tmp_path), StageCache(tmp_path / "cache")
        with steady_capture(capture, Context(cache)) as first:
            (photo,) = first.photos
            made = read_image(photo)
            assert photo.path.parent != capture.image_folder
            assert photo.sway_px is not None
            assert len(photo.burst) == 3
        assert not photo.path.exists()
        with steady_capture(capture, Context(cache)) as again:
            assert again.photos[0].sha256 == photo.sha256
            np.testing.assert_array_equal(read_image(again.photos[0]), made)
        assert [file.name for file in capture.image_folder.iterdir()].count("p0.png") == 1

    def capture(self, tmp_path: Path) -> Capture:
        folder = tmp_path / "capture"
        folder.mkdir()
        photos = burst(folder, pictures(sways=1.0)[:3])
        (folder / "poses.csv").write_text("image,x_m,y_m,z_m\n" + "".join(f"{p.name},0,0,2\n" for p in photos))
        read = by_station(read_capture(folder))
        return replace(read, photos=(replace(read.photos[0], burst=read.photos),))
