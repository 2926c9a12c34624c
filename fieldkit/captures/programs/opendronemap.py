"""OpenDroneMap's cameras: OpenSfM's reconstruction.json, odm_report/shots.geojson and cameras.json.

OpenSfM (opensfm.org/docs/geometry.html): ``rotation`` is the rotation vector of the world-to-camera rotation,
``translation`` the vector with it; the camera's axes are x right, y down, z forward. The world is east-north-up about
``reference_lla``. Lengths of the image plane are shares of the picture's longer side, counted from its middle.

After OpenDroneMap has georeferenced, reconstruction.json is another: east and north of a UTM zone, less an offset, and
the first one is called reconstruction.topocentric.json. shots.geojson has UTM coordinates, and rotations against them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.programs.frames import local_from_geodetic
from fieldkit.captures.programs.json_text import REMEDY, number, read_json, vector
from fieldkit.captures.programs.model import ANGLE_ACCURACY_DEG, ProgramCamera, ProgramPoses
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import SEMI_MAJOR_M, LocalFrame, on_earth, utm_epsg
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.results.finding import Finding
from fieldkit.wording import count

TOPOCENTRIC, RECONSTRUCTION, SHOTS, CAMERAS = (
    "reconstruction.topocentric.json", "reconstruction.json", "shots.geojson", "cameras.json",
)  # fmt: skip
_FALSE_EASTING_M, _UTM_SCALE = 500_000.0, 0.9996
_NEAR_M = 20_000.0  # the approximate easting is good to a few kilometres, other zones' are hundreds of them away
_SMALL_TURN_DEG = 0.05
_CERTAIN = 3.0  # standard deviations
_LEAST_GPS = 3
_GRID_REMEDY = "Give opensfm/reconstruction.topocentric.json or odm_report/shots.geojson of the same result."


def read_reconstruction(path: Path) -> ProgramPoses:
    """OpenSfM's reconstruction.json or reconstruction.topocentric.json.

    Raises:
        MetadataError: it is unreadable, malformed, or in the coordinates of a UTM zone.
    """
    data = read_json(path)
    parts = [part for part in data if isinstance(part, dict)] if isinstance(data, list) else []
    if not any(part.get("shots") for part in parts):
        raise MetadataError("holds no reconstruction of OpenSfM", path=path, remedy=REMEDY)
    try:
        largest = max(parts, key=lambda part: len(_object(part, "shots")))
        return _reconstruction(largest, parts, path)
    except (ValueError, TypeError, AttributeError) as error:
        raise MetadataError(f"is no reconstruction of OpenSfM: {error}", path=path, remedy=REMEDY) from error


def read_shots(path: Path) -> ProgramPoses:
    """odm_report/shots.geojson.

    Raises:
        MetadataError: it is unreadable, malformed, or was made without GPS.
    """
    data = read_json(path)
    poses, places, eastings = {}, [], []
    try:
        for feature in data["features"]:
            properties, coordinates = feature["properties"], feature["geometry"]["coordinates"]
            longitude, latitude, height = vector([*coordinates, 0.0][:3], "coordinates")
            rotation = rotation_from_vector(vector(properties["rotation"], "rotation"))
            poses[str(properties["filename"])] = Pose(rotation, np.zeros(3))
            places.append((latitude, longitude, height))
            eastings.append(vector(properties["translation"], "translation")[0])
    except (ValueError, TypeError, KeyError, IndexError) as error:
        raise MetadataError(f"is no shots.geojson of OpenDroneMap: {error}", path=path, remedy=REMEDY) from error
    if not poses or len(places) != len(poses):
        raise MetadataError("lists no photograph, or one twice", path=path, remedy=REMEDY)
    geodetic = np.array(places)
    if not all(on_earth(latitude, longitude) for latitude, longitude, _ in places):
        raise MetadataError("has places that are none on Earth", path=path, remedy=REMEDY)
    meridian = _central_meridian(geodetic, np.array(eastings), path)
    headings = grid_heading(geodetic[:, 0], geodetic[:, 1], meridian)
    origin, placed = local_from_geodetic(poses, geodetic, headings, "unknown")
    cameras = [path.parent / CAMERAS, path.parent.parent / CAMERAS]
    found = next((file for file in cameras if file.is_file()), None)
    return ProgramPoses(
        "OpenDroneMap", path, placed, metric=True, origin=origin, cameras=() if found is None else read_cameras(found),
        frame_said="in metres about the place it gives",
    )  # fmt: skip


def read_cameras(path: Path) -> tuple[ProgramCamera, ...]:
    """The calibrations of OpenDroneMap's cameras.json, each for all photographs of its size; none of two alike in size.

    Raises:
        MetadataError: it is unreadable or malformed.
    """
    data = read_json(path)
    if not isinstance(data, dict) or not data or not all(isinstance(each, dict) for each in data.values()):
        raise MetadataError("is no cameras.json of OpenDroneMap", path=path, remedy=REMEDY)
    try:
        found = [_camera(each, ()) for each in data.values()]
    except ValueError as error:
        raise MetadataError(f"is no cameras.json of OpenDroneMap: {error}", path=path, remedy=REMEDY) from error
    cameras = [camera for camera in found if camera is not None]
    sizes = [(camera.intrinsics.width, camera.intrinsics.height) for camera in cameras]
    return tuple(camera for camera, size in zip(cameras, sizes, strict=True) if sizes.count(size) == 1)


def grid_heading(latitude_deg: Any, longitude_deg: Any, meridian_deg: float) -> NDArray[np.float64]:
    """Heading of a transverse Mercator grid's north, radians clockwise from true north, to a hundredth of a degree."""
    away = np.radians((np.asarray(longitude_deg) - meridian_deg + 180.0) % 360.0 - 180.0)
    return np.asarray(np.arctan(np.tan(away) * np.sin(np.radians(latitude_deg))))


