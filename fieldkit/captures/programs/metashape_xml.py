"""Metashape's cameras as XML (Export Cameras, Agisoft format).

A camera's ``transform`` is a camera-to-chunk matrix, row by row; the camera's axes are x right, y down, z forward. The
transform of its component, or of the chunk, leads from the chunk's own coordinates into geocentric ones (metres, of the
reference's ellipsoid), or into local ones where the reference is LOCAL_CS. Without it the chunk's unit is arbitrary.

Intrinsics by appendix D of the manual: f, cx and cy in pixels, these from the middle of the picture; fx = f + b1; the
manual's p1 is OpenCV's p2 and the other way round.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fieldkit.captures.programs.frames import local_from_crs, local_from_geodetic, parse_crs, to_geodetic
from fieldkit.captures.programs.model import METRES, ProgramCamera, ProgramPoses, check_open
from fieldkit.documents.file_bytes import file_bytes
from fieldkit.documents.xml_tree import XmlError, parse_local
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame, ecef_to_geodetic
from fieldkit.results.finding import Finding
from fieldkit.wording import count

_REMEDY = "Export the cameras again: File > Export > Export Cameras, Agisoft XML."
_MAX_BYTES = 128 << 20
_EARTH_M = (6.3e6, 6.45e6)  # distances of places near the ground from the Earth's centre
_WGS84 = ("WGS 84", "WGS_1984", "World Geodetic System 1984")
_COEFFICIENTS = ("k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4", "b1", "b2")
_EXACT_PX = 0.3
_LARGEST = 1e12
_GRID = 25


def read_metashape_xml(path: Path, frame: str = "") -> ProgramPoses:
    """The aligned cameras of a chunk.

    Args:
        path: the file.
        frame: what a person says the coordinates are in, where the file has no transform into a known system.

    Raises:
        MetadataError: it is unreadable, malformed, or has no aligned camera.
    """
    try:
        root = parse_local(file_bytes(path, _REMEDY, _MAX_BYTES, noun="export of Metashape"))
        chunks = [root] if root.tag == "chunk" else root.findall("chunk")
        if not chunks:
            raise MetadataError("holds no chunk of Metashape", path=path, remedy=_REMEDY)
        chunk = max(chunks, key=lambda each: len(each.findall(".//camera/transform")))
        return _chunk(chunk, len(chunks), path, frame)
    except (XmlError, ValueError) as error:
        raise MetadataError(f"is no export of Metashape's cameras: {error}", path=path, remedy=_REMEDY) from error


def _chunk(chunk: Element, chunks: int, path: Path, frame: str) -> ProgramPoses:
    components = {each.get("id"): _motion(each.find("transform")) for each in chunk.findall("components/component")}
    whole = _motion(chunk.find("transform"))
    aligned: dict[str, tuple[str | None, str | None, Pose]] = {}
    missing = 0
    for camera in chunk.iter("camera"):
        label, matrix = camera.get("label", ""), camera.find("transform")
        if matrix is None:
            missing += camera.find("reference") is not None or camera.get("sensor_id") is not None
            continue
        values = _numbers(matrix.text, 16, f"the transform of {label}").reshape(4, 4)
        turn = values[:3, :3]
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4) or np.linalg.det(turn) < 0:
            raise ValueError(f"the transform of {label} is no rotation")
        key = camera.get("component_id")
        aligned.setdefault(label, (camera.get("sensor_id"), key, Pose(turn.T, values[:3, 3])))
    findings = []
    if not aligned:
        raise MetadataError("has no camera that is aligned", path=path, remedy="Align the photographs first.")
    if missing:
        findings.append(Finding(path.name, "poses-apart", f"Metashape has not aligned {missing} of its photographs"))
    if chunks > 1:
        findings.append(Finding(path.name, "poses-apart", f"of {chunks} chunks the one with most cameras is used"))
    keys = [key for _, key, _ in aligned.values()]
    main = max(sorted(set(keys), key=str), key=keys.count)
    if others := len(keys) - keys.count(main):
        findings.append(
            Finding(
                path.name,
                "poses-apart",
                f"{count(others, 'photograph is', 'photographs are')} in other components; not used",
            )
        )
    poses = {label: pose for label, (_, key, pose) in aligned.items() if key == main}
    motion = components.get(main) or whole
    placed = _placed(poses, motion, chunk.findtext("reference") or "", path, frame)
    cameras, odd = _cameras(chunk, {label: sensor for label, (sensor, _, _) in aligned.items() if label in poses})
    return ProgramPoses(
        "Metashape", path, placed.poses, metric=placed.metric, origin=placed.origin, cameras=cameras,
        frame_said=placed.said, findings=(*findings, *odd),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Motion:
    """A transform out of the chunk's coordinates, and whether Metashape took it from references."""

    similarity: Similarity
    referenced: bool


