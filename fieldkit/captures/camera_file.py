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
from typing import Any

from fieldkit.captures.tables import read_text
from fieldkit.documents.toml_file import toml_document
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics

_KEYS = {"model", "width", "height", "params", "images", "fixed"}
_REMEDY = "Expected model, width, height and params (COLMAP's order), once or in a list 'cameras'."


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

    def at_size(self, width: int, height: int) -> Intrinsics | None:
        """The calibration at another size of the same aspect ratio (to a pixel), or None for another ratio."""
        own = self.intrinsics
        if abs(own.width * height - own.height * width) > max(own.width, own.height, width, height):
            return None
        return own if (own.width, own.height) == (width, height) else own.scaled(width, height)


def read_camera_file(path: Path) -> list[CameraEntry]:
    """The cameras of a camera.toml or camera.json."""
    return parse_camera_file(read_text(path), path)


def parse_camera_file(text: str, path: Path) -> list[CameraEntry]:
    """As `read_camera_file`, from text; the path's suffix says which format."""
    if path.suffix.lower() == ".toml":
        data: Any = toml_document(text, path, _REMEDY)
    else:
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise MetadataError(f"cannot be parsed ({error})", path=path, remedy=_REMEDY) from error
    several = True
    if isinstance(data, dict) and "cameras" in data:
        unknown = set(data) - {"cameras"}
        if unknown:
            raise MetadataError(f"unknown key {min(unknown)!r} beside 'cameras'", path=path, remedy=_REMEDY)
        data = data["cameras"]
    elif isinstance(data, dict):
        data, several = [data], False
    if not isinstance(data, list) or not data:
        raise MetadataError("no camera is given", path=path, remedy=_REMEDY)
    return [_entry(item, f"camera {i}: " if several else "", path) for i, item in enumerate(data, 1)]


def _entry(item: Any, where: str, path: Path) -> CameraEntry:
    def fail(message: str) -> MetadataError:
        return MetadataError(where + message, path=path, remedy=_REMEDY)

    if not isinstance(item, dict):
        raise fail("not a table of values")
    for key in sorted(map(str, item)):
        if key not in _KEYS:
            raise fail(f"unknown key {key!r}")
    for key in ("model", "width", "height", "params"):
        if key not in item:
            raise fail(f"{key!r} is missing")
    for key in ("width", "height"):
        if not isinstance(item[key], int) or isinstance(item[key], bool) or not 0 < item[key] < 1_000_000:
            raise fail(f"{key} must be a whole number of pixels")
    params = item["params"]
    if not isinstance(params, list) or any(isinstance(p, bool) or not isinstance(p, int | float) for p in params):
        raise fail("params must be a list of numbers")
    images = item.get("images", [])
    images = [images] if isinstance(images, str) else images
    if not isinstance(images, list) or not all(isinstance(glob, str) and glob for glob in images):
        raise fail("images must be a list of names or globs")
    fixed = item.get("fixed", True)
    if not isinstance(fixed, bool):
        raise fail("fixed must be true or false")
    try:
        intrinsics = Intrinsics(str(item["model"]), item["width"], item["height"], tuple(float(p) for p in params))
    except (ValueError, OverflowError) as error:
        raise fail(str(error)) from error
    return CameraEntry(intrinsics, tuple(images), fixed)
