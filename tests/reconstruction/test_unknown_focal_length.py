"""Focal length and height of photographs that look the same way: held, and said so."""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.geometry import Pose
from fieldkit.reconstruction.cameras import assumed_camera
from fieldkit.reconstruction.pipeline import place
from fieldkit.reconstruction.result import SparseResult
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from fieldkit.vocabulary import MappingChoice
from tests.captures.photographs import exif_block

WIDTH, HEIGHT, FLYING_M = 480, 360, 12.0
TRUE_35MM = 20.0
FOCAL = TRUE_35MM * 600 / 43.2666
CENTERS = [(x, y, FLYING_M + 0.02 * (x + y)) for y in (0.0, 4.0) for x in (0.0, 3.0, 6.0)]


@cache
def ground(side: int = 2000) -> np.ndarray:
    """A picture of bare ground, 100 px per metre, with detail at all scales."""
    rng = np.random.default_rng(7)
    picture = np.full((side, side), 128.0, np.float32)
    for cells, strength in ((40, 30), (150, 30), (500, 30), (1000, 20)):
        noise = rng.normal(0, strength, (cells, cells)).astype(np.float32)
        picture += cv2.resize(noise, (side, side), interpolation=cv2.INTER_CUBIC)
    return np.clip(picture, 0, 255).astype(np.uint8)


def photographed(folder: Path, poses: list[Pose], *, equivalent: int | None, picture: np.ndarray | None = None) -> Path:
    """Photographs of the ground from poses (metres), with their positions in poses.csv."""
    folder.mkdir()
    picture, lines = ground() if picture is None else picture, ["image,x_m,y_m,z_m,accuracy_m"]
    camera = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
    to_metres = np.array([[0.01, 0, -7.0], [0, 0.01, -8.0], [0, 0, 1]])  # of the picture's pixels
    for k, pose in enumerate(poses):
        plane = np.column_stack([pose.rotation[:, 0], pose.rotation[:, 1], -pose.rotation @ pose.center])
        seen = cv2.warpPerspective(picture, camera @ plane @ to_metres, (WIDTH, HEIGHT), flags=cv2.INTER_AREA)
        exif = exif_block(detail={37386: 3.6, 41989: equivalent}) if equivalent else exif_block()
        Image.fromarray(seen).convert("RGB").save(folder / f"{k}.jpg", quality=95, exif=exif)
        lines.append(f"{k}.jpg,{','.join(map(repr, map(float, pose.center)))},0.05")
    (folder / "poses.csv").write_text("\n".join(lines))
    return folder


def nadir(tilt_deg: float = 0.5) -> list[Pose]:
    """A grid of cameras that look down, but for small tilts this way and that."""
    return [Pose.from_yaw_pitch(c, 10.0 * k, -90.0 + tilt_deg * (k % 3)) for k, c in enumerate(CENTERS)]


def mapped(folder: Path, tmp_path: Path, mapping: MappingChoice) -> SparseResult:
    capture = read_capture(folder)
    settings = ReconstructionSettings(mapping=mapping)
    return place(capture, settings, list(capture.findings), Context(StageCache(tmp_path.parent / "cache")))[0]


def codes(result: SparseResult) -> list[str]:
    return [finding.code for finding in result.findings]


def test_without_a_focal_length_one_is_held_and_heights_are_undetermined(tmp_path: Path) -> None:
    result = mapped(photographed(tmp_path / "flight", nadir(), equivalent=None), tmp_path, "incremental")
    assert result.right == len(CENTERS)
    assert {camera.fx for camera in result.intrinsics.values()} == {assumed_camera(WIDTH, HEIGHT).fx}
    assert codes(result) == ["height-undetermined"]
    assert "24 mm lens" in result.findings[0].message


def test_a_known_focal_length_is_held_and_gives_the_height(tmp_path: Path) -> None:
    result = mapped(photographed(tmp_path / "flight", nadir(), equivalent=20), tmp_path, "prior")
    assert result.right == len(CENTERS)
    assert [camera.fx for camera in result.intrinsics.values()] == pytest.approx([FOCAL] * len(CENTERS), rel=0.05)
    assert codes(result) == ["lens-uncalibrated"]
    heights = [float(result.frame.ground.heights(pose.center[None])[0]) for pose in result.poses.values()]
    assert np.median(heights) == pytest.approx(FLYING_M, rel=0.06)


@pytest.mark.slow
def test_known_heights_tell_the_focal_length(tmp_path: Path) -> None:
    poses = [Pose(pose.rotation, pose.center + np.array([0, 0, 1.0 * (k % 2)])) for k, pose in enumerate(nadir())]
    result = mapped(photographed(tmp_path / "flight", poses, equivalent=None), tmp_path, "prior")
    assert codes(result) == []
    assert next(iter(result.intrinsics.values())).fx == pytest.approx(FOCAL, rel=0.05)


def test_views_from_around_calibrate_themselves(tmp_path: Path) -> None:
    around = [
        Pose.look_at((3 + 8 * np.cos(a), 2 + 8 * np.sin(a), 10.0), (3, 2, 0))
        for a in np.linspace(0, 2 * np.pi, 10)[:-1]
    ]
    result = mapped(photographed(tmp_path / "flight", around, equivalent=None), tmp_path, "incremental")
    assert codes(result) == []
    assert next(iter(result.intrinsics.values())).fx == pytest.approx(FOCAL, rel=0.05)
