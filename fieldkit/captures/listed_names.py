"""Which photographs the names in a sidecar mean."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from pathlib import PurePosixPath

from fieldkit.captures.folder import PHOTO_SUFFIXES


def match_names(listed: Iterable[str], names: Iterable[str]) -> dict[str, str]:
    """Which photograph each listed name means.

    The same name; else one that ends alike, by whole folders; else so without regard to case; else, for a name without
    a photograph's suffix, so without suffixes. Unicode is compared in its composed form (NFC), since file systems
    differ in it. Ambiguous names stay unmatched.

    Returns:
        listed name → photograph name, for those found.
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
