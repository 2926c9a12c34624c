"""Markers in rendered images: found, read, and their corners in the right place."""

import cv2
import numpy as np
import pytest

from fieldkit.captures.markers_file import marker_dictionary
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.marker_detection import detect_markers, refine_corners
from tests.reconstruction.synthetic import Board, marker_board, render_board

CAMERA = Intrinsics("PINHOLE", 480, 360, (450.0, 450.0, 241.3, 178.9))
CENTERS = {0: (0.15, 0.15), 3: (0.45, 0.15), 7: (0.15, 0.4), 11: (0.45, 0.4)}


@pytest.fixture(scope="module", params=["DICT_4X4_50", "DICT_APRILTAG_36h11"])
def board(request: pytest.FixtureRequest) -> tuple[str, Board]:
    return request.param, marker_board(request.param, CENTERS, 0.12, (0.6, 0.55))


@pytest.mark.parametrize("blur", [0.5, 1.0])
@pytest.mark.parametrize("place", [(0.35, 0.2, 0.85), (-0.1, -0.1, 0.8)])
def test_corners_are_where_the_camera_sees_them(
    board: tuple[str, Board], place: tuple[float, float, float], blur: float
) -> None:
    name, markers = board
    pose = Pose.look_at(place, (0.31, 0.27, 0))
    found = detect_markers(render_board(markers, pose, CAMERA, blur=blur), name)
    assert [detection.id for detection in found] == [0, 3, 7, 11]
    error = np.concatenate([d.corners - CAMERA.project(pose.to_camera(markers.corners[d.id])) for d in found])
    assert np.abs(error).max() < 0.2
    assert np.sqrt(np.mean(error**2)) < 0.06
    # A bias in length would be a bias in scale; cornerSubPix draws these corners in by a quarter to half a pixel.
    for detection in found:
        truth = CAMERA.project(pose.to_camera(markers.corners[detection.id]))
        ratio = _perimeter(detection.corners) / _perimeter(truth)
        assert ratio == pytest.approx(1.0, abs=0.0015)


def _perimeter(corners: np.ndarray) -> float:
    return float(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1).sum())


def test_the_same_number_twice_is_left_out() -> None:
    book = marker_dictionary("DICT_4X4_50")
    image = np.full((200, 500), 255, np.uint8)
    for number, left in ((4, 40), (9, 190), (4, 340)):
        image[50:146, left : left + 96] = cv2.aruco.generateImageMarker(book, number, 96)
    assert [detection.id for detection in detect_markers(image, "DICT_4X4_50")] == [9]


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_corners_start_at_the_printed_upper_left(turn: int) -> None:
    image = np.full((160, 160), 255, np.uint8)
    image[40:112, 30:102] = cv2.aruco.generateImageMarker(marker_dictionary("DICT_4X4_50"), 5, 72)
    (detection,) = detect_markers(np.ascontiguousarray(np.rot90(image, turn)), "DICT_4X4_50")
    square = np.array([[30.0, 40.0], [102.0, 40.0], [102.0, 112.0], [30.0, 112.0]])
    for _ in range(turn):
        square = np.column_stack([square[:, 1], 160 - square[:, 0]])
    assert detection.corners == pytest.approx(square, abs=0.05)


@pytest.mark.parametrize("shape", [(1, 1), (12, 300), (90, 120)])
def test_images_without_markers(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    for image in (np.zeros(shape, np.uint8), rng.integers(0, 256, shape).astype(np.uint8)):
        assert detect_markers(image, "DICT_6X6_50") == []


def test_the_same_image_gives_the_same_bits() -> None:
    markers = marker_board("DICT_4X4_50", CENTERS, 0.12, (0.6, 0.55))
    image = render_board(markers, Pose.look_at((0.3, 0.2, 0.8), (0.3, 0.28, 0)), CAMERA)
    first, second = (detect_markers(image, "DICT_4X4_50") for _ in range(2))
    assert len(first) == 4
    assert all(a.corners.tobytes() == b.corners.tobytes() for a, b in zip(first, second, strict=True))


def test_corners_without_contrast_stay_as_they_are() -> None:
    given = np.array([[10.0, 10.0], [50.0, 10.0], [50.0, 50.0], [10.0, 50.0]])
    assert np.array_equal(refine_corners(np.full((64, 64), 128, np.uint8), given, 6), given)