def _reconstruction(part: Mapping[str, Any], parts: list[dict[str, Any]], path: Path) -> ProgramPoses:
    shots = _object(part, "shots")
    poses = {}
    for name, shot in shots.items():
        rotation = rotation_from_vector(vector(shot.get("rotation"), f"the rotation of {name}"))
        translation = vector(shot.get("translation"), f"the translation of {name}")
        poses[name] = Pose(rotation, -rotation.T @ translation)
    cameras = []
    findings = []
    for key, camera in _object(part, "cameras").items():
        names = tuple(name for name, shot in shots.items() if shot.get("camera") == key)
        if not names:
            continue
        own = _camera(camera, names)
        if own is None:
            kind = camera.get("projection_type")
            findings.append(Finding(names[0], "camera-unused", f"OpenDroneMap's camera is not used: it is {kind!r}"))
        else:
            cameras.append(own)
    if left := sum(len(_object(other, "shots")) for other in parts) - len(shots):
        others = count(left, "photograph is", "photographs are")
        message = f"OpenDroneMap's reconstruction fell apart: {others} in other parts and not used"
        findings.append(Finding(path.name, "poses-apart", message))
    gps = {
        name: vector(shot["gps_position"], "gps_position")
        for name, shot in shots.items()
        if isinstance(shot.get("gps_position"), list)
    }
    origin = _origin(part, gps)
    angle_deg = ANGLE_ACCURACY_DEG
    if origin is not None and path.name != TOPOCENTRIC:
        open_deg = _turn_left_open(poses, gps, origin, path)
        if open_deg:
            message = (
                "whether OpenDroneMap has turned this file to the grid of a UTM zone cannot be told from it: all "
                f"headings may be off by {open_deg:.2f}°. {_GRID_REMEDY}"
            )
            findings.append(Finding(path.name, "heading-open", message))
            angle_deg = float(np.hypot(angle_deg, open_deg))
    said = "in metres about the place it gives" if origin else "without metric scale, since it was made without GPS"
    return ProgramPoses(
        "OpenDroneMap", path, poses, metric=origin is not None, origin=origin, angle_accuracy_deg=angle_deg,
        cameras=tuple(cameras), frame_said=said, findings=tuple(findings),
    )  # fmt: skip


