"""Thumbnails of a result's photographs, if their folder can be found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.decode import read_image
from fieldkit.errors import FieldkitError
from fieldkit.figures.content import Picture
from fieldkit.files import file_beside

SIDE = 160
"""Longer side of a thumbnail, pixels; shown at half the size."""

_QUALITY = 72
_LARGEST_BYTES = 64 << 20
_MOST_FOLDERS = 400


def find_photographs(source: str, names: Sequence[str], near: Path, root: Path) -> Path | None:
    """The folder of a result's photographs.

    Results know only its name. It is searched beside the result, in folders named captures there, and below the
    report's folder. It must hold all photographs.

    Args:
        source: name of the folder, or "FOLDER/PLOT".
        names: of the photographs.
        near: the result's folder.
        root: the report's.

    Returns:
        The folder; None if it is not found.
    """
    if not names or not source or Path(source).is_absolute() or ".." in Path(source).parts:
        return None
    for place in _places(near, root):
        folder = place / source
        try:
            if folder.is_dir() and all(_file(folder, name) is not None for name in names):
                return folder
        except OSError:
            continue
    return None


def thumbnails(folder: Path | None, names: Sequence[str], most: int) -> Mapping[str, Picture]:
    """Small JPEGs of the first ``most`` photographs, by name; unreadable ones are left out."""
    found: dict[str, Picture] = {}
    for name in names[:most] if folder is not None else ():
        file = None if folder is None else _file(folder, name)
        if file is not None and (picture := thumbnail(file, name)) is not None:
            found[name] = picture
    return found


def thumbnail(file: Path, name: str) -> Picture | None:
    """A small JPEG of a photograph, without metadata; None if it cannot be read."""
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            return None
        pixels = read_image(file, max_side=SIDE)
    except (FieldkitError, OSError, MemoryError):
        return None
    jpeg = as_jpeg(pixels, _QUALITY)
    if jpeg is None:
        return None
    height, width = pixels.shape[:2]
    return Picture(jpeg, max(1, width // 2), max(1, height // 2), f"photograph {name}")


def as_jpeg(pixels: NDArray[np.uint8], quality: int) -> bytes | None:
    """RGB pixels (h, w, 3) as a JPEG file; None where they cannot be written as one."""
    done, jpeg = cv2.imencode(".jpg", pixels[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return jpeg.tobytes() if done else None


def _places(near: Path, root: Path) -> Iterator[Path]:
    about = [near, near.parent, near.parent.parent]
    yield from about
    yield from (place / "captures" for place in about)
    folders = sorted(root.glob("*"))[:_MOST_FOLDERS] if root.is_dir() else []
    yield from (folder for folder in folders if folder.is_dir() and not folder.name.startswith("."))


def _file(folder: Path, name: str) -> Path | None:
    """The path of a photograph, never outside the folder."""
    if not name or Path(name).is_absolute():
        return None
    try:
        # Captures may keep their photographs in images/.
        for place in (folder, folder / "images"):
            found = file_beside(Path(name), place / "photographs")
            if found is not None and found.is_file():
                return found
    except (OSError, RuntimeError, ValueError):
        return None
    return None
