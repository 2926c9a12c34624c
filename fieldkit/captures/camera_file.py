"""``camera.toml`` and ``camera.json``: a calibration beside the photographs.

One camera, or a list of them under ``cameras`` (JSON: also a bare list):

    model = "OPENCV"
    width = 4000
    height = 3000
    params = [fx, fy, cx, cy, k1, k2, p1, p2]     # COLMAP's order; (0, 0) is the corner of the first pixel
    images = ["left_*.jpg"]                       # only in lists: which photographs
    fixed = true                                  # false: a start value that bundle adjustment may refine
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from fieldkit.captures.tables import read_text
from fieldkit.documents.toml_file import toml_document, validated
from fieldkit.errors import MetadataError, about
from fieldkit.geometry import Intrinsics
from fieldkit.results.fields import Strict

_REMEDY = "Expected model, width, height and params (COLMAP's order), once or in a list 'cameras'."
_Pixels = Annotated[int, Field(gt=0, lt=1_000_000)]
_Glob = Annotated[str, Field(min_length=1)]


@dataclass(frozen=True)
class CameraEntry:
    """One calibrated camera."""

    intrinsics: Intrinsics
    """At the size the file gives."""
    images: tuple[str, ...] = ()
    """Globs of photograph names; empty means all."""
    fixed: bool = True
    """Whether the calibration is to be held fixed."""

    def covers(self, name: str) -> bool:
        """Whether a photograph of that name is this camera's."""
        return not self.images or any(fnmatchcase(name, glob) for glob in self.images)


class _Camera(Strict):
    """One camera as a file has it."""

    model: str
    width: _Pixels
    height: _Pixels
    params: tuple[float, ...]
    images: _Glob | tuple[_Glob, ...] = ()
    fixed: bool = True


class _Cameras(Strict):
    cameras: Annotated[tuple[_Camera, ...], Field(min_length=1)]


def read_camera_file(path: Path) -> list[CameraEntry]:
    """The cameras of a camera.toml or camera.json."""
    return parse_camera_file(read_text(path), path)


def parse_camera_file(text: str, path: Path) -> list[CameraEntry]:
    """As `read_camera_file`, from text; the path's suffix says which format."""
    with about(path, _REMEDY):
        return _parsed(text, path.suffix.lower() == ".toml")


def _parsed(text: str, is_toml: bool) -> list[CameraEntry]:
    if is_toml:
        data: Any = toml_document(text)
    else:
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise MetadataError(f"cannot be parsed ({error})") from error
    if isinstance(data, list):
        data = {"cameras": data}
    if isinstance(data, dict) and "cameras" in data:
        cameras = validated(TypeAdapter(_Cameras), data).cameras
    else:
        cameras = (validated(TypeAdapter(_Camera), data),)
    return [_entry(camera, f"cameras {k}: " if len(cameras) > 1 else "") for k, camera in enumerate(cameras, 1)]


def _entry(camera: _Camera, where: str) -> CameraEntry:
    try:
        intrinsics = Intrinsics(camera.model, camera.width, camera.height, camera.params)
    except ValueError as error:
        raise MetadataError(f"{where}{error}") from error
    images = (camera.images,) if isinstance(camera.images, str) else camera.images
    return CameraEntry(intrinsics, images, camera.fixed)
