"""Metashape's cameras as text (Export Cameras, Omega Phi Kappa), whose header is a comment.

    # CoordinateSystem: PROJCS["WGS 84 / UTM zone 32N",…]        perhaps
    # Cameras (45)
    # PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12, r13, r21, r22, r23, r31, r32, r33

Fields are separated by tabs, commas or blanks. r is the world-to-camera rotation of photogrammetry, whose camera has y
up and z backward; omega, phi and kappa are its angles, r = (Rx(ω) Ry(φ) Rz(κ))ᵀ.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.programs.frames import local_from_crs, parse_crs
from fieldkit.captures.programs.model import (
    ANGLE_ACCURACY_DEG,
    GRID_ANGLE_ACCURACY_DEG,
    METRES,
    ProgramPoses,
    check_open,
)
from fieldkit.captures.tables import parse_number, read_text
from fieldkit.errors import MetadataError
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import on_earth
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.results.finding import Finding

_HEADER = re.compile(r"#\s*PhotoID\b.*\bOmega\b", re.IGNORECASE)
_SYSTEM = re.compile(r"#\s*CoordinateSystem:\s*(\S.*)", re.IGNORECASE)
_REMEDY = "Export the cameras again: File > Export > Export Cameras, Omega Phi Kappa."
_DECIMALS, _EXTENT_DEG, _LEAST_DEG, _AGREE_DEG = 6, 0.1, 1.0, 0.1
_FLIP = np.diag([1.0, -1.0, -1.0])
"""From photogrammetry's camera axes to x right, y down, z forward, and back."""


def looks_like_opk(head: str) -> bool:
    """Whether a text starts as such an export does."""
    return any(_HEADER.match(line) for line in head.splitlines()[:5])


def read_metashape_text(path: Path, frame: str = "") -> ProgramPoses:
    """The cameras of an export.

    Args:
        path: the file.
        frame: what a person says the coordinates are in, where the file does not say it.

    Raises:
        MetadataError: it is unreadable or malformed, or angles contradict the matrix.
    """
    poses: dict[str, Pose] = {}
    system, decimals = "", 0
    for number, line in enumerate(read_text(path).split("\n"), 1):
        if line.lstrip().startswith("#"):
            found = _SYSTEM.match(line.lstrip())
            system = found[1].strip() if found else system
            continue
        if not line.strip():
            continue
        name, values, written = _row(line, number, path)
        if name in poses:
            raise MetadataError(f"line {number}: {name} is listed again", path=path, remedy=_REMEDY)
        poses[name] = Pose(_rotation(values, name, number, path), values[:3])
        decimals = max(decimals, written)
    if not poses:
        raise MetadataError("no camera is listed", path=path, remedy=_REMEDY)
    if system and not system.startswith("LOCAL_CS"):
        check_open(frame, path)
    return _placed(poses, frame or system, decimals, path)


def _row(line: str, number: int, path: Path) -> tuple[str, NDArray[np.float64], int]:
    """Name, numbers, and decimals of x and y."""
    fields = [field.strip().strip('"') for field in re.split(r"[\t,]", line)]
    if len(fields) < 7:
        words = line.split()
        count = 15 if len(words) > 15 else 6
        fields = [" ".join(words[:-count]), *words[-count:]]
    numbers = [parse_number(field) for field in fields[1:16]]
    numbers = numbers if len(numbers) == 15 and None not in numbers else numbers[:6]
    if len(numbers) < 6 or None in numbers or not fields[0]:
        raise MetadataError(
            f"line {number}: expected a name, X, Y, Z, Omega, Phi, Kappa and nine numbers", path=path, remedy=_REMEDY
        )
    decimals = min(len(field.partition(".")[2]) for field in fields[1:3])
    return fields[0], np.array(numbers, dtype=np.float64), decimals


def _rotation(values: NDArray[np.float64], name: str, number: int, path: Path) -> NDArray[np.float64]:
    """World-to-camera, x right, y down, z forward."""
    by_angles: NDArray[np.float64] = _FLIP @ opk_rotation(*values[3:6]).T
    if len(values) == 6:
        return by_angles
    u, _, vt = np.linalg.svd(values[6:].reshape(3, 3))
    by_matrix: NDArray[np.float64] = _FLIP @ u @ vt
    if np.linalg.det(by_matrix) < 0 or rotation_angle_deg(by_matrix, by_angles) > _AGREE_DEG:
        raise MetadataError(
            f"line {number}: the matrix of {name} contradicts its angles", path=path,
            remedy="Give the file as Metashape wrote it.",
        )  # fmt: skip
    return by_matrix


def opk_rotation(omega_deg: float, phi_deg: float, kappa_deg: float) -> NDArray[np.float64]:
    """(3, 3) camera-to-world of omega, phi and kappa: Rx(ω) Ry(φ) Rz(κ), the camera's y up and z backward."""
    (so, sp, sk), (co, cp, ck) = (f(np.radians([omega_deg, phi_deg, kappa_deg])) for f in (np.sin, np.cos))
    x = np.array([[1.0, 0.0, 0.0], [0.0, co, -so], [0.0, so, co]])
    y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    z = np.array([[ck, -sk, 0.0], [sk, ck, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(x @ y @ z)


def _placed(poses: dict[str, Pose], system: str, decimals: int, path: Path) -> ProgramPoses:
    centers = np.array([pose.center for pose in poses.values()])
    if not system and _look_like_degrees(centers, decimals):
        system = "EPSG:4326"
    if not system or system == METRES or system.startswith("LOCAL_CS"):
        said = "in metres of an unknown place" if not system else "in metres of its local coordinates"
        return ProgramPoses("Metashape", path, poses, metric=True, origin=None, frame_said=said)
    crs = parse_crs(system, path)
    origin, local = local_from_crs(poses, crs, path)
    findings = []
    accuracy_deg = ANGLE_ACCURACY_DEG
    if crs.is_projected:
        accuracy_deg = GRID_ANGLE_ACCURACY_DEG
        message = "omega, phi and kappa are taken to count from the grid's axes, which the file does not say"
        findings.append(Finding(path.name, "heading-open", message))
    return ProgramPoses(
        "Metashape", path, local, metric=True, origin=origin, angle_accuracy_deg=accuracy_deg,
        frame_said=f"in {crs.name}", findings=tuple(findings),
    )  # fmt: skip


def _look_like_degrees(centers: NDArray[np.float64], decimals: int) -> bool:
    """Whether x and y are longitude and latitude: near one another, and with decimals enough to tell cameras apart."""
    if decimals < _DECIMALS or not all(on_earth(y, x) for x, y, _ in centers):
        return False
    far_from_origin = float(np.abs(centers[:, :2]).max()) > _LEAST_DEG  # a rig's coordinates count from its middle
    return bool(far_from_origin and (np.ptp(centers[:, :2], axis=0) < _EXTENT_DEG).all())
