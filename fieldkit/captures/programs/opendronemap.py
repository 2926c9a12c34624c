"""OpenDroneMap's cameras: odm_report/shots.geojson, and cameras.json beside it or above.

shots.geojson has places on the Earth, UTM coordinates, and rotation vectors from the axes of that grid to the camera's
(x right, y down, z forward). Lengths in a picture are shares of its longer side (opensfm.org/docs/geometry.html).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures.camera_file import CameraEntry
from fieldkit.captures.crs import local_from_geodetic
from fieldkit.captures.programs.model import ProgramPoses
from fieldkit.documents.file_bytes import file_bytes
from fieldkit.documents.json_file import json_number
from fieldkit.errors import MetadataError, about
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import SEMI_MAJOR_M, on_earth
from fieldkit.geometry.pose import rotation_from_vector

SHOTS, CAMERAS = "shots.geojson", "cameras.json"
_REMEDY = "Copy the file again from the program's results."
_MAX_BYTES = 512 << 20
"""Largest file that is read, bytes."""
_FALSE_EASTING_M = 500_000.0
"""Easting of a UTM zone's central meridian, metres."""
_UTM_SCALE = 0.9996
"""Scale of UTM along its central meridian."""
_NEAR_M = 20_000.0  # the approximate easting is good to a few kilometres, other zones' are hundreds of them away


def read_shots(path: Path) -> ProgramPoses:
    """The photographs of a shots.geojson; MetadataError also where it was made without GPS."""
    poses: dict[str, Pose] = {}
    sizes: dict[tuple[int, int], list[str]] = {}
    places, eastings = [], []
    with _document(path, SHOTS) as data:
        for feature in data["features"]:
            properties, name = feature["properties"], str(feature["properties"]["filename"])
            longitude, latitude, height = _vector({"place": [*feature["geometry"]["coordinates"], 0.0]}, "place")
            if not on_earth(latitude, longitude) or name in poses:
                raise ValueError(f"the place of {name} is none on Earth, or it is there twice")
            poses[name] = Pose(rotation_from_vector(_vector(properties, "rotation")), np.zeros(3))
            places.append((latitude, longitude, height))
            eastings.append(_vector(properties, "translation")[0])
            sizes.setdefault((properties.get("width"), properties.get("height")), []).append(name)
        if not poses:
            raise ValueError("it lists no photograph")
    geodetic = np.array(places)
    headings = grid_heading(geodetic[:, 0], geodetic[:, 1], _central_meridian(geodetic, np.array(eastings), path))
    origin, placed = local_from_geodetic(poses, geodetic, headings, "unknown")
    beside = (path.parent / CAMERAS, path.parent.parent / CAMERAS)
    return ProgramPoses(
        "OpenDroneMap",
        path,
        placed,
        metric=True,
        origin=origin,
        frame_said="in metres about the place it gives",
        cameras=next((_read_cameras(file, sizes) for file in beside if file.is_file()), ()),
    )


def _read_cameras(path: Path, names: Mapping[tuple[int, int], list[str]]) -> tuple[CameraEntry, ...]:
    """The calibrations of a cameras.json for the photographs of their sizes; none of two alike in size."""
    with _document(path, CAMERAS) as data:
        cameras = [camera for each in data.values() if (camera := _camera(each)) is not None]
    sizes = [(camera.width, camera.height) for camera in cameras]
    return tuple(
        CameraEntry(camera, tuple(names[size]))
        for camera, size in zip(cameras, sizes, strict=True)
        if size in names and sizes.count(size) == 1
    )


def grid_heading(latitude_deg: Any, longitude_deg: Any, meridian_deg: float) -> FloatArray:
    """Heading of a transverse Mercator grid's north, radians clockwise from true north, to a hundredth of a degree."""
    away = np.radians((np.asarray(longitude_deg) - meridian_deg + 180.0) % 360.0 - 180.0)
    return np.asarray(np.arctan(np.tan(away) * np.sin(np.radians(latitude_deg))))


def _central_meridian(geodetic: FloatArray, eastings: FloatArray, path: Path) -> float:
    """Of the UTM zone that eastings are in, degrees."""
    latitude, longitude = (float(v) for v in np.median(geodetic[:, :2], axis=0))
    own = np.floor((longitude + 180.0) / 6.0) * 6.0 - 177.0

    def off_m(meridian: float) -> float:
        away = np.radians((longitude - meridian + 180.0) % 360.0 - 180.0)
        east = _UTM_SCALE * SEMI_MAJOR_M * np.arctanh(np.cos(np.radians(latitude)) * np.sin(away))
        return abs(float(_FALSE_EASTING_M + east - np.median(eastings)))

    nearest = min((float(own), float(own - 6.0), float(own + 6.0)), key=off_m)
    if off_m(nearest) > _NEAR_M:
        raise MetadataError(
            "has coordinates that do not fit its places, as where photographs have no GPS",
            path=path,
            remedy="Give the model as COLMAP has it: opensfm export_colmap.",
        )
    return nearest


def _camera(camera: Mapping[str, Any]) -> Intrinsics | None:
    """COLMAP's camera of OpenSfM's; None of a projection that has none. Raises ValueError: it is malformed."""
    kind = camera.get("projection_type", "perspective")
    width, height = int(_number(camera, "width")), int(_number(camera, "height"))
    side = max(width, height)
    # OpenSfM counts from the middle of the picture, COLMAP from its corner.
    middle = (width / 2 + side * _number(camera, "c_x", 0.0), height / 2 + side * _number(camera, "c_y", 0.0))
    k1, k2, k3, p1, p2 = (_number(camera, key, 0.0) for key in ("k1", "k2", "k3", "p1", "p2"))
    if kind == "perspective":
        return Intrinsics("RADIAL", width, height, (side * _number(camera, "focal"), *middle, k1, k2))
    if kind not in ("brown", "simple_radial", "radial"):
        return None
    if kind != "brown":
        k2, k3, p1, p2 = k2 if kind == "radial" else 0.0, 0.0, 0.0, 0.0
    focal = (side * _number(camera, "focal_x"), side * _number(camera, "focal_y"))
    return Intrinsics("FULL_OPENCV", width, height, (*focal, *middle, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0))


@contextmanager
def _document(path: Path, what: str) -> Iterator[Any]:
    """A file's JSON; whatever is wrong with its values within is a MetadataError that names the file."""
    try:
        with about(path, _REMEDY):
            yield json.loads(file_bytes(path, _MAX_BYTES, noun="result of OpenDroneMap"))
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError) as error:
        raise MetadataError(f"is no {what} of OpenDroneMap: {error}", path=path, remedy=_REMEDY) from error


def _number(values: Mapping[str, Any], key: str, otherwise: float | None = None) -> float:
    value = json_number(values.get(key, otherwise))
    if value is None:
        raise ValueError(f"{key} is not a number")
    return value


def _vector(values: Mapping[str, Any], key: str) -> FloatArray:
    value = values.get(key)
    if not isinstance(value, list) or len(value) < 3:
        raise ValueError(f"{key} is not three numbers")
    return np.array([_number({key: each}, key) for each in value[:3]])
