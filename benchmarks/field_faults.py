"""Captures with faults for the study of `fieldkit check`.

A plot is photographed twice, as planned and from elsewhere. Faults are made of these photographs: pixels are blurred or
exposed anew, tags exchanged, shifted or turned. Sound photographs keep their files, so their features are computed
once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.scene_views import CAMERA
from fieldkit.arrays import ByteArray, Float32Array, FloatArray
from fieldkit.captures import Capture, GeoTag, Photo, read_capture
from fieldkit.captures.poses_csv import PoseRow, poses_table
from fieldkit.captures.priors import priors_from_gps
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.priors import POSITION_SIGMA_M, PosePrior
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.routing.mission import Home
from fieldkit.scenes.description import build
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import Outdoors, Sidecars, simulate_capture
from fieldkit.sites.site import Site, SitePlot

STATIONS = 13
_RADII_M, _HEIGHTS_M, _TARGET_M = (1.25, 1.6), (0.9, 1.5), 0.25
_FLOWN_M, _FLOWN_DEG = 0.05, 1.2
_STRAYED_M, _STRAYED_DEG = (0.4, 1.2), 12.0
_NEAREST_M, _LOWEST_M = 0.75, 0.6
_GAMMA = 2.0

Image8 = ByteArray


@dataclass(frozen=True, eq=False)
class PlotPhotographs:
    """A plot, its plan and photographs."""

    name: str
    """Of the scene."""
    folder: Path
    """Of its photographs."""
    flown: Path
    strayed: Path
    """Folders of photographs taken as planned with a flight's noise, and from elsewhere."""
    plan: Plan
    """Of 13 stations."""
    site: Site
    """Where the plot lies."""
    commanded: str
    """Text of a poses.csv."""
    grain: float
    """Of the camera, grey levels."""


@dataclass(frozen=True)
class Fault:
    """The fault of one photograph, or of two whose tags were exchanged."""

    kind: str
    detail: str
    stations: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class FaultyCapture:
    """A capture with its faults; ``tags`` is "RTK", "GPS" or "commanded"."""

    capture: Capture
    faults: tuple[Fault, ...]
    tags: str


def photograph_plot(scene: str, folder: Path, seed: int) -> PlotPhotographs:
    """Photographs of a scene from 13 stations on an uneven ring, with the scene's camera; existing ones are kept."""
    description = read_scene(find_scene(scene))
    rng = np.random.default_rng([seed, 9])
    feet = np.array([(plant.x_m, plant.y_m) for plant in description.plot.plants] or [(0.0, 0.0)])
    middle = np.append(0.5 * (feet.min(axis=0) + feet.max(axis=0)), _TARGET_M)
    stations = _stations(middle, rng)
    strayed = [_astray(pose, middle, rng) for pose in stations]
    plan = plan_from_poses(stations, CAMERA, row_heading_deg=description.row_heading_deg)
    origin = description.site.origin
    noise = replace(description.noise, position_m=_FLOWN_M, angle_deg=_FLOWN_DEG)
    if not all((folder / name).is_dir() for name in ("flown", "strayed")):
        with Renderer(build(description)) as renderer:
            for name, poses, number in (("flown", stations, 1), ("strayed", strayed, 2)):
                simulate_capture(
                    folder / name,
                    renderer,
                    poses,
                    CAMERA,
                    noise=noise,
                    effects=description.camera_effects,
                    outdoors=Outdoors(description.wind_m),
                    seed=seed + 100 * number,
                    site=description.site,
                    row_heading_deg=description.row_heading_deg,
                    sidecars=Sidecars(),
                    economy=True,
                    overwrite=True,
                )
    names = [photo.name for photo in read_capture(folder / "flown").photos]
    return PlotPhotographs(
        description.name,
        folder,
        folder / "flown",
        folder / "strayed",
        plan,
        _site(origin, description.row_heading_deg),
        poses_table([PoseRow.of(n, p, POSITION_SIGMA_M) for n, p in zip(names, stations, strict=True)]),
        description.camera_effects.grain,
    )


