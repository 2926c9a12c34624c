"""Reading pixels, and checking files without decoding them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import TiffImagePlugin

from fieldkit.arrays import ByteArray, Float32Array
from fieldkit.captures.model import Photo
from fieldkit.errors import CaptureError
from fieldkit.regular_files import open_regular

_SCAN_MARKER = re.compile(rb"\xff+[^\x00\xd0-\xd7\xff]")
_LEAST_DEEP_VALUE = 1 << 12  # what uses fewer than 13 of 16 bits leaves less than 16 grey levels
_DETAIL_PX = 256
"""Side of the pictures in which two photographs' details are compared, pixels."""
_SAME_DETAIL = 0.9
"""Least correlation of the details of one photograph in two files."""
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


def tiff_refusal(image: TiffImagePlugin.TiffImageFile) -> str | None:
    """Why a TIFF is none that `read_image` gives the picture of, by its tags (TIFF 6.0) and values; decodes it.

    Numbers other than unsigned ones of 8 or 16 bits are measurements (temperatures, reflectances, heights) or need a
    stretch that is not ours to choose. Of 16 bits only the upper 8 are read, which must not be nearly empty.
    """
    bits, kinds = (_values(image.tag_v2.get(tag, 1)) for tag in (258, 339))
    if not bits <= {8, 16} or kinds != {1}:
        kind = {1: "", 2: " signed", 3: " floating point", 5: " complex", 6: " complex"}.get(max(kinds), " unknown")
        return f"a TIFF with{kind} numbers of {max(bits)} bits; convert it to 8 bits"
    image.load()
    highest = image.getextrema()[1] if image.mode.startswith("I;16") else None
    if not isinstance(highest, int | float) or highest >= _LEAST_DEEP_VALUE:
        return None
    return f"16 bits of which only {int(highest).bit_length()} are used; convert it to 8 bits"


def _values(value: Any) -> set[int]:
    return set(value) if isinstance(value, tuple) else {int(value)}


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
