"""Small helpers that every text sidecar shares: decoding, numbers, names."""

from __future__ import annotations

import codecs
import math
import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import TypeVar

from fieldkit.errors import MetadataError
from fieldkit.regular_files import read_regular

_MAX_BYTES = 64 << 20
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")


def read_text(path: Path) -> str:
    """A sidecar's text: UTF-8 with or without a byte order mark, or UTF-16 with one; line ends become newlines.

    Raises:
        MetadataError: unreadable, no regular file, larger than 64 MiB, or in another encoding.
    """
    try:
        data = read_regular(path, _MAX_BYTES)
    except OSError as error:
        reason = (error.strerror or str(error)).replace("No", "no")
        remedy = "Check its permissions." if isinstance(error, PermissionError) else "Check that it is the right file."
        raise MetadataError(f"cannot be read ({reason})", path=path, remedy=remedy) from error
    return decode_text(data, path)


def decode_text(data: bytes, path: Path | None = None) -> str:
    """As `read_text`, from bytes."""
    utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = data.decode("utf-16" if utf16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise MetadataError(
            f"line {line} is not UTF-8 text", path=path, remedy="Save the file as UTF-8 (in Excel: CSV UTF-8)."
        ) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_number(text: str, *, decimal_comma: bool = False) -> float | None:
    """A plain finite decimal number, or None (also for nan, inf, 1_000 and digits of other scripts)."""
    cleaned = text.strip()
    if decimal_comma and "." not in cleaned:
        cleaned = cleaned.replace(",", ".", 1)
    if _NUMBER.fullmatch(cleaned) is None:
        return None
    value = float(cleaned)
    return value if math.isfinite(value) else None


Row = TypeVar("Row")


def keep_row(kept: dict[str, tuple[int, Row]], name: str, row: Row, line: int, what: str, path: Path | None) -> str:
    """Keep what a line says of a photograph, with the line's number; returns what is odd about it, "" for nothing.

    Raises:
        MetadataError: an earlier line says something else; ``what`` names it.
    """
    first, earlier = kept.setdefault(name, (line, row))
    if earlier != row:
        raise MetadataError(
            f"line {line}: {name} is listed again with another {what} (first on line {first})",
            path=path,
            remedy="Keep one line per photograph.",
        )
    return "" if first == line else f"listed twice (lines {first} and {line})"


def match_names(listed: Iterable[str], names: Iterable[str]) -> dict[str, str]:
    """Which photograph each listed name means: exact, else without folders, else without regard to case.

    Unicode is compared in its composed form (NFC), since file systems differ in it. Ambiguous names stay unmatched.

    Returns:
        listed name → photograph name, for those found.
    """
    names = list(names)
    exact = {_nfc(name): name for name in names}
    folded: dict[str, list[str]] = {}
    for name in names:
        folded.setdefault(_base(name).casefold(), []).append(name)
    matched: dict[str, str] = {}
    for entry in listed:
        candidate = exact.get(_nfc(entry)) or exact.get(_base(entry))
        loose = folded.get(_base(entry).casefold(), [])
        if candidate is not None:
            matched[entry] = candidate
        elif len(loose) == 1:
            matched[entry] = loose[0]
    return matched


def _nfc(name: str) -> str:
    return unicodedata.normalize("NFC", name)


def _base(name: str) -> str:
    return _nfc(PurePosixPath(name.replace("\\", "/")).name)