@dataclass(frozen=True, eq=False)
class _Placed:
    poses: dict[str, Pose]
    metric: bool
    origin: LocalFrame | None
    said: str


def _motion(element: Element | None) -> _Motion | None:
    if element is None:
        return None
    if element.text and not len(element):  # of older versions: a matrix
        return _Motion(Similarity.from_matrix(_numbers(element.text, 16, "the chunk's transform").reshape(4, 4)), True)
    rotation, translation, scale = (element.find(name) for name in ("rotation", "translation", "scale"))
    if rotation is None and translation is None and scale is None:
        return None
    turn = np.eye(3) if rotation is None else _numbers(rotation.text, 9, "rotation").reshape(3, 3)
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4) or np.linalg.det(turn) < 0:
        raise ValueError("the chunk's rotation is none")
    shift = np.zeros(3) if translation is None else _numbers(translation.text, 3, "translation")
    size = 1.0 if scale is None else float(_numbers(scale.text, 1, "scale")[0])
    if size <= 0:
        raise ValueError("the chunk's scale is not positive")
    return _Motion(Similarity(size, turn, shift), scale is not None and scale.get("locked") != "false")


def _placed(poses: dict[str, Pose], motion: _Motion | None, reference: str, path: Path, frame: str) -> _Placed:
    """Poses of a chunk in a local frame: georeferenced, metric or neither."""
    if motion is not None:
        poses = {name: motion.similarity.apply_pose(pose) for name, pose in poses.items()}
        distance = float(np.median([np.linalg.norm(pose.center) for pose in poses.values()]))
        if _EARTH_M[0] < distance < _EARTH_M[1] and "LOCAL_CS" not in reference:
            check_open(frame, path)
            origin, local = _from_geocentric(poses, reference, path)
            return _Placed(local, True, origin, "in metres about the place it gives")
    if frame and frame != METRES:
        crs = parse_crs(frame, path)
        origin, local = local_from_crs(poses, crs, path)
        return _Placed(local, True, origin, f"in {crs.name}, as was said")
    if frame == METRES:
        return _Placed(poses, True, None, "in metres, as was said")
    if motion is not None and motion.referenced and "LOCAL_CS" in reference:
        return _Placed(poses, True, None, "in metres of its local coordinates")
    return _Placed(poses, False, None, "without metric scale, since the chunk has no reference")


def _from_geocentric(poses: dict[str, Pose], reference: str, path: Path) -> tuple[LocalFrame, dict[str, Pose]]:
    """Of geocentric poses, on the reference's ellipsoid, else on WGS 84's. Heights stay what they are."""
    centers = np.array([pose.center for pose in poses.values()])
    if not reference or any(name in reference for name in _WGS84):
        own = geodetic = np.stack(ecef_to_geodetic(centers), axis=1)
    else:
        datum = parse_crs(reference, path).geodetic_crs
        if datum is None:
            raise MetadataError("has a reference without datum", path=path, remedy="Export the cameras in WGS 84.")
        own = _geodetic_on(datum.ellipsoid, centers)
        geodetic = to_geodetic(own[:, [1, 0, 2]], datum.to_2d(), path)
    level = {
        name: Pose(pose.rotation @ LocalFrame(latitude, longitude).rotation().T, np.zeros(3))
        for (name, pose), (latitude, longitude, _) in zip(poses.items(), own.tolist(), strict=True)
    }
    return local_from_geodetic(level, geodetic, np.zeros(len(poses)), "unknown")


