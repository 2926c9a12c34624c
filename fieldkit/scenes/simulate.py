"""Simulated captures: a folder of photographs of a scene as a drone leaves it, and the truth beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from PIL import ExifTags, Image, TiffImagePlugin

from fieldkit.captures.poses_csv import PoseRow, poses_table
from fieldkit.captures.xmp import RTK_FIXED
from fieldkit.errors import UsageError
from fieldkit.files import atomic_folder, storage_errors
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_about_z, rotation_from_vector, wrapped_deg
from fieldkit.results.fields import Length
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.scenes.camera_effects import CameraEffects, photographed, with_noise
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.sway import Motion
from fieldkit.vocabulary import BURST_INTERVAL_S

_FLIGHT_S = 5.0
"""Time from a burst's last photograph to the next one's first, seconds: bursts of five begin 8 s apart."""
_SINGLE_S = 4.0
"""Time from a single photograph to the next, seconds."""
_HOVER_M = 0.01
"""Standard deviation of a position within a burst per axis, metres: over seconds a hovering vehicle keeps its place far
better than it finds it. An estimate."""
_HOVER_DEG = 0.3
"""Standard deviation of each angle within a burst, degrees. An estimate."""

_SENSOR_WIDTH_MM = 13.2
"""A one-inch sensor's, which gives the focal length in millimetres its scale."""
_FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)


