"""Geocentric, geographic and projected coordinates, and poses in them, as a local east-north-up frame."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.errors import MetadataError
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import SEMI_MAJOR_M, LocalFrame, ecef_to_geodetic, geodetic_to_ecef
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.results.finding import Finding

_REMEDY = "Name a system that EPSG knows, like EPSG:32633, or metres where the coordinates have no place."
_GRID_REMEDY = (
    "Fetch it: pyproj sync {}, or let PROJ do so: PROJ_NETWORK=ON. Else export as WGS 84 from a GIS that has it."
)
_STEP_M = 10.0
"""Length whose image under a transformation gives its scale and direction, metres."""
_AREA_DEG = 1e-3
"""About the points' middle, where transformations are compared: a plot's neighbourhood."""
_SATELLITE_M = 0.5
"""Semi-major axes of datums that satellites gave differ from that by less."""


def parse_crs(text: str, *, said: str = "") -> Any:
    """The CRS of pyproj of a code, a WKT or a PROJ string."""
    try:
        from pyproj import CRS
        from pyproj.exceptions import CRSError
    except ImportError as error:
        raise MetadataError(
            f"{text[:40]} needs pyproj", remedy="Install it with: pip install 'fieldkit[geo]'."
        ) from error
    try:
        return CRS.from_user_input(text)
    except CRSError as error:
        message = f"{said or repr(text[:60])} is no coordinate system pyproj knows"
        raise MetadataError(message, remedy=_REMEDY) from error


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


def to_geodetic(points: FloatArray, crs: Any, subject: str) -> tuple[FloatArray, list[Finding]]:
    """WGS 84 latitude, longitude (degrees) and height (metres, above the system's own datum) of points (n, 3).

    With them comes a finding on ``subject`` where the system's datum is not WGS 84. x is east or the
    longitude. Heights are in the system's unit for them, else in that of x and y; beside degrees in metres. Raises
    MetadataError as `to_wgs84` does.
    """
    transformer, said = to_wgs84(points, crs)
    if crs.is_geocentric:
        longitude, latitude, height = (np.asarray(v) for v in transformer.transform(*points.T))
    else:
        longitude, latitude = transformer.transform(*points[:, :2].T)
        height = points[:, 2] * height_unit_m(crs)[0]
    geodetic = np.stack([np.asarray(latitude), np.asarray(longitude), height], axis=1).astype(np.float64)
    return geodetic, [Finding(subject, "gps-datum", said)] if said else []


def to_wgs84(points: FloatArray, crs: Any) -> tuple[Any, str]:
    """Pyproj's best transformation to WGS 84 where points (n, 2 or 3) lie, and its accuracy in words.

    x is east or the longitude. The words are empty where the datum is WGS 84. Datums of satellites' ellipsoid (GDA94,
    NAD83, ETRS89) lie at most metres from it and do not distort: receivers that are corrected in one fit all that is
    in it. Those on other ellipsoids lie up to hundreds of metres away.

    Raises:
        MetadataError: the points do not lie in the system, or its ellipsoid is another and PROJ lacks the grid of the
            best transformation there, or knows none.
    """
    from pyproj.transformer import AreaOfInterest, Transformer, TransformerGroup

    flat = crs if crs.is_geocentric else crs.sub_crs_list[0] if crs.is_compound else crs.to_2d()
    target = "EPSG:4979" if crs.is_geocentric else "EPSG:4326"
    about = np.array(Transformer.from_crs(flat, target, always_xy=True).transform(*points.T[: len(flat.axis_info)]))
    if not np.isfinite(about).all() or np.abs(about[1]).max(initial=0.0) > 90.0:
        raise MetadataError(
            f"coordinates such as {', '.join(f'{v:.6g}' for v in points[0])} do not lie in {crs.name}",
            remedy="Check which coordinate system they are in; x is east or the longitude.",
        )
    (west, south), (east, north) = (np.median(about[:2], axis=1) + side for side in (-_AREA_DEG, _AREA_DEG))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what is missing, which is looked at here
        group = TransformerGroup(
            flat,
            target,
            always_xy=True,
            area_of_interest=AreaOfInterest(max(west, -180), max(south, -90), min(east, 180), min(north, 90)),
        )
    best = group.transformers[0]
    if best.accuracy == 0.0:
        return best, ""
    good_to = f"to {best.accuracy:g} m" if best.accuracy > 0.0 else "with an accuracy that it does not know"
    datum = flat.geodetic_crs
    if abs(datum.ellipsoid.semi_major_metre - SEMI_MAJOR_M) > _SATELLITE_M:
        grids = sorted({grid.short_name for way in group.unavailable_operations[:1] for grid in way.grids})
        if not group.best_available:
            raise MetadataError(
                f"is in {crs.name}; without the grid {' and '.join(grids)} PROJ takes that to WGS 84 only {good_to}",
                remedy=_GRID_REMEDY.format(" ".join(f"--file {grid}" for grid in grids)),
            )
        if best.accuracy < 0.0:
            raise MetadataError(
                f"is in {crs.name}, whose datum PROJ cannot take to WGS 84",
                remedy="Name the system by its EPSG code, or export the coordinates as WGS 84 (EPSG:4326).",
            )
    return best, (
        f"PROJ takes {crs.name} to WGS 84 {good_to}: positions that drones and photographs get from corrections in the "
        f"datum {datum.name} fit it, others may lie that far beside"
    )


def frame_about(geodetic: FloatArray, datum: str) -> LocalFrame:
    """A frame in the middle of places (n, 3) of latitude, longitude and height."""
    middle = geodetic_to_ecef(*geodetic.T).mean(axis=0)
    (latitude,), (longitude,), _ = ecef_to_geodetic(middle)
    return LocalFrame(float(latitude), float(longitude), float(geodetic[:, 2].mean()), datum)


def local_from_crs(
    poses: Mapping[str, Pose], crs: Any, subject: str
) -> tuple[LocalFrame, dict[str, Pose], list[Finding]]:
    """A local frame, poses in it whose centres are a system's coordinates, and what is to be known of these.

    Orientations are of a geocentric system in its axes, else against the grid's east, north and up at each camera.
    """
    centers = np.array([pose.center for pose in poses.values()])
    geodetic, odd = to_geodetic(centers, crs, subject)
    if crs.is_geocentric:
        origin, local = _local_from_axes(poses, geodetic, height_datum(crs))
    else:
        headings = _grid_headings(centers, geodetic, crs)
        origin, local = local_from_geodetic(poses, geodetic, headings, height_datum(crs))
    return origin, local, odd


def local_from_geocentric(poses: Mapping[str, Pose]) -> tuple[LocalFrame, dict[str, Pose]]:
    """A local frame, and poses in it of geocentric ones of WGS 84 whose heights' datum is not known."""
    centers = np.array([pose.center for pose in poses.values()])
    return _local_from_axes(poses, np.stack(ecef_to_geodetic(centers), axis=1), "unknown")