def _geodetic_on(ellipsoid: Any, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Latitude, longitude and height on an ellipsoid of geocentric points, (n, 3) each."""
    from pyproj import Transformer

    axes = f"+a={ellipsoid.semi_major_metre} +b={ellipsoid.semi_minor_metre}"
    steps = f"+step +inv +proj=cart {axes} +step +proj=unitconvert +xy_in=rad +xy_out=deg"
    found = np.stack(Transformer.from_pipeline(f"+proj=pipeline {steps}").transform(*points.T), axis=1)
    return found[:, [1, 0, 2]]


def _cameras(chunk: Element, sensor_of: dict[str, str | None]) -> tuple[list[ProgramCamera], list[Finding]]:
    cameras, findings = [], []
    for sensor in chunk.findall("sensors/sensor"):
        names = tuple(label for label, key in sensor_of.items() if key == sensor.get("id"))
        if not names:
            continue
        given = {each.get("class"): each for each in sensor.findall("calibration")}
        calibration = given.get("adjusted", given.get("initial"))
        if calibration is None or calibration.get("type", "frame") != "frame" or calibration.find("f") is None:
            message = "Metashape's calibration is not used: it is none of a frame camera"
            findings.append(Finding(names[0], "camera-unused", message))
            continue
        camera, error_px = _intrinsics(calibration)
        exact = error_px <= _EXACT_PX and calibration.get("class") == "adjusted"
        if error_px > _EXACT_PX:
            message = f"Metashape's calibration is a start only: without k4 and b2 it fits to {error_px:.1f} px"
            findings.append(Finding(names[0], "camera-approximate", message))
        cameras.append(ProgramCamera(camera, names, exact))
    return cameras, findings


def _intrinsics(calibration: Element) -> tuple[Intrinsics, float]:
    """COLMAP's camera nearest to Metashape's, and the largest difference over the picture, pixels."""
    size = calibration.find("resolution")
    if size is None:
        raise ValueError("a calibration has no resolution")
    width, height = int(size.get("width", "0")), int(size.get("height", "0"))
    f, cx, cy, *rest = (
        float(_numbers(calibration.findtext(key) or "0", 1, key)[0]) for key in ("f", "cx", "cy", *_COEFFICIENTS)
    )
    k1, k2, k3, k4, p1, p2, p3, p4, b1, b2 = rest
    params = (f + b1, f, width / 2 + cx, height / 2 + cy, k1, k2, p2, p1, k3, 0.0, 0.0, 0.0)
    plain = Intrinsics("FULL_OPENCV", width, height, params)
    if not any((k4, p3, p4, b2)):
        return plain, 0.0
    half = np.array([width, height]) / (2.0 * f)
    grid = np.stack(np.meshgrid(*(np.linspace(-h, h, _GRID) for h in half)), axis=-1).reshape(-1, 2)
    x, y = grid.T
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))
    more = 1.0 + r2 * (p3 + r2 * p4)
    dx = x * radial + (p1 * (r2 + 2 * x * x) + 2 * p2 * x * y) * more
    dy = y * radial + (p2 * (r2 + 2 * y * y) + 2 * p1 * x * y) * more
    wanted = np.stack([width / 2 + cx + dx * (f + b1) + dy * b2, height / 2 + cy + dy * f], axis=1)
    return _fitted(plain, grid, wanted)


def _fitted(start: Intrinsics, rays: NDArray[np.float64], wanted: NDArray[np.float64]) -> tuple[Intrinsics, float]:
    """The camera of the start's model that sees rays (n, 2) at the wanted pixels (n, 2), and its largest error."""
    points = np.column_stack([rays, np.ones(len(rays))])
    unit = np.array([start.fx, start.fx, start.fx, start.fx, *np.ones(8)])

    def camera(values: NDArray[np.float64]) -> Intrinsics:
        return Intrinsics(start.model, start.width, start.height, tuple(float(v) for v in values * unit))

    def errors(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((camera(values).project(points) - wanted).ravel())

    found = camera(least_squares(errors, np.array(start.params) / unit, x_scale="jac").x)
    return found, float(np.abs(found.project(points) - wanted).max())


def _numbers(text: str | None, count: int, what: str) -> NDArray[np.float64]:
    words: Sequence[str] = (text or "").split()
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count or not (np.abs(values) < _LARGEST).all():
        raise ValueError(f"{what} is not {count} numbers")
    return values
