"""Outlines of a plant before a black screen: a rig whose photographs nothing ties, and how clouds fill them."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.clouds import Volume
from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.pipeline import place
from fieldkit.reconstruction.result import SparseResult
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.silhouettes import (
    Filled,
    Outline,
    filled,
    filling_seam,
    highest_shown_m,
    hull_volume,
    outlines,
)
from fieldkit.results.finding import POSES_STATED
from fieldkit.results.frame import Plane
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Silent
from tests.reconstruction.synthetic import ring

CAMERA = Intrinsics("SIMPLE_PINHOLE", 800, 600, (900.0, 400.0, 300.0))
CENTER, HALF = np.array([0.03, -0.02, 0.05]), np.array([0.06, 0.09, 0.12])

GROUND = Plane((0.0, 0.0, 1.0), 0.0, 0.005, 1.0, 0.02)


def leaf_green(count: int = 40_000) -> np.ndarray:
    """(n, 3) points on an ellipsoid."""
    rng = np.random.default_rng(0)
    unit = rng.normal(size=(count, 3))
    return CENTER + HALF * unit / np.linalg.norm(unit, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def photographed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    lines = ["image,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg,accuracy_m"]
    for k, pose in enumerate(ring(8)):
        picture = np.zeros((CAMERA.height, CAMERA.width, 3), dtype=np.uint8)
        pixels = CAMERA.project(pose.to_camera(leaf_green())).astype(np.float32)
        cv2.fillConvexPoly(picture, cv2.convexHull(pixels).astype(np.int32), (40, 180, 50))
        cv2.imwrite(str(folder / f"{k}.png"), picture)
        numbers = (*pose.center, *pose.yaw_pitch_roll_deg())
        lines.append(",".join([f"{k}.png", *(f"{float(v):.6f}" for v in numbers), "0.001"]))
    (folder / "poses.csv").write_text("\n".join(lines))
    (folder / "camera.toml").write_text(
        'model = "SIMPLE_PINHOLE"\nwidth = 800\nheight = 600\nparams = [900.0, 400.0, 300.0]\n'
    )
    return folder


def placed(folder: Path, photographed: Path) -> SparseResult:
    context = Context(StageCache(photographed.parent / "cache"), Silent(), 1, 0)
    return place(read_capture(folder), ReconstructionSettings(), [], context)[0]


def test_photographs_of_a_rig_count_by_stated_poses_and_are_not_called_registered(photographed: Path) -> None:
    sparse = placed(photographed, photographed)
    assert (sparse.registered, sparse.right) == (0, 8)
    assert all(image.stated and image.right is None for image in sparse.images)
    assert set(sparse.groups) == set(sparse.poses)
    assert [finding.code for finding in sparse.findings].count(POSES_STATED) == 1
    hull = hull_volume(sparse, "exg")
    assert hull is not None
    to_plot = sparse.frame.plot_from_source.translation
    np.testing.assert_allclose(hull.center - to_plot, CENTER, atol=0.015)
    assert (hull.size > 2.0 * HALF).all()
    assert (hull.size < 2.0 * HALF + 0.09).all()
    assert hull_volume(sparse, "none") is None

    plants, shown = leaf_green() + to_plot, outlines(sparse, "exg")
    whole = filled(shown, plants, hull)
    assert min(whole.near_3px or 0.0, whole.near_6px or 0.0, whole.inside or 0.0) > 0.98
    part = filled(shown, plants[plants[:, 2] > plants[:, 2].mean()], hull)
    assert part.near_6px is not None
    assert 0.4 < part.near_6px < 0.75
    beside = filled(shown, plants + np.array([0.2, 0.0, 0.0]), hull)
    assert beside.inside is not None
    assert beside.inside < 0.3
    assert filled([], plants, Volume((0, 0, 0), (1, 1, 1))) == Filled(None, None, None)


def shown(parts: Sequence[np.ndarray]) -> list[Outline]:
    """Outlines of plants; the photographs show one state of the plants after the other."""
    found = []
    for k, pose in enumerate(ring(10)):
        rows, columns = (pixels := Outline(np.zeros((600, 800), bool), CAMERA, pose)).pixels(parts[k % len(parts)])
        pixels.mask[rows, columns] = True
        mask = cv2.dilate(pixels.mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        found.append(Outline(mask, CAMERA, pose))
    return found


def stem(x_m: float = 0.0) -> np.ndarray:
    """(n, 3) points on an upright leaf, 0.3 m high, whose tip is bent to the side."""
    z = np.linspace(0.0, 0.3, 2000)
    return np.column_stack([x_m * z / 0.3, np.zeros_like(z), z])


def test_outlines_show_a_tip_that_the_cloud_has_lost() -> None:
    kept = stem()[stem()[:, 2] < 0.26]
    assert highest_shown_m(shown([stem()]), GROUND, kept, 0.0) == pytest.approx((0.3, 0.3), abs=0.015)
    swaying = shown([stem(x) for x in (-0.015, 0.0, 0.015)])
    assert highest_shown_m(swaying, GROUND, kept, 0.012)[0] == pytest.approx(0.3, abs=0.02)
    assert (highest_shown_m(swaying, GROUND, kept, 0.0)[0] or 0.0) < 0.29
    assert highest_shown_m([], GROUND, kept, 0.0) == (None, None)


def test_of_a_tip_far_above_the_cloud_outlines_tell_how_high_it_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fieldkit.reconstruction.silhouettes._FARTHEST_M", 0.02)
    height, at_most = highest_shown_m(shown([stem()]), GROUND, stem()[stem()[:, 2] < 0.26], 0.0)
    assert height == pytest.approx(0.28, abs=0.01)
    assert at_most == pytest.approx(0.3, abs=0.015)


def test_plants_before_other_plants_show_no_tip() -> None:
    x, y = (each.ravel() for each in np.meshgrid(*[np.linspace(-0.3, 0.3, 200)] * 2))
    canopy = np.column_stack([x, y, np.full_like(x, 0.2)])
    assert highest_shown_m(shown([canopy]), GROUND, stem()[stem()[:, 2] < 0.2], 0.0) == (None, None)


def test_what_a_cloud_fills_beyond_outlines_is_seam() -> None:
    pixel_m, narrower_px, disc = 0.003, 4, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 9))
    wide = shown([leaf_green()])
    narrow = [Outline(cv2.erode(of.mask.astype(np.uint8), disc) > 0, CAMERA, of.pose) for of in wide]
    away_m = float(np.linalg.norm(wide[0].pose.center - CENTER))
    less = filling_seam(narrow, leaf_green(), pixel_m) - filling_seam(wide, leaf_green(), pixel_m)
    assert less == pytest.approx(narrower_px * away_m / CAMERA.fx / pixel_m, abs=0.2)