def _object(values: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = values.get(key) or {}
    if not isinstance(found, dict) or not all(isinstance(each, dict) for each in found.values()):
        raise ValueError(f"{key} is no object of objects")
    return found


def _origin(part: Mapping[str, Any], gps: Mapping[str, NDArray[np.float64]]) -> LocalFrame | None:
    """Of the east-north-up world; None where the reconstruction was made without GPS and has an arbitrary scale."""
    reference = part.get("reference_lla")
    if not isinstance(reference, dict):
        return None
    latitude, longitude = number(reference, "latitude"), number(reference, "longitude")
    if not on_earth(latitude, longitude):
        raise ValueError("reference_lla is no place on Earth")
    places = {tuple(np.round(place, 3)) for place in gps.values()}
    if (latitude, longitude) == (0.0, 0.0) or (gps and len(places) < _LEAST_GPS):
        return None
    return LocalFrame(latitude, longitude, number(reference, "altitude", 0.0), "unknown")


def _turn_left_open(
    poses: Mapping[str, Pose], gps: Mapping[str, NDArray[np.float64]], origin: LocalFrame, path: Path
) -> float:
    """By how many degrees headings may be off, since the file may be turned to a UTM grid; 0 where it surely is not.

    GPS positions are kept as they were, about reference_lla.

    Raises:
        MetadataError: it is turned.
    """
    try:
        zone = utm_epsg(origin.latitude_deg, origin.longitude_deg) % 100
    except ValueError:
        return 0.0  # no UTM there
    meridian = 6.0 * zone - 183.0
    turned = float(grid_heading(origin.latitude_deg, origin.longitude_deg, meridian))
    if abs(np.degrees(turned)) < _SMALL_TURN_DEG:
        return 0.0
    names = [name for name in poses if name in gps]
    if len(names) < _LEAST_GPS:
        return abs(float(np.degrees(turned)))
    here = np.array([poses[name].center[:2] for name in names]) @ np.array([1.0, 1.0j])
    there = np.array([gps[name][:2] for name in names]) @ np.array([1.0, 1.0j])
    here, there = here - here.mean(), there - there.mean()
    found = np.vdot(here, there)
    angle = -float(np.angle(found))  # clockwise, as headings are
    noise = float(np.sqrt(np.mean(np.abs(there - here * np.exp(-1j * angle)) ** 2) / (np.abs(here) ** 2).sum()))
    as_grid, as_true = abs(angle - turned), abs(angle)
    if abs(turned) < 2.0 * _CERTAIN * noise:
        return abs(float(np.degrees(turned)))
    if as_grid < as_true:
        raise MetadataError(
            "is in the coordinates of a UTM zone, less an offset that it does not hold", path=path, remedy=_GRID_REMEDY
        )
    return 0.0


def _central_meridian(geodetic: NDArray[np.float64], eastings: NDArray[np.float64], path: Path) -> float:
    """Of the UTM zone that eastings are in, degrees."""
    latitude, longitude = (float(v) for v in np.median(geodetic[:, :2], axis=0))
    easting = float(np.median(eastings))
    own = np.floor((longitude + 180.0) / 6.0) * 6.0 - 177.0
    expected = {
        float(meridian): _FALSE_EASTING_M
        + _UTM_SCALE * SEMI_MAJOR_M * float(np.arctanh(np.cos(np.radians(latitude)) * np.sin(np.radians(away))))
        for meridian in (own, own - 6.0, own + 6.0)
        for away in [(longitude - meridian + 180.0) % 360.0 - 180.0]
    }
    nearest = min(expected, key=lambda meridian: abs(expected[meridian] - easting))
    if abs(expected[nearest] - easting) > _NEAR_M:
        raise MetadataError(
            "has coordinates that do not fit its places, as where photographs have no GPS", path=path,
            remedy="Give opensfm/reconstruction.json instead.",
        )  # fmt: skip
    return nearest


def _camera(camera: Mapping[str, Any], names: tuple[str, ...]) -> ProgramCamera | None:
    """COLMAP's camera of OpenSfM's; None of a projection that has none. Raises ValueError: it is malformed."""
    kind = camera.get("projection_type", "perspective")
    width, height = int(number(camera, "width")), int(number(camera, "height"))
    side = max(width, height)
    # OpenSfM counts from the middle of the picture, COLMAP from its corner.
    middle = (width / 2 + side * number(camera, "c_x", 0.0), height / 2 + side * number(camera, "c_y", 0.0))
    params: tuple[float, ...]
    k1, k2, k3, p1, p2 = (number(camera, key, 0.0) for key in ("k1", "k2", "k3", "p1", "p2"))
    if kind == "perspective":
        model, params = "RADIAL", (side * number(camera, "focal"), *middle, k1, k2)
    elif kind in ("brown", "simple_radial", "radial"):
        fx = side * number(camera, "focal_x")
        fy = side * number(camera, "focal_y")
        if kind != "brown":
            k3 = p1 = p2 = 0.0
            k2 = k2 if kind == "radial" else 0.0
        model, params = "FULL_OPENCV", (fx, fy, *middle, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0)
    else:
        return None
    return ProgramCamera(Intrinsics(model, width, height, tuple(float(p) for p in params)), names)
