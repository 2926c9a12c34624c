"""Reading pixels, and checking files without decoding them."""

from __future__ import annotations

import io
import os
import re
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image, TiffImagePlugin

from fieldkit.arrays import ByteArray, Float32Array
from fieldkit.captures.model import Photo
from fieldkit.errors import CaptureError
from fieldkit.regular_files import open_regular

_SCAN_MARKER = re.compile(rb"\xff+[^\x00\xd0-\xd7\xff]")
_MAX_XMP_BYTES = 1 << 20
"""Most bytes that a packed XMP packet may come to."""
_LEAST_DEEP_VALUE = 1 << 12  # what uses fewer than 13 of 16 bits leaves less than 16 grey levels
_DETAIL_PX = 256
"""Side of the pictures in which two photographs' details are compared, pixels."""
_SAME_DETAIL = 0.9
"""Least correlation of the details of one photograph in two files."""
_COMPLAINT = re.compile(r"Corrupt JPEG data|Premature end of JPEG|Inconsistent progression|libpng error")
_STANDALONE = frozenset({0x01, *range(0xD0, 0xD9)})
_REDUCED = {
    2: (cv2.IMREAD_REDUCED_COLOR_2, cv2.IMREAD_REDUCED_GRAYSCALE_2),
    4: (cv2.IMREAD_REDUCED_COLOR_4, cv2.IMREAD_REDUCED_GRAYSCALE_4),
    8: (cv2.IMREAD_REDUCED_COLOR_8, cv2.IMREAD_REDUCED_GRAYSCALE_8),
}


def read_image(photo: Photo | Path, *, max_side: int | None = None, gray: bool = False) -> ByteArray:
    """The pixels of a photograph, (h, w, 3) RGB or (h, w) grey, 8 bits.

    The EXIF orientation tag is **not** applied: the pixel grid is the stored one, as COLMAP reads it, so that
    ``Photo.width`` × ``height`` and the intrinsics fit. 16-bit images are cut to their upper 8 bits, transparency is
    dropped, grey is the luma of BT.601.

    Args:
        max_side: shrink so that the longer side is at most this (pixels); never enlarged. JPEGs are first shrunk
            by 2, 4 or 8 while they are decoded, where that divides both sides exactly and leaves at least twice
            ``max_side``: deterministic, the pixel grid stays aligned and no sharpness is lost. The rest is area
            averaging.
        gray: one channel instead of three.
    """
    path = photo.path if isinstance(photo, Photo) else Path(photo)
    try:
        with open_regular(path) as file:
            data = np.fromfile(file, dtype=np.uint8)
    except OSError as error:
        raise CaptureError(
            f"cannot be read ({(error.strerror or str(error)).lower()})", path=path, remedy="Copy it again."
        ) from error
    is_jpeg = data[:2].tobytes() == b"\xff\xd8"
    size = (photo.width, photo.height) if isinstance(photo, Photo) else None
    factor = _reduction(size, max_side) if is_jpeg and size is not None and max_side is not None else 1
    flags = _REDUCED[factor][gray] if factor > 1 else (cv2.IMREAD_GRAYSCALE if gray else cv2.IMREAD_COLOR)
    try:
        image = cv2.imdecode(data, flags | cv2.IMREAD_IGNORE_ORIENTATION) if data.size else None
    except cv2.error:
        image = None
    if image is None:
        raise CaptureError("cannot be decoded as an image", path=path, remedy="Copy it again or remove it.")
    if max_side is not None and max(image.shape[:2]) > max_side:
        height, width = image.shape[:2]
        scale = max_side / max(height, width)
        target = (max(1, round(width * scale)), max(1, round(height * scale)))
        image = cv2.resize(image, target, interpolation=cv2.INTER_AREA)
    if not gray:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
    return np.ascontiguousarray(image, dtype=np.uint8)


@contextmanager
def decoders_complaints() -> Iterator[list[str]]:
    """What libjpeg and libpng say of damage meanwhile: they write it to the process's stderr and go on.

    What else is written there meanwhile is passed on. Not for two threads at once.
    """
    lines: list[str] = []
    try:
        usual = os.dup(2)
    except OSError:  # no stderr
        yield lines
        return
    with tempfile.TemporaryFile() as caught:
        os.dup2(caught.fileno(), 2)
        try:
            yield lines
        finally:
            os.dup2(usual, 2)
            os.close(usual)
            caught.seek(0)
            for line in caught.read().decode("utf-8", "replace").splitlines(keepends=True):
                if _COMPLAINT.search(line):
                    lines.append(line.strip())
                else:
                    os.write(2, line.encode())


def _reduction(size: tuple[int, int], max_side: int) -> int:
    for factor in (8, 4, 2):
        if max(size) // factor >= 2 * max_side and size[0] % factor == 0 and size[1] % factor == 0:
            return factor
    return 1