def draw_capture(plot: PlotPhotographs, work: Path, seed: int, number: int) -> FaultyCapture:
    """One capture of a plot with one or two faulty photographs; the same for the same seed and number."""
    rng = np.random.default_rng([seed, number, *plot.name.encode()])
    tags = ("RTK", "GPS", "commanded")[int(rng.integers(3))]
    flown, strayed = read_capture(plot.flown), read_capture(plot.strayed)
    photos: dict[int, Photo] = dict(enumerate(flown.photos))
    rows: dict[int, int] = {k: k for k in photos}  # index of each photograph's tags
    edits: dict[int, Callable[[GeoTag, tuple[float, float]], tuple[GeoTag, tuple[float, float]]]] = {}
    faults: list[Fault] = []
    free = list(rng.permutation(len(photos)))
    spoilt = work / f"{plot.name}-spoilt"
    spoilt.mkdir(parents=True, exist_ok=True)
    kinds = ["missing", "blurred", "displaced", "mis-tagged", "exposure"]
    for kind in rng.choice(kinds, size=int(rng.integers(1, 3)), replace=False, p=[0.225, 0.225, 0.225, 0.225, 0.1]):
        k = int(free.pop())
        if kind == "missing":
            del photos[k]
            faults.append(Fault("missing", "", (k,)))
        elif kind in ("blurred", "exposure"):
            file, detail = _spoil(photos[k], kind, plot.grain, spoilt / f"{seed}-{number}-{k}.jpg", rng)
            photos[k] = _of_file(photos[k], file)
            faults.append(Fault(str(kind), detail, (k,)))
        elif kind == "displaced":
            photos[k] = replace(strayed.photos[k], name=photos[k].name)
            said = "not in the tags" if tags == "commanded" else "in the tags"
            faults.append(Fault("displaced", said, (k,)))
        else:
            how = "exchanged" if tags == "commanded" else str(rng.choice(["exchanged", "shifted", "turned"]))
            if how == "exchanged":
                other = int(free.pop())
                rows[k], rows[other] = other, k
                faults.append(Fault("mis-tagged", how, (k, other)))
            else:
                edits[k], detail = (_shift_tag if how == "shifted" else _turn_tag)(rng)
                faults.append(Fault("mis-tagged", f"{how}, {detail}", (k,)))
    return FaultyCapture(_tagged(flown, photos, rows, edits, tags, plot, rng), tuple(faults), tags)


def _stations(middle: FloatArray, rng: np.random.Generator) -> list[Pose]:
    start = rng.uniform(0.0, 360.0)
    poses = []
    for i in range(STATIONS):
        azimuth = np.radians(start + 360.0 * i / STATIONS + rng.normal() * 4.0)
        radius, height = rng.uniform(*_RADII_M), rng.uniform(*_HEIGHTS_M)
        target = middle + rng.normal(size=3) * (0.08, 0.08, 0.04)
        place = (middle[0] + radius * np.sin(azimuth), middle[1] + radius * np.cos(azimuth), height)
        poses.append(Pose.look_at(place, target))
    return poses


def _astray(pose: Pose, middle: FloatArray, rng: np.random.Generator) -> Pose:
    """A pose up to 1.2 m off, turned as commanded, at random, or towards the plot."""
    while True:
        shift = rng.normal(size=3) * (1.0, 1.0, 0.3)
        place = pose.center + shift / np.linalg.norm(shift) * rng.uniform(*_STRAYED_M)
        if np.linalg.norm(place[:2] - middle[:2]) >= _NEAREST_M and place[2] >= _LOWEST_M:
            break
    if rng.random() < 0.5:
        return Pose.look_at(place, middle)
    yaw, pitch, _ = pose.yaw_pitch_roll_deg()
    turn = rng.normal(size=2) * (_STRAYED_DEG, _STRAYED_DEG / 4.0)
    return Pose.from_yaw_pitch(place, yaw + turn[0], float(np.clip(pitch + turn[1], -85.0, 0.0)))


def _site(origin: LocalFrame, row_heading_deg: float) -> Site:
    home = Home(latitude_deg=origin.latitude_deg, longitude_deg=origin.longitude_deg, ellipsoid_m=origin.altitude_m)
    plot = SitePlot(
        latitude_deg=origin.latitude_deg, longitude_deg=origin.longitude_deg, row_heading_deg=row_heading_deg
    )
    return Site(home=home, plots=(plot,))


def _spoil(photo: Photo, kind: str, grain: float, file: Path, rng: np.random.Generator) -> tuple[Path, str]:
    """Blur a photograph, or change its exposure. Its noise is blurred too, so the camera's noise is added again."""
    image = cv2.imread(str(photo.path))
    assert image is not None
    pixels = image.astype(np.float32)
    if kind == "exposure":
        stops = float(rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 3.5))
        pixels = pixels * np.float32(2.0 ** (stops / _GAMMA))
        detail = f"{'too dark' if stops < 0 else 'too bright'}, {stops:+.1f} stops"
    elif rng.random() < 0.5:
        sigma = float(rng.uniform(1.8, 4.0))
        pixels, detail = _floats(cv2.GaussianBlur(pixels, (0, 0), sigma)), f"out of focus, σ {sigma:.1f} px"
    else:
        length, angle = float(rng.uniform(6.0, 20.0)), float(rng.uniform(0.0, np.pi))
        pixels, detail = _floats(cv2.filter2D(pixels, -1, _motion(length, angle))), f"by motion, {length:.0f} px"
    noise = _floats(cv2.GaussianBlur(np.asarray(rng.normal(size=image.shape), np.float32), (0, 0), 0.8))
    noise *= np.float32(grain / max(float(noise.std()), 1e-6))
    spoilt = np.asarray(np.clip(pixels + noise, 0, 255), dtype=np.uint8)
    with Image.open(photo.path) as original:
        exif = original.info.get("exif", b"")
        Image.fromarray(spoilt[:, :, ::-1]).save(file, "JPEG", quality=85, exif=exif)
    return file, detail


def _floats(values: NDArray[np.integer | np.floating]) -> Float32Array:
    return np.asarray(values, dtype=np.float32)


