"""Simulated captures: a folder of photographs of a scene as a drone leaves it, and the truth beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fieldkit.errors import UsageError
from fieldkit.files import atomic_folder, storage_errors, write_atomic
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.scenes.camera_effects import CameraEffects, photographed
from fieldkit.scenes.drawing import Draw, draw
from fieldkit.scenes.metadata import Geotag, exif_block, xmp_packet
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.sensor_noise import with_noise, with_tabled_noise

_ANGLE_DECIMALS, _LENGTH_DECIMALS = 4, 5


@dataclass(frozen=True)
class CaptureNoise:
    """Standard deviations of everything that is not exact in a capture; each Gaussian and independent."""

    position_m: float = 0.0
    """True minus commanded position, per axis."""
    angle_deg: float = 0.0
    """True against commanded attitude, about each camera axis."""
    gps_horizontal_m: float = 0.015
    gps_vertical_m: float = 0.025
    """Reported minus true position; east and north each, up."""
    gimbal_deg: float = 0.3
    """Reported minus true yaw, pitch and roll."""
    image_sigma: float = 2.0
    """Of the sensor, grey levels per channel."""

    def __post_init__(self) -> None:
        if min(vars(self).values()) < 0:
            raise ValueError("standard deviations cannot be negative")


@dataclass(frozen=True)
class Site:
    """Where on Earth the plot frame stands and how the drone knows its position."""

    origin: LocalFrame = field(default_factory=lambda: LocalFrame(52.2960, 10.4370, 81.0, "ellipsoid"))
    """Of the plot frame."""
    rtk: bool = True
    """Whether geotags are marked as fixed RTK solutions."""
    accuracy_m: tuple[float, float] = (0.015, 0.025)
    """Horizontal and vertical standard deviation that the drone claims."""


@dataclass(frozen=True)
class Sidecars:
    """Files written beside the photographs, as a person who planned the flight would put them there."""

    poses: bool = False
    """Poses.csv with the commanded poses."""
    accuracy_m: float | None = None
    """What poses.csv states; by default the noise's ``position_m``, at least 1 mm."""
    camera: bool = False
    """Camera.toml with the exact intrinsics."""


class Sway(Protocol):
    """Moves plants between photographs."""

    def __call__(self, scene: Scene, photograph: int) -> Mapping[str, NDArray[np.float32]]:
        """Vertices (n, 3) by mesh name, for `Renderer.move`, while photograph ``photograph`` (from 0) is taken."""


def perturbed(poses: Sequence[Pose], noise: CaptureNoise, seed: int) -> list[Pose]:
    """The poses at which photographs are really taken when these are commanded."""
    rng = np.random.default_rng([seed, 1])
    true = []
    for pose in poses:
        shift = rng.normal(size=3) * noise.position_m
        turn = rng.normal(size=3) * np.radians(noise.angle_deg)
        true.append(Pose(rotation_from_vector(turn) @ pose.rotation, pose.center + shift))
    return true


