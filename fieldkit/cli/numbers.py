"""Options that hold several numbers with commas between."""

from __future__ import annotations

from math import isfinite

from fieldkit.errors import UsageError

_MOST_NOISE_M = 5.0
_REMEDY = {1: "Write one number", 2: "Write two numbers with a comma between", 3: "Write three numbers with commas"}


def finite_numbers(text: str) -> tuple[float, ...]:
    """Numbers with commas between; none where any part of the text is no number."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return numbers if all(map(isfinite, numbers)) else ()


def read_numbers(option: str, text: str, counts: tuple[int, ...], *, least: float = 0.0) -> tuple[float, ...]:
    """The numbers of an option such as ``--pose-noise 0.02,1``.

    Args:
        option: its name, for the error.
        text: as given.
        counts: how many numbers there may be.
        least: none may be below.

    Raises:
        UsageError: it is no such list.
    """
    numbers = finite_numbers(text)
    if len(numbers) not in counts or min(numbers) < least:
        raise UsageError(
            f"{option}: cannot be {text}", remedy=" or ".join(_REMEDY[n] for n in counts) + f", not below {least:g}."
        )
    return numbers


def read_pose_noise(text: str) -> tuple[float, float]:
    """Metres and degrees of ``--pose-noise M,DEG``. Raises UsageError: it is none, or more than a receiver is off."""
    metres, degrees = read_numbers("--pose-noise", text, (2,))
    if metres > _MOST_NOISE_M:
        from fieldkit.documents.mistaken import CENTIMETRES

        raise UsageError(
            f"--pose-noise: {metres:g} m is more than any receiver is off: {CENTIMETRES.looks_like}",
            remedy="Write metres and degrees, like --pose-noise 0.02,1.",
        )
    return metres, degrees