def jpeg_is_complete(data: bytes) -> bool:
    """Whether a JPEG's segments run through to its end marker (ITU-T T.81, annex B), without decoding it.

    A file cut short, or filled up with zeros by a broken copy, has no end marker. What follows the end marker
    (embedded previews, vendor data) does not matter.
    """
    position = 2
    while True:
        # Fill bytes: any number of 0xFF may precede a marker.
        start = position
        while position < len(data) and data[position] == 0xFF:
            position += 1
        if position == start or position >= len(data):
            return False
        marker = data[position]
        position += 1
        if marker == 0xD9:
            return True
        if marker in _STANDALONE:
            continue
        if marker == 0x00 or position + 2 > len(data):
            return False
        length = int.from_bytes(data[position : position + 2], "big")
        if length < 2:
            return False
        position += length
        if marker == 0xDA:
            following = _SCAN_MARKER.search(data, position)
            if following is None:
                return False
            position = following.start()


def tiff_refusal(data: bytes) -> str | None:
    """Why a TIFF is none that `read_image` gives the picture of, by its tags (TIFF 6.0); None where nothing speaks so.

    Numbers other than unsigned ones of 8 or 16 bits are measurements (temperatures, reflectances, heights) or need a
    stretch that is not ours to choose.
    """
    try:
        tags = TiffImagePlugin.ImageFileDirectory_v2(data[:8])
        stream = io.BytesIO(data)
        stream.seek(tags.next)
        tags.load(stream)
        bits, kinds = _values(tags.get(258)) or {1}, _values(tags.get(339)) or {1}
    # Pillow's parser raises whatever a damaged directory leads it into; reading the file says what is wrong with it.
    except Exception:
        return None
    if bits <= {8, 16} and kinds == {1}:
        return None
    kind = {1: "", 2: " signed", 3: " floating point", 5: " complex", 6: " complex"}.get(max(kinds), " unknown")
    return f"a TIFF with{kind} numbers of {max(bits)} bits; convert it to 8 bits"


def dark_refusal(image: Image.Image) -> str | None:
    """Why a decoded image of 16 bits is none to use: its upper 8 bits, which are all that is read, are nearly empty."""
    if not image.mode.startswith("I;16"):
        return None
    highest = image.getextrema()[1]
    if not isinstance(highest, int | float) or highest >= _LEAST_DEEP_VALUE:
        return None
    return f"16 bits of which only {int(highest).bit_length()} are used; convert it to 8 bits"


def _values(value: Any) -> set[int]:
    return set(value) if isinstance(value, tuple) else set() if value is None else {int(value)}


@dataclass(frozen=True)
class PngMetadata:
    """The metadata chunks of a complete PNG: an EXIF block (TIFF structure) and an XMP packet, where there are any."""

    exif: bytes | None = None
    xmp: bytes | None = None


def read_png_metadata(data: bytes) -> PngMetadata | None:
    """The metadata of a PNG whose chunks are all there with the right checksums (ISO/IEC 15948), else None.

    Read here, since metadata may stand behind the image data, where Pillow only sees it after decoding.
    """
    position, exif, xmp = 8, None, None
    while position + 12 <= len(data):
        length = int.from_bytes(data[position : position + 4], "big")
        kind, end = data[position + 4 : position + 8], position + 8 + length
        if end + 4 > len(data) or zlib.crc32(data[position + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            return None
        if kind == b"IEND":
            return PngMetadata(exif, xmp)
        if kind == b"eXIf":
            exif = data[position + 8 : end]
        elif kind == b"iTXt" and data.startswith(b"XML:com.adobe.xmp\0", position + 8):
            xmp = _itxt_text(data[position + 8 : end])
        position = end + 4
    return None


def _itxt_text(chunk: bytes) -> bytes | None:
    """The text of an iTXt chunk: keyword, 0, compressed?, method, language, 0, translated keyword, 0, text."""
    _, _, rest = chunk.partition(b"\0")
    parts = rest[2:].split(b"\0", 2)
    if len(rest) < 2 or len(parts) < 3:
        return None
    if not rest[0]:
        return parts[2]
    try:
        return zlib.decompressobj().decompress(parts[2], _MAX_XMP_BYTES)
    except zlib.error:
        return None


def saved_again(one: Path, other: Path, details: dict[Path, Float32Array]) -> bool:
    """Whether two files are one photograph that another program saved again, smaller or otherwise compressed.

    Fine detail is compared, and kept in ``details``: two exposures of a burst differ in it. Files that a camera has
    numbered on are never one.
    """
    (head, number), (other_head, other_number) = (_numbered(path.stem) for path in (one, other))
    if number and other_number and number != other_number and head == other_head:
        return False
    try:
        for path in (one, other):
            if path not in details:
                details[path] = _detail(path)
    except CaptureError:
        return False
    return bool((details[one] * details[other]).mean() > _SAME_DETAIL)


def _numbered(stem: str) -> tuple[str, str]:
    head = stem.rstrip("0123456789")
    return head, stem[len(head) :]


def _detail(path: Path) -> Float32Array:
    """(n, n) of a small grey copy, without what is coarse; mean 0, variance 1."""
    small = cv2.resize(
        read_image(path, max_side=2 * _DETAIL_PX, gray=True), (_DETAIL_PX, _DETAIL_PX), interpolation=cv2.INTER_AREA
    )
    grey = small.astype(np.float32)
    fine = grey - cv2.blur(grey, (5, 5))
    return np.asarray(fine / np.float32(max(float(fine.std()), 1e-9)))
