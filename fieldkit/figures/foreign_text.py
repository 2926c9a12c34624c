"""Foreign text, made safe to show."""

from __future__ import annotations

import re
import unicodedata

LONGEST = 600
"""Largest number of characters shown; paths and messages are shorter."""

_UNIT = re.compile(r"(?<=\d) (?=(?:±|mm|m|m³|px|MB|s|h|min|%|°)(?:[\s.,;:)]|$))|(?<=±) (?=\d)")

# Controls but newline and tab, the bidirectional controls (UAX #9), line separators, tags, and halves of surrogates.
_INVISIBLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\U000e0000-\U000e007f\ud800-\udfff\ufffe\uffff]"
)


def visible(text: str) -> str:
    r"""Text with its invisible and direction-changing characters written out as ``\u202e``.

    Text longer than `LONGEST` ends in an ellipsis.
    """
    shown = _INVISIBLE.sub(_written_out, text)
    # Many combining marks would draw far beyond the line.
    shown = re.sub(
        r"([\u0300-\u036f\u0483-\u0489\u1ab0-\u1aff\u20d0-\u20ff]{3})[\u0300-\u036f\u0483-\u0489\u1ab0-\u1aff\u20d0-\u20ff]+",
        r"\1",
        shown,
    )
    return shown if len(shown) <= LONGEST else shown[: LONGEST - 1].rstrip() + "…"


def unbroken(text: str) -> str:
    """Text with non-breaking spaces between numbers and their units."""
    return _UNIT.sub("\u00a0", text)


def _written_out(match: re.Match[str]) -> str:
    code = ord(match.group())
    if unicodedata.category(match.group()) == "Cs" or code > 0xFF:
        return f"\\u{code:04x}"
    return f"\\x{code:02x}"
