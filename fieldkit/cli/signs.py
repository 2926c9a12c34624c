"""Signs that a stream's encoding does not know: a redirected stream's on Windows (cp1252), or that of the C locale."""

from __future__ import annotations

import codecs
import io
from typing import TextIO

_PLAIN = {
    "−": "-", "‑": "-", "–": "-", "→": "->", "≈": "~", "≥": ">=", "≤": "<=", "±": "+/-", "×": "x", "·": "*", "…": "...",
    "°": " deg", "²": "2", "³": "3", "µ": "u",
}  # fmt: skip


def knows_every_sign(stream: TextIO) -> bool:
    """Whether a stream takes any text: one of UTF-8 or UTF-16, or in memory."""
    encoding = getattr(stream, "encoding", None)
    return encoding is None or encoding.lower().startswith("utf")


def write_plainly(stream: TextIO) -> None:
    """Let a stream write what it does not know in its own signs ("->", "+/-"), else as an escape, never an error."""
    if not knows_every_sign(stream) and isinstance(stream, io.TextIOWrapper):
        codecs.register_error("fieldkit.plain", _plain)
        stream.reconfigure(errors="fieldkit.plain")


def _plain(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    unknown = error.object[error.start : error.end]
    return "".join(_PLAIN.get(c) or c.encode("ascii", "backslashreplace").decode() for c in unknown), error.end
