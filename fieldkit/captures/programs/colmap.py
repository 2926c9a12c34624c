"""A COLMAP model: a folder with cameras, images and points3D as .bin or .txt, since COLMAP 3.12 also rigs and frames.

Poses are world-to-camera (colmap.github.io/format.html). The model's frame and its unit are arbitrary, unless it was
aligned (`colmap model_aligner`), which its files do not say.
"""

from __future__ import annotations

import math
import mmap
import os
import struct
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fieldkit.captures.camera_file import CameraEntry
from fieldkit.captures.crs import local_from_crs, parse_crs
from fieldkit.captures.programs.model import METRES, PosesFile, ProgramPoses
from fieldkit.errors import MetadataError, about
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.regular_files import check_regular, open_regular
from fieldkit.results.finding import Finding

if TYPE_CHECKING:
    import pycolmap

_NEEDED, _SINCE_3_12 = ("cameras", "images"), ("rigs", "frames")
_LARGEST = 1e12
"""Largest coordinate that is believed."""
_MAX_BYTES = 4 << 30
"""Largest file that is read, bytes."""
_REMEDY = "Give the folder that COLMAP wrote, with cameras and images as .bin or .txt."


def colmap_suffix(folder: Path) -> str | None:
    """``".bin"`` or ``".txt"`` where a folder holds a COLMAP model in that form, else None."""
    for suffix in (".bin", ".txt"):
        if all((folder / f"{name}{suffix}").is_file() for name in _NEEDED):
            return suffix
    return None


def read_colmap(given: PosesFile) -> ProgramPoses:
    """The registered images of the model in a folder."""
    with about(given.path, _REMEDY):
        return _read(given.path, given.frame)


def _read(folder: Path, frame: str) -> ProgramPoses:
    try:
        model, lacking = _load(folder)
        poses, cameras, findings = _contents(model)
    except MetadataError:
        raise
    except Exception as error:  # pycolmap raises ValueError, IndexError, RuntimeError or MemoryError
        detail = str(error).rpartition("] ")[2] or type(error).__name__
        raise MetadataError(f"COLMAP cannot read this model: {detail}") from error
    if not poses:
        raise MetadataError("no image of this model is registered")
    if lacking:
        message = (
            f"has no line of points behind {lacking} or more of {len(poses)} images, as COLMAP has it; all are read"
        )
        findings.append(Finding("images.txt", "poses-odd", message))
    origin = None
    said = "in metres, as was said" if frame else "without metric scale, since COLMAP's files have none"
    if frame and frame != METRES:
        crs = parse_crs(frame)
        origin, poses, odd = local_from_crs(poses, crs, folder.name)
        findings += odd
        said = f"in {crs.name}, as was said"
    return ProgramPoses(
        "COLMAP",
        folder,
        poses,
        metric=bool(frame),
        origin=origin,
        cameras=tuple(cameras),
        frame_said=said,
        findings=tuple(findings),
    )


def _contents(model: pycolmap.Reconstruction) -> tuple[dict[str, Pose], list[CameraEntry], list[Finding]]:
    """Poses of the registered images, their cameras, and what is odd about these."""
    images = sorted((model.image(k) for k in model.reg_image_ids()), key=lambda image: str(image.name))
    poses = {
        str(image.name): Pose(image.cam_from_world().rotation.matrix(), image.projection_center()) for image in images
    }
    for name, pose in poses.items():
        turns = np.allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-6)
        if not turns or not (np.abs(pose.center) < _LARGEST).all():
            raise ValueError(f"the pose of {name} is none")
    cameras, findings = [], []
    for key in sorted({image.camera_id for image in images}):
        names = tuple(str(image.name) for image in images if image.camera_id == key)
        camera = model.camera(key)
        try:
            own = Intrinsics(camera.model.name, camera.width, camera.height, tuple(float(p) for p in camera.params))
        except ValueError as error:
            message = f"COLMAP's camera {key} is not used ({error}); its poses are"
            findings.append(Finding(names[0], "camera-unused", message))
        else:
            cameras.append(CameraEntry(own, names))
    return poses, cameras, findings


