"""Zip archives: written the same byte for byte, read without ever unpacking one to disk."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from fieldkit.errors import MetadataError

_MAX_MEMBERS = 1024
"""Most members of an archive."""
_MAX_MEMBER_BYTES = 32 << 20
"""Most bytes of a member unpacked."""
_STAMP = (1980, 1, 1, 0, 0, 0)  # the earliest that zip can say: the same mission gives the same bytes at any time
_REMEDY = "Save it again with DJI Pilot 2, or export it with `fieldkit export-mission --format wpml`."


def zip_bytes(members: Sequence[tuple[str, bytes]]) -> bytes:
    """An archive of named members, in this order, deflated."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members:
            info = zipfile.ZipInfo(name, _STAMP)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.create_system = 3
            info.external_attr = 0o644 << 16
            archive.writestr(info, content, compresslevel=9)
    return buffer.getvalue()


def read_members(data: bytes, wanted: Sequence[str], path: Path) -> dict[str, bytes]:
    """The wanted members that an archive has, by name.

    Sizes are limited as they are declared and as they turn out; other members are never opened.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            infos = archive.infolist()
            if len(infos) > _MAX_MEMBERS:
                raise _error(path, f"holds {len(infos)} files: far too many for a mission")
            for info in infos:
                parts = PurePosixPath(info.filename.replace("\\", "/")).parts
                if ".." in parts or info.filename.startswith(("/", "\\")) or ":" in info.filename:
                    raise _error(path, f"holds a file whose name leads out of it: {info.filename[:60]!r}")
            found = {}
            for name in wanted:
                members = [info for info in infos if info.filename == name]
                if len(members) > 1:
                    raise _error(path, f"holds {name} more than once")
                if members:
                    found[name] = _member(archive, members[0], path)
            return found
    except MetadataError:
        raise
    except (
        zipfile.BadZipFile,
        zlib.error,
        struct.error,
        NotImplementedError,
        RuntimeError,
        EOFError,
        OSError,
        ValueError,
        KeyError,
        IndexError,
        OverflowError,
        MemoryError,
    ) as error:
        raise _error(path, "is not a zip archive that can be read") from error


def _member(archive: zipfile.ZipFile, info: zipfile.ZipInfo, path: Path) -> bytes:
    if info.flag_bits & 1:
        raise _error(path, f"{info.filename} in it is encrypted")
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise _error(path, f"{info.filename} in it is compressed in a way that missions are not")
    if info.file_size > _MAX_MEMBER_BYTES:
        raise _error(path, f"{info.filename} in it would unpack to {info.file_size} bytes")
    with archive.open(info) as member:
        content = member.read(_MAX_MEMBER_BYTES + 1)
    if len(content) > _MAX_MEMBER_BYTES:
        raise _error(path, f"{info.filename} in it unpacks to far more than a mission")
    return content


def _error(path: Path, message: str) -> MetadataError:
    return MetadataError(message, path=path, remedy=_REMEDY)
