"""Features of the ground: photographs of a textured plane, drawn from oblique poses."""

import cv2
import numpy as np
import pytest

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.features import Features, extract_features, extract_ground_features
from fieldkit.reconstruction.guided import Band, IndexedFeatures, PosedFeatures, Region, match_guided
from fieldkit.reconstruction.settings import FeatureSettings

CAMERA = Intrinsics("PINHOLE", 800, 600, (680.0, 680.0, 400.0, 300.0))
METRE_PX, HALF_M = 400, 2.0


@pytest.fixture(scope="module")
def soil() -> ByteArray:
    """(1600, 1600) 4 m of ground about the origin: blobs of all sizes."""
    rng = np.random.default_rng(5)
    sizes = (50, 100, 200, 400)
    layers = [cv2.resize(rng.normal(size=(n, n)), (1600, 1600), interpolation=cv2.INTER_CUBIC) for n in sizes]
    return np.clip(128 + 25 * np.sum(layers, axis=0), 0, 255).astype(np.uint8)


def photograph(soil: ByteArray, pose: Pose) -> ByteArray:
    to_world = np.array([[1 / METRE_PX, 0, -HALF_M], [0, 1 / METRE_PX, -HALF_M], [0, 0, 0], [0, 0, 1.0]])
    projection = CAMERA.matrix() @ pose.rotation @ np.column_stack([np.eye(3), -pose.center])
    drawn = cv2.warpPerspective(soil, projection @ to_world, (800, 600), flags=cv2.INTER_AREA)
    return np.asarray(drawn, np.uint8)


def oblique(azimuth_deg: float, *, away_m: float = 1.6, up_m: float = 0.9) -> Pose:
    angle = np.radians(azimuth_deg)
    return Pose.look_at((away_m * np.cos(angle), away_m * np.sin(angle), up_m), (0.0, 0.0, 0.0))


def matched(a: Features, b: Features, poses: tuple[Pose, Pose]) -> int:
    """How many matches lie at the same place of the ground."""
    posed = [PosedFeatures(IndexedFeatures.of(each, CAMERA), pose) for each, pose in zip((a, b), poses, strict=True)]
    pairs = match_guided(posed[0], posed[1], Band(3.0, Region((0, 0, 0), 2.0)))
    places = [on_ground(each.rays(pairs[:, k]), each.pose) for k, each in enumerate(posed)]
    return int((np.linalg.norm(places[0] - places[1], axis=1) < 0.01).sum())


def on_ground(rays: FloatArray, pose: Pose) -> FloatArray:
    found: FloatArray = pose.center[:2] - rays[:, :2] * pose.center[2] / rays[:, 2:]
    return found


def test_ground_is_matched_at_angles_where_photographs_are_not(soil: ByteArray) -> None:
    poses = oblique(10.0), oblique(70.0)
    grays = [photograph(soil, pose) for pose in poses]
    own = [extract_features(gray, FeatureSettings()) for gray in grays]
    ground = [
        extract_ground_features(gray, CAMERA, pose.rotation, FeatureSettings())
        for gray, pose in zip(grays, poses, strict=True)
    ]
    alone = matched(own[0], own[1], poses)
    both = matched(own[0].with_ground(ground[0]), own[1].with_ground(ground[1]), poses)
    assert both > 3 * alone + 50


@pytest.mark.parametrize("target", [(0.2, 0.0, 0.0), (30.0, 0.0, 6.0)])
def test_a_camera_that_looks_down_or_at_the_sky_has_none(target: tuple[float, float, float]) -> None:
    gray = np.random.default_rng(0).integers(0, 255, (600, 800), dtype=np.uint8)
    pose = Pose.look_at((0.0, 0.0, 2.0), target)
    assert len(extract_ground_features(gray, CAMERA, pose.rotation, FeatureSettings())) == 0