def _local_from_axes(poses: Mapping[str, Pose], geodetic: FloatArray, datum: str) -> tuple[LocalFrame, dict[str, Pose]]:
    """Of poses whose orientations are against geocentric axes; centres do not count."""
    frame = frame_about(geodetic, datum)
    local, turn = frame.to_local(*geodetic.T), frame.rotation()
    placed = zip(poses.items(), local, strict=True)
    return frame, {name: Pose(pose.rotation @ turn.T, center) for (name, pose), center in placed}


def local_from_geodetic(
    poses: Mapping[str, Pose], geodetic: FloatArray, headings: FloatArray, datum: str
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
        to_true = rotation_about_z(-heading)
        placed[name] = Pose(pose.rotation @ (frame.rotation() @ level.T @ to_true).T, center)
    return frame, placed


def _grid_headings(points: FloatArray, geodetic: FloatArray, crs: Any) -> FloatArray:
    """Heading of a system's +y at points (n, 3), which are also given geodetic; radians clockwise from true north."""
    if crs.is_geographic:
        return np.zeros(len(points))
    step = np.array([0.0, _STEP_M / float(crs.axis_info[0].unit_conversion_factor), 0.0])
    there, _ = to_geodetic(points + step, crs, "")
    norths = [LocalFrame(*at).to_local(*to)[0] for at, to in zip(geodetic.tolist(), there, strict=True)]
    return np.array([np.arctan2(north[0], north[1]) for north in norths])
