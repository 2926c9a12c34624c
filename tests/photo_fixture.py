"""A fixture that makes photographs for a test."""

import zlib
from pathlib import Path
from typing import Any

import pytest

from tests.captures.photographs import MakePhoto, texture


@pytest.fixture
def photo_file(tmp_path: Path) -> MakePhoto:
    """Write a photograph into tmp_path/capture: photo_file("a.jpg", seed=1, exif=…, xmp=…, size=(120, 90))."""
    folder = tmp_path / "capture"
    folder.mkdir()

    def make(name: str, *, seed: int | None = None, size: tuple[int, int] = (120, 90), **options: Any) -> Path:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if "format" not in options and path.suffix.lower() not in (".png", ".tif", ".tiff"):
            options["format"] = "JPEG"
        texture(zlib.crc32(name.encode()) if seed is None else seed, *size).save(path, **options)
        return path

    return make
