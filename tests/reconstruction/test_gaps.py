"""Cover by gaps between painted leaves whose cover is known."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fieldkit.captures.model import Photo
from fieldkit.clouds.canopy import rectangle
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.gaps import cover_of, covers_by_gaps
from fieldkit.reconstruction.result import SparseResult
from fieldkit.results.frame import Plane
from tests.evaluation.examples import reconstruction

CAMERA = Intrinsics.pinhole(1200, 900, 1200.0)
GROUND = Plane((0.0, 0.0, 1.0), 0.0, 0.005, 1.0, 0.02)
PLOT, HALF = rectangle((-0.7, -0.7), (0.7, 0.7)), rectangle((-0.7, -0.7), (0.0, 0.7))
LEAF, SOIL = (50, 160, 60), (110, 130, 150)


def leaves(count: int, tilt_deg: float) -> np.ndarray:
    """(n, 4, 3) corners of leaves of 30 × 6 cm from 0.2 to 1 m over ground, three times as many where x is negative."""
    rng = np.random.default_rng(4)
    corners = np.array([(-0.15, -0.03, 0), (0.15, -0.03, 0), (0.15, 0.03, 0), (-0.15, 0.03, 0)])
    turns = Rotation.from_euler("xz", rng.uniform((-tilt_deg, 0), (tilt_deg, 360), (count, 2)), degrees=True)
    places = rng.uniform((-1.4, -1.4, 0.2), (1.4, 1.4, 1.0), (count, 3))
    places[: count // 2, 0] = -np.abs(places[: count // 2, 0])
    return np.array([turn.apply(corners) + place for turn, place in zip(turns, places, strict=True)])


LEAVES = leaves(400, 50.0)


def true_cover(low: tuple[float, float], high: tuple[float, float]) -> float:
    picture = np.zeros(np.round(1000 * np.subtract(high, low)).astype(int)[::-1], np.uint8)
    for leaf in LEAVES:
        cv2.fillConvexPoly(picture, np.round(1000 * (leaf[:, :2] - low)).astype(np.int32), 1)
    return float(picture.mean())


@pytest.fixture
def flight(tmp_path: Path) -> SparseResult:
    """Sixteen photographs straight down, 2.5 m over ground."""
    poses, photos = {}, []
    for k, (x, y) in enumerate(np.stack(np.meshgrid(*[np.linspace(-0.9, 0.9, 4)] * 2), axis=-1).reshape(-1, 2)):
        pose, name = Pose.from_yaw_pitch((x, y, 2.5), 0.0, -90.0), f"{k}.jpg"
        picture = np.full((CAMERA.height, CAMERA.width, 3), SOIL, np.uint8)
        for leaf in LEAVES[np.argsort(LEAVES[:, :, 2].mean(axis=1))]:
            pixels = CAMERA.project(pose.to_camera(leaf)) - 0.5
            cv2.fillConvexPoly(picture, np.round(16 * pixels).astype(np.int32), LEAF, shift=4, lineType=cv2.LINE_AA)
        cv2.imwrite(str(tmp_path / name), cv2.GaussianBlur(picture, (0, 0), 1.2), [cv2.IMWRITE_JPEG_QUALITY, 90])
        poses[name] = pose
        photos.append(Photo(tmp_path / name, name, CAMERA.width, CAMERA.height, "JPEG", f"{k:064d}"))
    sparse = reconstruction().sparse
    capture = replace(sparse.capture, photos=tuple(photos))
    return replace(sparse, capture=capture, poses=poses, intrinsics=dict.fromkeys(poses, CAMERA))


def test_leaves_that_hide_more_of_the_ground_the_more_one_looks_aside(flight: SparseResult) -> None:
    plot, half = covers_by_gaps(flight, {"a": (GROUND, (PLOT, HALF))}, "exg")["a"]
    assert half is not None
    assert plot is not None
    assert plot.share == pytest.approx(true_cover((-0.7, -0.7), (0.7, 0.7)), abs=0.05)
    assert half.share == pytest.approx(true_cover((-0.7, -0.7), (0.0, 0.7)), abs=0.05)
    assert half.share > plot.share + 0.1


def test_masks_from_files_serve_as_well(flight: SparseResult) -> None:
    by_colour = covers_by_gaps(flight, {"a": (GROUND, (PLOT,))}, "exg")["a"][0]
    for photo in flight.capture.photos:
        picture = cv2.imread(str(photo.path))
        mask = (picture[..., 1].astype(int) - picture[..., 2] > 50).astype(np.uint8) * 255
        cv2.imwrite(str(photo.path.with_name(f"{photo.path.stem}_mask.png")), cv2.resize(mask, (600, 450)))
    assert covers_by_gaps(flight, {"a": (GROUND, (PLOT,))}, "file")["a"][0] == pytest.approx(by_colour, abs=0.05)


def test_without_masks_or_steep_sight_lines_there_is_none(flight: SparseResult) -> None:
    assert covers_by_gaps(flight, {"a": (GROUND, (PLOT,)), "b": (None, (HALF,))}, "none") == {"a": [None], "b": [None]}
    far = replace(
        flight,
        poses={
            name: Pose(pose.rotation, pose.center + np.array([4.0, 0.0, 0.0])) for name, pose in flight.poses.items()
        },
    )
    assert covers_by_gaps(far, {"a": (GROUND, (PLOT,))}, "exg") == {"a": [None]}


X, Y = (axis.ravel() for axis in np.meshgrid(*[(np.arange(12) + 0.5) * 0.05] * 2, indexing="ij"))


def on_plants(cover: float) -> np.ndarray:
    """Chance of each class of sight lines to end on plants, like an ellipsoid's."""
    return -np.expm1(-np.sqrt(np.log1p(-cover) ** 2 + 0.7 * X**2 + 0.2 * Y**2))


@pytest.mark.parametrize("cover", [0.0, 0.1, 0.6, 0.95])
def test_contacts_like_an_ellipsoids(cover: float) -> None:
    number = np.full(X.shape, 500.0)
    assert cover_of(number, number * on_plants(cover)) == pytest.approx((cover, 0.0), abs=0.01)


def test_errors_hold_where_leaves_hide_many_sight_lines_and_grow_where_none_is_steep() -> None:
    rng, errors = np.random.default_rng(0), []
    for steepest in (0.0, 0.35):
        number = np.where(np.hypot(X, Y) >= steepest, 500.0, 0.0)
        shares = np.clip(on_plants(0.5) + 0.05 * rng.standard_normal((40, X.size)), 0.0, 1.0)
        found = [cover_of(number, number * share) for share in shares]
        assert sum(each is not None and abs(each.share - 0.5) <= each.error for each in found) >= 32
        errors.append(np.mean([each.error for each in found if each is not None]))
    assert errors[1] > 1.5 * errors[0]
    aside = np.where(Y > 0.5, 500.0, 0.0)
    assert cover_of(aside, aside * on_plants(0.5) * rng.uniform(0.6, 1.0, X.size)) is None
