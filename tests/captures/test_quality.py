"""Sharpness and exposure, measured on photographs that are spoilt in known ways."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from fieldkit.captures import CameraGroup, Capture, Photo
from fieldkit.captures.quality import (
    DIRECTIONS,
    blur_ratios,
    edge_widths,
    judge_pictures,
    measure_photo,
    measure_picture,
    quality_findings,
)


def texture(seed: int = 0, contrast: float = 1.0) -> np.ndarray:
    """Discs of all sizes and greys: edges of every direction, as sharp as area sampling leaves them."""
    rng = np.random.default_rng(seed)
    image = np.full((600, 800), 128.0, np.float32)
    for _ in range(500):
        center = (int(rng.integers(0, 3200)), int(rng.integers(0, 2400)))
        cv2.circle(image, center, int(rng.integers(20, 120)), float(rng.uniform(20, 235)), -1, cv2.LINE_AA, 2)
    image = 128.0 + contrast * (cv2.GaussianBlur(image, (0, 0), 0.7) - 128.0)
    return np.clip(image + rng.normal(size=image.shape) * 1.5, 0, 255).astype(np.uint8)


def defocused(image: np.ndarray, sigma: float) -> np.ndarray:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), np.uint8)


def moved(image: np.ndarray, length: int) -> np.ndarray:
    """Blurred along x."""
    return cv2.blur(image, (length, 1))


def capture_of(count: int) -> Capture:
    photos = tuple(Photo(Path(f"{k}.jpg"), f"{k}.jpg", 800, 600, "JPEG", f"{k:064x}") for k in range(count))
    group = CameraGroup("camera", tuple(photo.name for photo in photos), None, "self-calibrated", False)
    return Capture(Path(), Path(), photos, (group,), (), {})


class TestSharpness:
    @pytest.mark.parametrize("sigma", [1.5, 2.0, 3.0])
    def test_blur_widens_edges_in_all_directions(self, sigma: float) -> None:
        sharp = edge_widths(texture())
        blurred = edge_widths(defocused(texture(), sigma))
        assert (blurred > 1.25 * sharp).all()
        assert blurred == pytest.approx(np.sqrt(sharp**2 + sigma**2), rel=0.25)

    def test_motion_widens_edges_across_its_way_only(self) -> None:
        ratio = edge_widths(moved(texture(), 9)) / edge_widths(texture())
        along, across = ratio[[0, DIRECTIONS - 1]], ratio[[DIRECTIONS // 2 - 1, DIRECTIONS // 2]]
        assert (along > 1.5).all()
        assert (across < 1.25).all()

    def test_the_blurred_one_stands_out_of_a_set_of_which_two_in_five_are(self) -> None:
        widths = [edge_widths(texture(seed)) for seed in range(3)]
        widths += [edge_widths(moved(texture(seed), 7)) for seed in (3, 4)]
        worst = [float(ratio.max()) for ratio in blur_ratios(widths)]
        assert max(worst[:3]) < 1.25 < min(worst[3:])


class TestPictures:
    @pytest.mark.parametrize(
        ("change", "problem"),
        [
            (lambda i: i, ""),
            (lambda i: cv2.GaussianBlur(i, (0, 0), 2.0), "blurred"),
            (lambda i: (i * 0.35).astype(np.uint8), "too-dark"),
            (lambda i: np.clip(i.astype(float) * 2.5, 0, 255).astype(np.uint8), "too-bright"),
            (lambda i: np.full_like(i, 120), "empty"),
        ],
    )
    def test_one_spoilt_photograph_of_five(self, change: object, problem: str) -> None:
        images = {f"{k}.jpg": texture(k) for k in range(5)}
        images["2.jpg"] = change(images["2.jpg"])
        capture = capture_of(5)
        found = judge_pictures(capture, {n: measure_picture(i) for n, i in images.items()})
        assert {n: v.problem for n, v in found.items()} == {n: problem if n == "2.jpg" else "" for n in images}

    def test_a_capture_out_of_focus_is_blurred_without_a_sharp_one_to_compare(self) -> None:
        pictures = {f"{k}.jpg": measure_picture(defocused(texture(k), 2.5)) for k in range(4)}
        found = judge_pictures(capture_of(4), pictures)
        assert {v.problem for v in found.values()} == {"blurred"}

    def test_a_file_without_pixels_is_unreadable(self, tmp_path: Path) -> None:
        (tmp_path / "a.jpg").write_bytes(b"\xff\xd8\xff")
        pictures = {f"{k}.jpg": measure_picture(texture(k)) for k in range(4)}
        pictures["3.jpg"] = measure_photo(Photo(tmp_path / "a.jpg", "a.jpg", 800, 600, "JPEG", "0" * 64))
        found = quality_findings(judge_pictures(capture_of(4), pictures))
        assert [(finding.subject, finding.code, finding.left_out) for finding in found] == [
            ("3.jpg", "unreadable", False)
        ]