def simulate_capture(
    folder: Path,
    renderer: Renderer,
    poses: Sequence[Pose],
    intrinsics: Intrinsics,
    *,
    noise: CaptureNoise | None = None,
    seed: int = 0,
    effects: CameraEffects | None = None,
    sway: Sway | None = None,
    site: Site | None = None,
    row_heading_deg: float = 90.0,
    sidecars: Sidecars | None = None,
    truth: Path | None = None,
    started_at: datetime = datetime(2026, 6, 18, 10, 30),
    overwrite: bool = False,
    economy: bool = False,
    drawing: Draw = draw,
    progress: Progress | None = None,
) -> list[Pose]:
    """Photograph the renderer's scene from the poses and write the JPEGs with their metadata.

    Args:
        folder: the capture; made complete or not at all.
        renderer: of the scene, kept by the caller for further captures.
        poses: as commanded.
        intrinsics: without distortion.
        noise: exact poses and the default sensor, where not given.
        seed: of all noise; each photograph's depends on its number only.
        effects: what the camera does beside the noise, and how it compresses; nothing by default.
        sway: moves the plants between photographs; the renderer has its scene back afterwards.
        site: no GPS and no XMP is written without one.
        row_heading_deg: compass heading of the plot frame's x axis, for GPS positions and yaw angles.
        sidecars: none by default.
        truth: a CSV file for the true poses; it must lie outside ``folder``, where no reader finds it.
        started_at: time of the first photograph, the next ones 4 s apart.
        overwrite: replace an existing capture.
        economy: draw with one sample per pixel and smooth the edges afterwards, and take the sensor's noise from a
            table: the same look and other pixels at half the cost, for captures that are made by the hundred.
        drawing: draws the scene; one that keeps drawings (`KeptDrawings`) is for plants that stand still.

    Returns:
        The true poses.
    """
    noise, effects, sidecars = noise or CaptureNoise(), effects or CameraEffects(), sidecars or Sidecars()
    if not poses:
        raise UsageError("a capture needs at least one pose")
    if truth is not None and truth.absolute().is_relative_to(folder.absolute()):
        raise UsageError("the true poses must not lie in the capture's folder", path=truth)
    true = perturbed(poses, noise, seed)
    names = [f"IMG_{i + 1:04d}.jpg" for i in range(len(poses))]
    with (
        atomic_folder(folder, overwrite=overwrite, marker=names[0]) as partial,
        storage_errors(folder),
        (progress or Silent()).stage("photographs", len(poses)) as advance,
    ):
        for i, (name, pose) in enumerate(zip(names, true, strict=True)):
            if sway is not None:
                renderer.move(sway(renderer.scene, i))
            image, depth = drawing(renderer, pose, intrinsics, depth=effects.moves, economy=economy)
            if effects.changes_pixels:
                shaken = np.random.default_rng([seed, 3, i])
                image = photographed(image, depth, intrinsics, effects, shaken, economy=economy)
            rng = np.random.default_rng([seed, 2, i])
            image = (with_tabled_noise if economy else with_noise)(image, noise.image_sigma, rng)
            tag = None if site is None else _geotag(_compass(pose, row_heading_deg), site, noise, rng)
            exif = exif_block(intrinsics, started_at + timedelta(seconds=4 * i), tag)
            xmp = None if tag is None else xmp_packet(tag)
            Image.fromarray(image).save(partial / name, "JPEG", quality=effects.jpeg_quality, exif=exif, xmp=xmp)
            advance(1)
        if sidecars.poses:
            stated = max(noise.position_m, 0.001) if sidecars.accuracy_m is None else sidecars.accuracy_m
            (partial / "poses.csv").write_text(poses_table(names, poses, accuracy_m=stated), encoding="utf-8")
        if sidecars.camera:
            (partial / "camera.toml").write_text(camera_toml(intrinsics), encoding="utf-8")
    if sway is not None:
        renderer.rest()
    if truth is not None:
        write_atomic(truth, poses_table(names, true, roll=True))
    return true


def poses_table(
    names: Sequence[str], poses: Sequence[Pose], *, accuracy_m: float | None = None, roll: bool = False
) -> str:
    """The text of a poses.csv: metres and degrees, one line per photograph.

    Args:
        accuracy_m: standard deviation of the positions, written into every line.
        roll: also write the roll, which commanded poses do not have.
    """
    tail = [] if accuracy_m is None else [f"{accuracy_m:g}"]
    header = ["image", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", *["roll_deg"] * roll]
    lines = [",".join([*header, *["accuracy_m"] * len(tail)])]
    for name, pose in zip(names, poses, strict=True):
        yaw, pitch, roll_deg = pose.yaw_pitch_roll_deg()
        values = [f"{v:.{_LENGTH_DECIMALS}f}" for v in pose.center]
        values += [f"{v:.{_ANGLE_DECIMALS}f}" for v in ([yaw, pitch, roll_deg] if roll else [yaw, pitch])]
        lines.append(",".join([name, *values, *tail]))
    return "\n".join(lines) + "\n"


def _compass(pose: Pose, row_heading_deg: float) -> Pose:
    """A pose of the plot frame in east, north and up."""
    turn = np.radians(90.0 - row_heading_deg)
    east_north = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    return Pose(pose.rotation @ east_north.T, east_north @ pose.center)


def _geotag(pose: Pose, site: Site, noise: CaptureNoise, rng: np.random.Generator) -> Geotag:
    error = rng.normal(size=3) * (noise.gps_horizontal_m, noise.gps_horizontal_m, noise.gps_vertical_m)
    latitude, longitude, altitude = (float(v[0]) for v in site.origin.to_geodetic(pose.center + error))
    yaw, pitch, roll = np.array(pose.yaw_pitch_roll_deg()) + rng.normal(size=3) * noise.gimbal_deg
    return Geotag(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=altitude,
        relative_altitude_m=float(pose.center[2] + error[2]),
        yaw_deg=float(yaw),
        pitch_deg=float(np.clip(pitch, -90.0, 90.0)),
        roll_deg=float(roll),
        rtk=site.rtk,
        horizontal_accuracy_m=site.accuracy_m[0],
        vertical_accuracy_m=site.accuracy_m[1],
    )


def camera_toml(intrinsics: Intrinsics) -> str:
    """The text of a camera.toml."""
    params = ", ".join(repr(float(p)) for p in intrinsics.params)
    return (
        f'model = "{intrinsics.model}"\nwidth = {intrinsics.width}\nheight = {intrinsics.height}\nparams = [{params}]\n'
    )
