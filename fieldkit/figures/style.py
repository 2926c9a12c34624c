"""How figures and foreign text are written for people."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

DASH = "–"
"""Stands for missing values."""

DISTANCE_RAMP = ("#27609b", "#79a9b5", "#ecd06f", "#e07b39", "#a3142a")
"""Colours of distances to a reference in every picture, map and view, from none to large: blue through light yellow to
red, safe for colour-blind eyes."""

LONGEST = 600
"""Largest number of characters shown; paths and messages are shorter."""

_UNIT = re.compile(r"(?<=\d) (?=(?:±|mm|m|m³|px|MB|s|h|min|%|°)(?:[\s.,;:)]|$))|(?<=±) (?=\d)")

# Controls but newline and tab, the bidirectional controls (UAX #9), line separators, tags, and halves of surrogates.
_INVISIBLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\U000e0000-\U000e007f\ud800-\udfff\ufffe\uffff]"
)

_FIRST_METRE = 0.0995  # longer lengths are written in metres


def format_length(length_m: float | None, *, metric: bool = True) -> str:
    """A length with its unit: ``4.40 mm``, ``0.27 m``, ``12.3 m``, ``1,250 m``, or ``0.27 units`` where it is none in
    metres; a dash for None.
    """
    if length_m is None:
        return DASH
    if not metric:
        return f"{length_m:.3g} units"
    if abs(length_m) < _FIRST_METRE:
        return f"{millimetres(length_m)} mm"
    return f"{three_digits(length_m)} m"


def format_with_error(length_m: float, error_m: float | None) -> str:
    """A length and its error in the length's unit: ``4.06 ± 0.41 mm``, ``0.95 ± 0.03 m``."""
    if error_m is None:
        return format_length(length_m)
    if abs(length_m) < _FIRST_METRE:
        return f"{millimetres(length_m)} ± {millimetres(error_m)} mm"
    return f"{three_digits(length_m)} ± {three_digits(error_m)} m"


def format_range(lengths_m: Sequence[float]) -> str:
    """The least and the greatest of lengths in one unit: ``3.27 to 4.17 mm``, ``0.08 to 1.20 m``."""
    low, high = min(lengths_m), max(lengths_m)
    millimetric = abs(high) < _FIRST_METRE
    first, last = (millimetres(each) if millimetric else three_digits(each) for each in (low, high))
    return f"{first}{'' if first == last else f' to {last}'} {'mm' if millimetric else 'm'}"


def format_nominal(length_m: float, *, metric: bool = True) -> str:
    """A nominal length, without needless digits: ``5 mm``, ``0.5 m``; without metres only the number."""
    if not metric:
        return f"{length_m:g}"
    return f"{1000.0 * length_m:g} mm" if abs(length_m) < _FIRST_METRE else f"{length_m:g} m"


def format_seconds(seconds: float) -> str:
    """A duration: ``8.3 s``, ``2:05 min``, ``1:02:05 h``."""
    if seconds < 59.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d} h" if minutes >= 60 else f"{minutes}:{rest:02d} min"


def millimetres(length_m: float | None) -> str | None:
    """A length in millimetres without its unit: ``0.39``, ``3.93``, ``39.3``, ``393``; None stays None."""
    return None if length_m is None else three_digits(1000.0 * length_m)


def three_digits(value: float) -> str:
    """Three significant digits, but no more than two decimals: ``3.93``, ``39.3``, ``393``."""
    size = abs(value)
    return _signed(f"{value:,.{2 if size < 9.995 else 1 if size < 99.95 else 0}f}")


def decimal(value: float | None, digits: int = 2) -> str | None:
    """A number with the given decimals; None stays None."""
    return None if value is None else _signed(f"{value:,.{digits}f}")


def percent(share: float | None, digits: int = 1) -> str | None:
    """A share as a percentage without the % sign; 100 only for exactly 1. None stays None."""
    if share is None:
        return None
    text = f"{100.0 * share:.{digits}f}"
    if share < 1 and float(text) >= 100:
        text = f"{100.0 - 10.0**-digits:.{digits}f}"
    return text


def with_unit(text: str | None, unit: str) -> str:
    """A number with its unit; a dash for None."""
    return DASH if text is None else f"{text} {unit}"


def _signed(text: str) -> str:
    # A minus sign as wide as a digit; no "−0.00".
    if text.startswith("-"):
        return "−" + text[1:] if any(c in "123456789" for c in text) else text[1:]
    return text


def visible(text: str) -> str:
    r"""Text with its invisible and direction-changing characters written out as ``\u202e``.

    Text longer than `LONGEST` ends in an ellipsis.
    """
    if len(text) <= LONGEST and text.isascii() and text.isprintable():
        return text  # nearly all are, and a report has a million
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
