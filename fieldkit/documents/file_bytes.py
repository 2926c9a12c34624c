"""Reading small files that may come from anywhere: a larger one is refused, and errors are for people."""

from __future__ import annotations

import os
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.regular_files import open_regular


def file_bytes(path: Path, max_bytes: int, *, noun: str, name: str = "file") -> bytes:
    """The content of a file; errors name no file (`fieldkit.errors.about`)."""
    try:
        with open_regular(path) as file:
            data = file.read(min(max_bytes, os.fstat(file.fileno()).st_size) + 1)
    except FileNotFoundError as caught:
        raise MetadataError(f"there is no such {name}") from caught
    except OSError as caught:
        denied = "Check its permissions." if isinstance(caught, PermissionError) else ""
        raise MetadataError(f"cannot be read: {caught.strerror}", remedy=denied) from caught
    except ValueError as caught:  # a NUL in the path
        raise MetadataError(f"cannot be read: it is no path of a {noun}") from caught
    if len(data) > max_bytes:
        raise MetadataError(f"is far too large for a {noun}")
    return data


def decoded(data: bytes) -> str:
    """The text of a file in UTF-8, with or without a byte order mark."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as caught:
        raise MetadataError("is not text in UTF-8", remedy="Save it as UTF-8.") from caught