def _load(folder: Path) -> tuple[pycolmap.Reconstruction, int]:
    """The model without its points, which may be many and are not needed; how many images lack their line of points."""
    suffix = colmap_suffix(folder)
    if suffix is None:
        raise MetadataError("this folder holds no COLMAP model")
    from fieldkit.runtime.colmap import pycolmap

    binary = suffix == ".bin"
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as place:
        bare = Path(place)
        for name in (*_NEEDED, *_SINCE_3_12):
            file = (folder / f"{name}{suffix}").resolve()
            if file.exists():
                _check(file, name if binary else "")
                (bare / file.name).symlink_to(file)
        (bare / f"points3D{suffix}").write_bytes(bytes(8) if binary else b"")
        lacking = 0 if binary else _with_lines_of_points(bare / "images.txt")
        model = pycolmap.Reconstruction(os.fspath(bare))
    cameras = folder / f"cameras{suffix}"
    if binary and cameras.stat().st_size != 8 + sum(24 + 8 * len(own.params) for own in model.cameras.values()):
        raise _damaged(cameras)
    return model, lacking


def _with_lines_of_points(link: Path) -> int:
    """How many images of an images.txt lack the line of points behind them: COLMAP skips every second of these.

    Where some do, the link is replaced by a copy in which all have one.
    """
    lines, lacking, waits = list[str](), 0, False
    with open_regular(link.resolve()) as file:
        for line in (raw.decode("utf-8", "surrogateescape").strip() for raw in file):
            if not line.startswith("#"):
                image = not _is_points(line)
                lacking += image and waits
                lines += [line, ""] if image else []
                waits = image
    if lacking:
        link.unlink()
        link.write_bytes("\n".join([*lines, ""]).encode("utf-8", "surrogateescape"))
    return lacking


def _is_points(line: str) -> bool:
    """Whether a line is x, y and a point's number for each keypoint, or blank: one of an image ends in its name."""
    words = line.split()
    try:
        return len(words) % 3 == 0 and all(math.isfinite(float(word)) for word in words)
    except ValueError:
        return False


def _check(file: Path, kind: str) -> None:
    """Refuse a file that is too large, or that does not end where its numbers of entries say: COLMAP would go on."""
    try:
        size = check_regular(file).st_size
    except OSError as error:
        reason = error.strerror or str(error)
        raise MetadataError(f"cannot be read: {reason}", path=file, remedy=_REMEDY) from error
    if size > _MAX_BYTES:
        raise MetadataError("is larger than 4 GiB", path=file, remedy="Use a model of one plot's photographs.")
    if kind in ("images", *_SINCE_3_12):
        try:
            with open_regular(file) as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
                if _end(data, kind) == size:
                    return
        except (struct.error, ValueError, IndexError, OSError):
            pass  # beyond the end
        raise _damaged(file)


def _end(data: mmap.mmap, kind: str) -> int:
    """Where the entries end that a file's number of entries promises."""
    (count,) = struct.unpack_from("<Q", data)
    at = 8
    for _ in range(count):
        if kind == "images":  # id, pose, camera, name, points
            end = data.find(b"\0", at + 64)
            if end < 0:
                raise ValueError
            at = end + 9 + 24 * struct.unpack_from("<Q", data, end + 1)[0]
        elif kind == "rigs":  # id, sensors: the first without a pose
            (sensors,) = struct.unpack_from("<I", data, at + 4)
            at += 16 if sensors else 8
            for _ in range(1, sensors):
                at += 9 + (56 if data[at + 8] else 0)
        else:  # id, rig, pose, data
            at += 68 + 16 * struct.unpack_from("<I", data, at + 64)[0]
        if at > len(data):
            raise ValueError
    return at


def _damaged(file: Path) -> MetadataError:
    return MetadataError("is damaged or was cut short", path=file, remedy="Copy the model again.")
