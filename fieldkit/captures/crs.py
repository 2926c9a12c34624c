"""Geocentric, geographic and projected coordinates, and poses in them, as a local east-north-up frame."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.errors import MetadataError
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame, ecef_to_geodetic, geodetic_to_ecef

_REMEDY = "Name a system that EPSG knows, like EPSG:32633, or metres where the coordinates have no place."
_STEP_M = 10.0


def parse_crs(text: str, path: Path | None, *, said: str = "") -> Any:
    """The CRS of pyproj of a code, a WKT or a PROJ string."""
    try:
        from pyproj import CRS
        from pyproj.exceptions import CRSError
    except ImportError as error:
        raise MetadataError(
            f"{text[:40]} needs pyproj", path=path, remedy="Install it with: pip install 'fieldkit[geo]'."
        ) from error
    try:
        return CRS.from_user_input(text)
    except CRSError as error:
        message = f"{said or repr(text[:60])} is no coordinate system pyproj knows"
        raise MetadataError(message, path=path, remedy=_REMEDY) from error


def height_datum(crs: Any) -> str:
    """What a system's heights are measured from, as `LocalFrame` says it."""
    if crs.is_geocentric or (not crs.is_compound and len(crs.axis_info) > 2):
        return "ellipsoid"
    return "sea level" if crs.is_compound else "unknown"


def height_unit_m(crs: Any) -> tuple[float, bool]:
    """Metres per unit of heights, and whether the system says so: else that of x and y, beside degrees metres."""
    axes = crs.axis_info
    stated = len(axes) > 2
    factor = float(axes[2 if stated else 0].unit_conversion_factor) if stated or crs.is_projected else 1.0
    return 1.0 if abs(factor - 1.0) < 1e-9 else factor, stated  # a metre's own factor is 1 but for rounding


def to_geodetic(points: NDArray[np.float64], crs: Any, path: Path | None) -> NDArray[np.float64]:
    """WGS 84 latitude, longitude (degrees) and height (metres, above the system's own datum) of points (n, 3).

    x is east or the longitude. Heights are in the system's unit for them, else in that of x and y; beside degrees in
    metres.
    """
    from pyproj import Transformer

    if crs.is_geocentric:
        transformer = Transformer.from_crs(crs, "EPSG:4979", always_xy=True)
        longitude, latitude, height = (np.asarray(v) for v in transformer.transform(*points.T))
    else:
        flat = crs.sub_crs_list[0] if crs.is_compound else crs.to_2d()
        longitude, latitude = Transformer.from_crs(flat, "EPSG:4326", always_xy=True).transform(*points[:, :2].T)
        height = points[:, 2] * height_unit_m(crs)[0]
    found = np.stack([np.asarray(latitude), np.asarray(longitude), height], axis=1).astype(np.float64)
    if not np.isfinite(found).all() or np.abs(found[:, 0]).max() > 90.0:
        raise MetadataError(
            f"coordinates such as {', '.join(f'{v:.6g}' for v in points[0])} do not lie in {crs.name}",
            path=path, remedy="Check which coordinate system they are in; x is east or the longitude.",
        )  # fmt: skip
    return found


def frame_about(geodetic: NDArray[np.float64], datum: str) -> LocalFrame:
    """A frame in the middle of places (n, 3) of latitude, longitude and height."""
    middle = geodetic_to_ecef(*geodetic.T).mean(axis=0)
    (latitude,), (longitude,), _ = ecef_to_geodetic(middle)
    return LocalFrame(float(latitude), float(longitude), float(geodetic[:, 2].mean()), datum)


def local_from_crs(poses: Mapping[str, Pose], crs: Any, path: Path | None) -> tuple[LocalFrame, dict[str, Pose]]:
    """A local frame, and poses in it whose centres are a system's coordinates.

    Orientations are of a geocentric system in its axes, else against the grid's east, north and up at each camera.
    """
    centers = np.array([pose.center for pose in poses.values()])
    geodetic = to_geodetic(centers, crs, path)
    if crs.is_geocentric:
        return _local_from_axes(poses, geodetic, height_datum(crs))
    return local_from_geodetic(poses, geodetic, _grid_headings(centers, crs, path), height_datum(crs))


def local_from_geocentric(poses: Mapping[str, Pose]) -> tuple[LocalFrame, dict[str, Pose]]:
    """A local frame, and poses in it of geocentric ones of WGS 84 whose heights' datum is not known."""
    centers = np.array([pose.center for pose in poses.values()])
    return _local_from_axes(poses, np.stack(ecef_to_geodetic(centers), axis=1), "unknown")


def _local_from_axes(
    poses: Mapping[str, Pose], geodetic: NDArray[np.float64], datum: str
) -> tuple[LocalFrame, dict[str, Pose]]:
    """Of poses whose orientations are against geocentric axes; centres do not count."""
    frame = frame_about(geodetic, datum)
    local, turn = frame.to_local(*geodetic.T), frame.rotation()
    placed = zip(poses.items(), local, strict=True)
    return frame, {name: Pose(pose.rotation @ turn.T, center) for (name, pose), center in placed}


def local_from_geodetic(
    poses: Mapping[str, Pose], geodetic: NDArray[np.float64], headings: NDArray[np.float64], datum: str
) -> tuple[LocalFrame, dict[str, Pose]]:
    """A local frame, and poses in it.

    Args:
        poses: whose orientations are against a level grid's east, north and up at each camera; centres do not count.
        geodetic: (n, 3) latitudes, longitudes and heights of the centres.
        headings: (n,) of the grid's north at each, radians clockwise from true north.
        datum: of the heights.
    """
    frame = frame_about(geodetic, datum)
    placed = {}
    rows = zip(poses.items(), geodetic, headings, frame.to_local(*geodetic.T), strict=True)
    for (name, pose), (latitude, longitude, _), heading, center in rows:
        level = LocalFrame(float(latitude), float(longitude)).rotation()
        sine, cosine = np.sin(heading), np.cos(heading)
        to_true = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        placed[name] = Pose(pose.rotation @ (frame.rotation() @ level.T @ to_true).T, center)
    return frame, placed


def _grid_headings(points: NDArray[np.float64], crs: Any, path: Path | None) -> NDArray[np.float64]:
    """Heading of a system's +y at points (n, 3), radians clockwise from true north; (n,)."""
    if crs.is_geographic:
        return np.zeros(len(points))
    step = np.array([0.0, _STEP_M / float(crs.axis_info[0].unit_conversion_factor), 0.0])
    here, there = to_geodetic(points, crs, path), to_geodetic(points + step, crs, path)
    norths = [LocalFrame(at[0], at[1], at[2]).to_local(*to)[0] for at, to in zip(here.tolist(), there, strict=True)]
    return np.array([np.arctan2(north[0], north[1]) for north in norths])
