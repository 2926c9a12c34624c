"""Simulated captures: a folder of photographs of a scene as a drone leaves it, and the truth beside it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from PIL import Image

from fieldkit.arrays import FloatArray
from fieldkit.errors import UsageError
from fieldkit.files import atomic_folder, storage_errors, write_atomic
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_about_z, rotation_from_vector
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.scenes.camera_effects import CameraEffects, photographed
from fieldkit.scenes.drawing import Draw, draw
from fieldkit.scenes.metadata import Geotag, exif_block, xmp_packet
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.sensor_noise import with_noise, with_tabled_noise
from fieldkit.scenes.sway import Motion
from fieldkit.vocabulary import BURST_INTERVAL_S

_ANGLE_DECIMALS = 4
"""Decimals of angles in degrees."""
_LENGTH_DECIMALS = 5
"""Decimals of positions in metres."""

_FLIGHT_S = 5.0
"""Time from a burst's last photograph to the next one's first, seconds: bursts of five begin 8 s apart."""
_SINGLE_S = 4.0
"""Time from a single photograph to the next, seconds."""
_HOVER_M = 0.01
"""Standard deviation of a position within a burst per axis, metres: over seconds a hovering vehicle keeps its place far
better than it finds it. An estimate."""
_HOVER_DEG = 0.3
"""Standard deviation of each angle within a burst, degrees. An estimate."""


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


@dataclass(frozen=True)
class Outdoors:
    """What is outdoors besides noise: leaves move while photographs are taken, and stations take bursts of them."""

    wind_m: float = 0.0
    """Sway of the leaves by wind, root mean square per axis, half a metre out (see `Motion`)."""
    vehicle_kg: float = 0.0
    """Mass of the vehicle whose wash moves leaves, too; 0 has no wash."""
    burst: int = 1
    """Photographs per station."""
    interval_s: float = BURST_INTERVAL_S
    """Between the photographs of a burst."""

    def __post_init__(self) -> None:
        if not (self.wind_m >= 0 and self.burst >= 1 and self.interval_s > 0):
            raise ValueError("a wind of at least 0, bursts of at least one photograph and a time between them")

    @property
    def still(self) -> bool:
        """Whether nothing moves."""
        return self.wind_m == 0 and self.vehicle_kg == 0

    def time_s(self, photograph: int) -> float:
        """When a photograph is taken, from 0, after the first one."""
        station, of_burst = divmod(photograph, self.burst)
        flight_s = _FLIGHT_S if self.burst > 1 else _SINGLE_S
        return station * (flight_s + (self.burst - 1) * self.interval_s) + of_burst * self.interval_s


def perturbed(poses: Sequence[Pose], noise: CaptureNoise, seed: int, burst: int = 1) -> list[Pose]:
    """The poses at which photographs are really taken when these are commanded, so many at each.

    The photographs of a burst share their station's error and hover about it.
    """
    rng, hovering = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 5])
    true: list[Pose] = []
    for pose in poses:
        station = _disturbed(pose, noise.position_m, noise.angle_deg, rng)
        burst_of = (_disturbed(station, _HOVER_M, _HOVER_DEG, hovering) for _ in range(burst))
        true += [station] if burst == 1 else burst_of
    return true


def _disturbed(pose: Pose, position_m: float, angle_deg: float, rng: np.random.Generator) -> Pose:
    shift, turn = rng.normal(size=3) * position_m, rng.normal(size=3) * np.radians(angle_deg)
    return Pose(rotation_from_vector(turn) @ pose.rotation, pose.center + shift)


def simulate_capture(
    folder: Path,
    renderer: Renderer,
    poses: Sequence[Pose],
    intrinsics: Intrinsics,
    *,
    noise: CaptureNoise | None = None,
    seed: int = 0,
    effects: CameraEffects | None = None,
    outdoors: Outdoors | None = None,
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
        outdoors: still air and one photograph per pose, where not given; the renderer has its scene back afterwards.
        site: no GPS and no XMP is written without one.
        row_heading_deg: compass heading of the plot frame's x axis, for GPS positions and yaw angles.
        sidecars: none by default.
        truth: a CSV file for the true poses; it must lie outside ``folder``, where no reader finds it.
        started_at: time of the first photograph; the others' by `Outdoors.time_s`.
        overwrite: replace an existing capture.
        economy: draw with one sample per pixel and smooth the edges afterwards, and take the sensor's noise from a
            table: the same look and other pixels at half the cost, for captures that are made by the hundred.
        drawing: draws the scene; one that keeps drawings (`KeptDrawings`) is for plants that stand still.

    Returns:
        The true poses, one for each photograph.
    """
    noise, effects, sidecars = noise or CaptureNoise(), effects or CameraEffects(), sidecars or Sidecars()
    if not poses:
        raise UsageError("a capture needs at least one pose")
    if truth is not None and truth.absolute().is_relative_to(folder.absolute()):
        raise UsageError("the true poses must not lie in the capture's folder", path=truth)
    outdoors = outdoors or Outdoors()
    true = perturbed(poses, noise, seed, outdoors.burst)
    names = [f"IMG_{i + 1:04d}.jpg" for i in range(len(true))]
    reported = np.repeat([noise.gps_horizontal_m, noise.gps_vertical_m, noise.gimbal_deg], [2, 1, 3])
    motion = None if outdoors.still else Motion(renderer.scene, seed)
    with (
        atomic_folder(folder, overwrite=overwrite, marker=names[0]) as partial,
        storage_errors(folder),
        (progress or Silent()).stage("photographs", len(true)) as advance,
        ExitStack() as afterwards,
    ):
        if motion is not None:
            afterwards.callback(renderer.rest)
        for i, (name, pose) in enumerate(zip(names, true, strict=True)):
            time_s = outdoors.time_s(i)
            if motion is not None:
                renderer.move(motion.at(time_s, outdoors.wind_m, outdoors.vehicle_kg, pose.center))
            image, depth = drawing(renderer, pose, intrinsics, depth=effects.moves, economy=economy)
            if effects.changes_pixels:
                shaken = np.random.default_rng([seed, 3, i])
                image = photographed(image, depth, intrinsics, effects, shaken, economy=economy)
            rng = np.random.default_rng([seed, 2, i])
            image = (with_tabled_noise if economy else with_noise)(image, noise.image_sigma, rng)
            if i % outdoors.burst == 0:  # what is reported hardly errs otherwise within a burst
                error = rng.normal(size=6) * reported
            tag = None if site is None else _geotag(_compass(pose, row_heading_deg), site, error)
            exif = exif_block(intrinsics, started_at + timedelta(seconds=time_s), tag)
            xmp = None if tag is None else xmp_packet(tag)
            Image.fromarray(image).save(partial / name, "JPEG", quality=effects.jpeg_quality, exif=exif, xmp=xmp)
            advance(1)
        if sidecars.poses:
            stated = max(noise.position_m, 0.001) if sidecars.accuracy_m is None else sidecars.accuracy_m
            commanded = [pose for pose in poses for _ in range(outdoors.burst)]
            (partial / "poses.csv").write_text(poses_table(names, commanded, accuracy_m=stated), encoding="utf-8")
        if sidecars.camera:
            (partial / "camera.toml").write_text(camera_toml(intrinsics), encoding="utf-8")
    if truth is not None:
        write_atomic(truth, poses_table(names, true, roll=True))
    return true


def poses_table(
    names: Sequence[str], poses: Sequence[Pose], *, accuracy_m: float | None = None, roll: bool = False
) -> str:
    """The text of a poses.csv: metres and degrees, one line per photograph.

    ``accuracy_m`` is of the positions, in every line; ``roll`` also writes the roll, which commanded poses do not have.
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
    east_north = rotation_about_z(np.radians(90.0 - row_heading_deg))
    return Pose(pose.rotation @ east_north.T, east_north @ pose.center)


def _geotag(pose: Pose, site: Site, error: FloatArray) -> Geotag:
    latitude, longitude, altitude = (float(v[0]) for v in site.origin.to_geodetic(pose.center + error[:3]))
    yaw, pitch, roll = np.array(pose.yaw_pitch_roll_deg()) + error[3:]
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