def _motion(length_px: float, angle_rad: float) -> Float32Array:
    """The kernel of a line with subpixel ends."""
    half = int(np.ceil(length_px / 2.0)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    for t in np.linspace(-0.5, 0.5, 8 * half) * length_px:
        x, y = half + t * np.cos(angle_rad), half + t * np.sin(angle_rad)
        x0, y0 = int(x), int(y)
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            kernel[y0 + dy, x0 + dx] += (1 - abs(x - x0 - dx)) * (1 - abs(y - y0 - dy))
    return kernel / float(kernel.sum())


def _of_file(photo: Photo, file: Path) -> Photo:
    """The photograph with another file's pixels."""
    return replace(photo, path=file, sha256=hashlib.sha256(file.read_bytes()).hexdigest())


def _shift_tag(
    rng: np.random.Generator,
) -> tuple[Callable[[GeoTag, tuple[float, float]], tuple[GeoTag, tuple[float, float]]], str]:
    metres, azimuth = float(np.exp(rng.uniform(np.log(0.5), np.log(8.0)))), float(rng.uniform(0.0, 2.0 * np.pi))

    def edit(tag: GeoTag, angles: tuple[float, float]) -> tuple[GeoTag, tuple[float, float]]:
        frame = LocalFrame(tag.latitude_deg, tag.longitude_deg)
        latitude, longitude, _ = frame.to_geodetic((metres * np.sin(azimuth), metres * np.cos(azimuth), 0.0))
        return replace(tag, latitude_deg=float(latitude[0]), longitude_deg=float(longitude[0])), angles

    return edit, f"{metres:.1f} m"


def _turn_tag(
    rng: np.random.Generator,
) -> tuple[Callable[[GeoTag, tuple[float, float]], tuple[GeoTag, tuple[float, float]]], str]:
    degrees = float(rng.choice([-1.0, 1.0]) * rng.uniform(15.0, 180.0))

    def edit(tag: GeoTag, angles: tuple[float, float]) -> tuple[GeoTag, tuple[float, float]]:
        return tag, (angles[0] + degrees, angles[1])

    return edit, f"{degrees:+.0f}°"


def _tagged(
    flown: Capture,
    photos: Mapping[int, Photo],
    rows: Mapping[int, int],
    edits: Mapping[int, Callable[[GeoTag, tuple[float, float]], tuple[GeoTag, tuple[float, float]]]],
    tags: str,
    plot: PlotPhotographs,
    rng: np.random.Generator,
) -> Capture:
    """The capture as `read_capture` would give it with these tags."""
    order = sorted(photos)
    names = tuple(photos[k].name for k in order)
    groups = tuple(replace(group, photos=tuple(n for n in group.photos if n in names)) for group in flown.groups)
    if tags == "commanded":
        priors = {}
        for k in order:
            station = plot.plan.stations[rows[k]]
            prior = PosePrior(np.array(station.position_m), source="poses.csv")
            priors[photos[k].name] = prior.with_angles((station.yaw_deg, station.pitch_deg, None))
        return replace(
            flown,
            photos=tuple(photos[k] for k in order),
            groups=groups,
            priors=priors,
            metric_source="poses.csv",
            origin=None,
            height_source=None,
            findings=(),
        )
    offset = np.zeros(3)
    if tags == "GPS":
        azimuth = rng.uniform(0.0, 2.0 * np.pi)
        offset = np.append(np.array([np.sin(azimuth), np.cos(azimuth)]) * rng.uniform(1.0, 3.0), rng.normal() * 3.0)
    retagged = [_retagged(photos[k], _source(photos, flown, rows, k), edits.get(k), offset) for k in order]
    found = priors_from_gps(retagged)
    return replace(
        flown,
        photos=tuple(retagged),
        groups=groups,
        priors=found.priors,
        metric_source=found.metric_source,
        origin=found.origin,
        height_source=found.height_source,
        findings=found.findings,
    )


def _source(photos: Mapping[int, Photo], flown: Capture, rows: Mapping[int, int], k: int) -> Photo:
    """The photograph whose tags this one has: itself, unless they were exchanged."""
    return photos[k] if rows[k] == k else photos.get(rows[k], flown.photos[rows[k]])


def _retagged(
    photo: Photo,
    source: Photo,
    edit: Callable[..., tuple[GeoTag, tuple[float, float]]] | None,
    offset: FloatArray,
) -> Photo:
    tag, angles = source.geotag, (source.yaw_deg or 0.0, source.pitch_deg or 0.0)
    assert tag is not None
    if edit is not None:
        tag, angles = edit(tag, angles)
    if offset.any():
        frame = LocalFrame(tag.latitude_deg, tag.longitude_deg, tag.altitude_m or 0.0)
        latitude, longitude, altitude = (float(v[0]) for v in frame.to_geodetic(offset))
        tag = GeoTag(latitude, longitude, altitude, tag.datum)
    yaw = (angles[0] + 180.0) % 360.0 - 180.0
    return replace(photo, geotag=tag, yaw_deg=yaw, pitch_deg=angles[1], roll_deg=source.roll_deg, flight_yaw_deg=yaw)
