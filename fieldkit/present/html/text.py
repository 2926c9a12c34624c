"""Numbers and foreign text as a page shows them."""

from __future__ import annotations

import re
import unicodedata

LONGEST = 600
"""Characters of a foreign text that are shown; paths and messages are shorter."""

_UNIT = re.compile(r"(?<=\d) (?=(?:±|mm|m|m³|px|MB|s|h|min|%|°)(?:[\s.,;:)]|$))|(?<=±) (?=\d)")

# Controls but newline and tab, the bidirectional controls (UAX #9), line separators, tags, and halves of surrogates.
_INVISIBLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\U000e0000-\U000e007f\ud800-\udfff\ufffe\uffff]"
)


def visible(text: str) -> str:
    r"""Text in which nothing is hidden: invisible and direction-changing characters are written out as ``\u202e``.

    What is longer than `LONGEST` ends in an ellipsis.
    """
    shown = _INVISIBLE.sub(_written_out, text)
    # A pile of combining marks draws far beyond its line.
    shown = re.sub(
        r"([\u0300-\u036f\u0483-\u0489\u1ab0-\u1aff\u20d0-\u20ff]{3})[\u0300-\u036f\u0483-\u0489\u1ab0-\u1aff\u20d0-\u20ff]+",
        r"\1",
        shown,
    )
    return shown if len(shown) <= LONGEST else shown[: LONGEST - 1].rstrip() + "…"


def unbroken(text: str) -> str:
    """Text whose numbers stay in one line with their units."""
    return _UNIT.sub("\u00a0", text)


def millimetres(length_m: float | None) -> str | None:
    """A length in millimetres without its unit: ``0.39``, ``3.93``, ``39.3``, ``393``; None stays None."""
    if length_m is None:
        return None
    value = 1000.0 * length_m
    size = abs(value)
    digits = 2 if size < 10 else 1 if size < 100 else 0
    return _signed(f"{value:,.{digits}f}")


def metres(length_m: float | None, digits: int = 2) -> str | None:
    """A length in metres without its unit; None stays None."""
    return None if length_m is None else _signed(f"{length_m:,.{digits}f}")


def decimal(value: float | None, digits: int = 2) -> str | None:
    """A number with so many decimals; None stays None."""
    return None if value is None else _signed(f"{value:,.{digits}f}")


def percent(share: float | None, digits: int = 1) -> str | None:
    """A share as a percentage without its sign; 100 only where it is all of it. None stays None."""
    if share is None:
        return None
    text = f"{100.0 * share:.{digits}f}"
    if share < 1 and float(text) >= 100:
        text = f"{100.0 - 10.0**-digits:.{digits}f}"
    return text


def length(length_m: float | None, *, metric: bool = True, what: str = "error") -> str:
    """A length with its unit: errors in mm, sizes (``what="size"``) in m; "–" for None.

    Args:
        length_m: metres; units of its own where ``metric`` is false.
        metric: whether it is metres.
        what: "error" or "size".
    """
    if length_m is None:
        return "–"
    if not metric:
        return f"{length_m:.3g} units"
    return f"{millimetres(length_m)} mm" if what == "error" else f"{metres(length_m)} m"


def count(number: int, noun: str, plural: str = "") -> str:
    """``1 photograph``, ``12 photographs``."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"


def listed(names: list[str], most: int = 5) -> str:
    """``a, b and c``; beyond ``most`` ``a, b and 7 more``."""
    if len(names) > most:
        rest = len(names) - (most - 1)
        return f"{', '.join(names[: most - 1])} and {rest} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _signed(text: str) -> str:
    # A minus sign as wide as a digit; no "−0.00".
    if text.startswith("-"):
        return "−" + text[1:] if any(c in "123456789" for c in text) else text[1:]
    return text


def _written_out(match: re.Match[str]) -> str:
    code = ord(match.group())
    if unicodedata.category(match.group()) == "Cs" or code > 0xFF:
        return f"\\u{code:04x}"
    return f"\\x{code:02x}"