@dataclass(frozen=True)
class CaptureNoise:
    """Standard deviations of everything that is not exact in a capture; each Gaussian and independent."""

    position_m: Length = 0.0
    """True minus commanded position, per axis."""
    angle_deg: Length = 0.0
    """True against commanded attitude, about each camera axis."""
    gps_horizontal_m: Length = 0.015
    """Reported minus true position, east and north each."""
    gps_vertical_m: Length = 0.025
    """Reported minus true height."""
    gimbal_deg: Length = 0.3
    """Reported minus true yaw, pitch and roll."""
    image_sigma: Length = 2.0
    """Of the sensor, grey levels per channel."""


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
    started_at: datetime = datetime(2026, 6, 18, 10, 30),
    overwrite: bool = False,
    economy: bool = False,
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
        started_at: time of the first photograph; the others' by `Outdoors.time_s`.
        overwrite: replace an existing capture.
        economy: draw with one sample per pixel and smooth the edges afterwards: the same look and other pixels at half
            the cost, for captures that are made by the hundred.

    Returns:
        The true poses, one for each photograph.
    """
    noise, effects, sidecars = noise or CaptureNoise(), effects or CameraEffects(), sidecars or Sidecars()
    if not poses:
        raise UsageError("a capture needs at least one pose")
    outdoors = outdoors or Outdoors()
    true = perturbed(poses, noise, seed, outdoors.burst)
    names = [f"IMG_{i + 1:04d}.jpg" for i in range(len(true))]
    reported_sigmas = np.repeat([noise.gps_horizontal_m, noise.gps_vertical_m, noise.gimbal_deg], [2, 1, 3])
    east_north = rotation_about_z(np.radians(90.0 - row_heading_deg))
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
            image, depth = renderer.drawn(pose, intrinsics, depth=effects.moves, economy=economy)
            if effects.changes_pixels:
                shaken = np.random.default_rng([seed, 3, i])
                image = photographed(image, depth, intrinsics, effects, shaken)
            rng = np.random.default_rng([seed, 2, i])
            image = with_noise(image, noise.image_sigma, rng)
            if i % outdoors.burst == 0:  # what is reported hardly errs otherwise within a burst
                error = rng.normal(size=6) * reported_sigmas
            position = xmp = None
            if site is not None:
                compass = Pose(pose.rotation @ east_north.T, east_north @ pose.center)
                reported = compass.center + error[:3]
                position = [float(v[0]) for v in site.origin.to_geodetic(reported)]
                yaw, pitch, roll = np.array(compass.yaw_pitch_roll_deg()) + error[3:]
                xmp = xmp_packet(site, position, reported[2], (yaw, np.clip(pitch, -90.0, 90.0), roll))
            exif = exif_block(intrinsics, started_at + timedelta(seconds=time_s), position)
            Image.fromarray(image).save(partial / name, "JPEG", quality=effects.jpeg_quality, exif=exif, xmp=xmp)
            advance(1)
        if sidecars.poses:
            stated = max(noise.position_m, 0.001) if sidecars.accuracy_m is None else sidecars.accuracy_m
            commanded = [pose for pose in poses for _ in range(outdoors.burst)]
            rows = [PoseRow.of(name, pose, stated) for name, pose in zip(names, commanded, strict=True)]
            (partial / "poses.csv").write_text(poses_table(rows), encoding="utf-8")
        if sidecars.camera:
            (partial / "camera.toml").write_text(camera_toml(intrinsics), encoding="utf-8")
    return true


def camera_toml(intrinsics: Intrinsics) -> str:
    """The text of a camera.toml."""
    params = ", ".join(repr(float(p)) for p in intrinsics.params)
    return (
        f'model = "{intrinsics.model}"\nwidth = {intrinsics.width}\nheight = {intrinsics.height}\nparams = [{params}]\n'
    )


# EXIF and XMP as a camera drone writes them (EXIF 2.32, CIPA DC-008; DJI's drone-dji namespace).


def exif_block(intrinsics: Intrinsics, taken_at: datetime, position: Sequence[float] | None = None) -> Image.Exif:
    """Camera, focal length, time and, where given, GPS position.

    FocalLengthIn35mmFilm compares diagonals and is a whole number, so that it gives the focal length in pixels to
    about 2 % only; FocalLength with FocalPlaneXResolution gives it to a thousandth.
    """
    exif = Image.Exif()
    stamp = taken_at.strftime("%Y:%m:%d %H:%M:%S")
    base, gps = ExifTags.Base, ExifTags.GPS
    exif.update({base.Make: "fieldkit", base.Model: "proxy", base.Software: "fieldkit", base.DateTime: stamp})
    diagonal = math.hypot(intrinsics.width, intrinsics.height)
    px_per_mm = intrinsics.width / _SENSOR_WIDTH_MM
    exif.get_ifd(ExifTags.IFD.Exif).update(
        {
            base.DateTimeOriginal: stamp,
            base.SubsecTimeOriginal: f"{taken_at.microsecond // 1000:03d}",
            base.FocalLength: _rational(intrinsics.fx / px_per_mm, 10_000),
            base.FocalLengthIn35mmFilm: round(intrinsics.fx * _FILM_DIAGONAL_MM / diagonal),
            base.FocalPlaneXResolution: _rational(px_per_mm, 1_000_000),
            base.FocalPlaneYResolution: _rational(px_per_mm * intrinsics.fy / intrinsics.fx, 1_000_000),
            base.FocalPlaneResolutionUnit: 4,  # millimetre
            base.ExifImageWidth: intrinsics.width,
            base.ExifImageHeight: intrinsics.height,
            base.BodySerialNumber: "proxy-1",
        }
    )
    if position is not None:
        latitude, longitude, altitude = position
        exif.get_ifd(ExifTags.IFD.GPSInfo).update(
            {
                gps.GPSVersionID: b"\x02\x03\x00\x00",
                gps.GPSLatitudeRef: "N" if latitude >= 0 else "S",
                gps.GPSLatitude: _sexagesimal(latitude),
                gps.GPSLongitudeRef: "E" if longitude >= 0 else "W",
                gps.GPSLongitude: _sexagesimal(longitude),
                # DJI writes 0 (sea level) here even where AltitudeType says that the height is ellipsoidal.
                gps.GPSAltitudeRef: b"\x00" if altitude >= 0 else b"\x01",
                gps.GPSAltitude: _rational(abs(altitude), 1000),
                gps.GPSMapDatum: "WGS-84",
            }
        )
    return exif


def xmp_packet(site: Site, position: Sequence[float], height_m: float, angles_deg: Sequence[float]) -> bytes:
    """DJI's fields: position, altitudes, gimbal and flight angles, RTK state.

    Args:
        site: whether the position is a fixed RTK solution, and how exact.
        position: latitude and longitude in degrees and height above the ellipsoid in metres, as the drone believes.
        height_m: above the take-off point.
        angles_deg: yaw, pitch and roll of the gimbal, as `Pose.from_yaw_pitch` takes them.
    """
    latitude, longitude, altitude = position
    yaw, pitch, roll = angles_deg
    fields = {
        "AltitudeType": "RtkAlt" if site.rtk else "GpsFusionAlt",
        "GpsStatus": "RTK" if site.rtk else "GPS",
        "GpsLatitude": f"{latitude:+.9f}",
        "GpsLongitude": f"{longitude:+.9f}",
        "AbsoluteAltitude": f"{altitude:+.3f}",
        "RelativeAltitude": f"{height_m:+.3f}",
        "GimbalRollDegree": f"{roll:+.2f}",
        "GimbalYawDegree": f"{wrapped_deg(yaw):+.2f}",
        "GimbalPitchDegree": f"{pitch:+.2f}",
        "FlightRollDegree": "+0.00",
        "FlightYawDegree": f"{wrapped_deg(yaw):+.2f}",
        "FlightPitchDegree": "+0.00",
        "RtkFlag": str(RTK_FIXED if site.rtk else 0),
    }
    if site.rtk:
        horizontal_m, vertical_m = site.accuracy_m
        fields |= dict.fromkeys(("RtkStdLon", "RtkStdLat"), f"{horizontal_m:.5f}")
        fields["RtkStdHgt"] = f"{vertical_m:.5f}"
    attributes = "\n   ".join(f'drone-dji:{name}="{value}"' for name, value in fields.items())
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'
        '<x:xmpmeta xmlns:x="adobe:ns:meta/">\n'
        ' <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">\n'
        '  <rdf:Description rdf:about="fieldkit proxy"\n'
        '   xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"\n'
        f"   {attributes}/>\n"
        ' </rdf:RDF>\n</x:xmpmeta>\n<?xpacket end="w"?>'
    ).encode()


def _rational(value: float, denominator: int) -> TiffImagePlugin.IFDRational:
    return TiffImagePlugin.IFDRational(round(value * denominator), denominator)


def _sexagesimal(degrees: float) -> tuple[TiffImagePlugin.IFDRational, ...]:
    """Degrees, minutes and seconds; the seconds in 10⁻⁶, which is 0.03 mm."""
    total = round(abs(degrees) * 3600 * 1_000_000)
    whole, micro = divmod(total, 60_000_000)
    return _rational(whole // 60, 1), _rational(whole % 60, 1), TiffImagePlugin.IFDRational(micro, 1_000_000)
