"""Small helpers that every text sidecar shares: decoding, numbers, rows."""

from __future__ import annotations

import codecs
import math
import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import TypeVar

from fieldkit.captures.folder import PHOTO_SUFFIXES
from fieldkit.documents.file_bytes import file_bytes
from fieldkit.errors import MetadataError, about

_MAX_BYTES = 64 << 20
"""Largest table that is read, bytes."""
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")


Row = TypeVar("Row")


def read_text(path: Path) -> str:
    """A sidecar's text: UTF-8 with or without a byte order mark, or UTF-16 with one; line ends become newlines."""
    with about(path, "Check that it is the right file."):
        return decode_text(file_bytes(path, _MAX_BYTES, noun="sidecar"))


def decode_text(data: bytes) -> str:
    """As `read_text`, from bytes."""
    utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = data.decode("utf-16" if utf16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise MetadataError(
            f"line {line} is not UTF-8 text", remedy="Save the file as UTF-8 (in Excel: CSV UTF-8)."
        ) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_number(text: str, *, decimal_comma: bool = False) -> float | None:
    """A plain finite decimal number, or None (also for nan, inf, 1_000 and digits of other scripts)."""
    cleaned = text.strip().replace(",", ".", 1) if decimal_comma else text.strip()
    if _NUMBER.fullmatch(cleaned) is None:
        return None
    value = float(cleaned)
    return value if math.isfinite(value) else None


def keep_row(kept: dict[str, tuple[int, Row]], name: str, row: Row, line: int, what: str) -> str:
    """Keep what a line says of a photograph, with the line's number; returns what is odd about it, "" for nothing."""
    first, earlier = kept.setdefault(name, (line, row))
    if earlier != row:
        raise MetadataError(
            f"line {line}: {name} is listed again with another {what} (first on line {first})",
            remedy="Keep one line per photograph.",
        )
    return "" if first == line else f"listed twice (lines {first} and {line})"


def match_names(listed: Iterable[str], names: Iterable[str]) -> dict[str, str]:
    """Which photograph each listed name means.

    The same name; else one that ends alike, by whole folders; else so without regard to case; else, for a name without
    a photograph's suffix, so without suffixes. Unicode is compared in its composed form (NFC), since file systems
    differ in it. Ambiguous names stay unmatched. Gives the photographs' names by those of the listed ones that are
    found.
    """
    names = list(names)
    exact = {_nfc(name): name for name in names}
    by_end: tuple[dict[str, list[str]], ...] = ({}, {}, {})
    for name in names:
        for keyed, key in zip(by_end, _keys(_parts(name)), strict=True):
            keyed.setdefault(key[-1], []).append(name)
    matched: dict[str, str] = {}
    for entry in listed:
        if _nfc(entry) in exact:
            matched[entry] = exact[_nfc(entry)]
            continue
        levels = _keys(_parts(entry))
        for level, (keyed, key) in enumerate(zip(by_end, levels, strict=True)):
            if level == 2 and PurePosixPath(levels[1][-1]).suffix in PHOTO_SUFFIXES:
                break
            alike = [name for name in keyed.get(key[-1], []) if _ends_alike(_keys(_parts(name))[level], key)]
            if len(alike) == 1:
                matched[entry] = alike[0]
            if alike:
                break
    return matched


def _keys(parts: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """A path as it is, without regard to case, and so without its suffix."""
    folded = tuple(part.casefold() for part in parts)
    stem = PurePosixPath(folded[-1])
    return parts, folded, (*folded[:-1], stem.stem if stem.suffix in PHOTO_SUFFIXES else folded[-1])


def _ends_alike(a: tuple[str, ...], b: tuple[str, ...]) -> bool:
    shared = min(len(a), len(b))
    return a[-shared:] == b[-shared:]


def _parts(name: str) -> tuple[str, ...]:
    return PurePosixPath(_nfc(name).replace("\\", "/")).parts or ("",)


def _nfc(name: str) -> str:
    return unicodedata.normalize("NFC", name)
