"""Metric scale from markers: right, robust, and clear about what disagrees."""

import cv2
import numpy as np
import pytest

from fieldkit.captures.markers_file import MarkerDistance, MarkersFile, marker_dictionary
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.reconstruction.markers import MarkerDetection, MarkerScale, detect_markers, marker_scale
from tests.reconstruction.synthetic import Board, marker_board, render_board

CAMERA = Intrinsics("SIMPLE_RADIAL", 1600, 1200, (1500.0, 800.0, 600.0, -0.05))
SIDE_M = 0.12
CENTERS = {0: (0.15, 0.15), 3: (1.45, 0.15), 7: (0.15, 1.0), 11: (1.45, 1.0), 20: (0.8, 0.6)}
PLACES = [(-0.3, -0.4, 1.5), (1.9, -0.3, 1.4), (1.8, 1.5, 1.6), (-0.2, 1.6, 1.5), (0.8, 0.5, 2.0), (0.7, -0.8, 1.2)]
POSES = {f"{i}.jpg": Pose.look_at(place, (0.8, 0.55, 0)) for i, place in enumerate(PLACES)}
CAMERAS = dict.fromkeys(POSES, CAMERA)
MODEL = Similarity(1 / 3.7, rotation_from_vector([0.4, -1.1, 0.3]), np.array([5.0, -2.0, 8.0]))
UNSCALED = {name: MODEL.apply_pose(pose) for name, pose in POSES.items()}
SIDE = MarkersFile("DICT_4X4_50", SIDE_M)


def corners(center: tuple[float, float]) -> np.ndarray:
    half = SIDE_M / 2
    return np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]]) + np.array([*center, 0.0])


def detections(noise: float = 0.1, seed: int = 0) -> dict[str, list[MarkerDetection]]:
    rng = np.random.default_rng(seed)
    return {
        name: [
            MarkerDetection(n, CAMERA.project(pose.to_camera(corners(c))) + rng.normal(0, noise, (4, 2)))
            for n, c in CENTERS.items()
        ]
        for name, pose in POSES.items()
    }


def between(a: int, b: int, factor: float = 1.0) -> MarkerDistance:
    return MarkerDistance(a, b, factor * float(np.hypot(*np.subtract(CENTERS[a], CENTERS[b]))))


def scale_of(markers: MarkersFile, found: dict[str, list[MarkerDetection]] | None = None) -> MarkerScale:
    return marker_scale(detections() if found is None else found, UNSCALED, CAMERAS, markers, seed=0)


def test_from_photographs_to_metres() -> None:
    camera = Intrinsics("SIMPLE_RADIAL", 480, 360, (450.0, 242.0, 178.0, -0.08))
    board = marker_board("DICT_APRILTAG_36h11", {4: (0.2, 0.2), 9: (0.7, 0.25), 30: (0.4, 0.6)}, 0.16, (0.9, 0.8))
    poses = [Pose.look_at(p, (0.45, 0.4, 0)) for p in [(0.0, -0.3, 0.8), (1.0, 0.0, 0.9), (0.3, 1.1, 0.8)]]
    unscaled = {str(i): MODEL.apply_pose(pose) for i, pose in enumerate(poses)}
    found = {
        str(i): detect_markers(render_board(board, p, camera, oversampling=2, seed=i), "APRILTAG_36h11")
        for i, p in enumerate(poses)
    }
    scale = marker_scale(found, unscaled, dict.fromkeys(unscaled, camera), MarkersFile("APRILTAG_36h11", 0.16), seed=0)
    assert scale.scale == pytest.approx(3.7, rel=1e-3)
    assert scale.inliers == 3
    assert scale.notes == ()
    for number, truth in board.corners.items():
        assert scale.corners[number] == pytest.approx(MODEL.apply(truth), abs=0.001 / 3.7)


def test_from_sides_and_distances() -> None:
    sides = scale_of(SIDE)
    assert sides.scale == pytest.approx(3.7, rel=1e-3)
    assert sides.inliers == len(CENTERS)
    long = scale_of(MarkersFile("DICT_4X4_50", None, (between(0, 11), between(3, 7))))
    assert long.scale == pytest.approx(3.7, rel=1e-4)
    assert long.inliers == 2
    assert long.notes == ()


def test_a_typing_error_is_named() -> None:
    wrong = MarkersFile("DICT_4X4_50", None, (between(0, 3), between(0, 7), between(0, 11, 1.2)))
    scale = scale_of(wrong)
    assert scale.scale == pytest.approx(3.7, rel=1e-3)
    assert scale.inliers == 2
    (note,) = scale.notes
    assert note.startswith("markers 0–11: ")
    assert note.endswith("(-16.7%); not used")


def test_a_print_scaled_to_fit_the_page_is_named() -> None:
    scale = scale_of(
        MarkersFile(
            "DICT_4X4_50",
            SIDE_M * 1.04,
            (between(0, 3), between(0, 7), between(3, 11), between(7, 11), between(0, 11), between(0, 20)),
        )
    )
    assert scale.scale == pytest.approx(3.7, rel=1e-3)
    assert len(scale.notes) == 5
    assert all("side of marker" in note for note in scale.notes)


def test_a_wrong_pose_does_not_matter() -> None:
    poses = dict(UNSCALED)
    poses["1.jpg"] = Pose(poses["1.jpg"].rotation, poses["1.jpg"].center + np.array([0.1, 0.0, 0.05]))
    scale = marker_scale(detections(), poses, CAMERAS, SIDE, seed=0)
    assert scale.scale == pytest.approx(3.7, rel=2e-3)


@pytest.mark.parametrize("others", [False, True], ids=["one photograph", "others not registered"])
def test_no_marker_in_two_registered_photographs(others: bool) -> None:
    found = detections()
    names = list(found)
    poses = {names[0]: UNSCALED[names[0]]} if others else UNSCALED
    with pytest.raises(ReconstructionError, match="two registered photographs") as caught:
        marker_scale(found if others else {names[0]: found[names[0]]}, poses, CAMERAS, SIDE, seed=0)
    assert caught.value.remedy


BOARD_CAMERA = Intrinsics("PINHOLE", 480, 360, (450.0, 450.0, 241.3, 178.9))
BOARD_CENTERS = {0: (0.15, 0.15), 3: (0.45, 0.15), 7: (0.15, 0.4), 11: (0.45, 0.4)}


@pytest.fixture(scope="module", params=["DICT_4X4_50", "DICT_APRILTAG_36h11"])
def board(request: pytest.FixtureRequest) -> tuple[str, Board]:
    return request.param, marker_board(request.param, BOARD_CENTERS, 0.12, (0.6, 0.55))


@pytest.mark.parametrize("blur", [0.5, 1.0])
@pytest.mark.parametrize("place", [(0.35, 0.2, 0.85), (-0.1, -0.1, 0.8)])
def test_corners_are_where_the_camera_sees_them(board, place, blur) -> None:
    name, markers = board
    pose = Pose.look_at(place, (0.31, 0.27, 0))
    found = detect_markers(render_board(markers, pose, BOARD_CAMERA, blur=blur), name)
    assert [detection.id for detection in found] == [0, 3, 7, 11]
    error = np.concatenate([d.corners - BOARD_CAMERA.project(pose.to_camera(markers.corners[d.id])) for d in found])
    assert np.abs(error).max() < 0.2
    assert np.sqrt(np.mean(error**2)) < 0.1
    # A bias in length would be a bias in scale; cornerSubPix draws these corners in by a quarter to half a pixel.
    for detection in found:
        truth = BOARD_CAMERA.project(pose.to_camera(markers.corners[detection.id]))
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
