"""What `fieldkit plan -n 6,8,10 --json` prints: numbers of photographs, and what is expected of each."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from fieldkit.results.fields import Count, Length, Share, Strict


class TraitErrors(Strict):
    """Errors that nine in ten plots are within."""

    height_m: Length
    area: Length
    volume: Length
    """These two as shares."""


class LeastNumbers(Strict):
    """For each trait the least of the numbers whose expected error is within the stated one; null where none is."""

    height_m: Count | None
    area: Count | None
    volume: Count | None


class NumberEntry(Strict):
    """One number of photographs."""

    cameras: Annotated[int, Field(ge=3)]
    expected_m: Length
    """Distance that the geometric score leads to expect, mean over the plots."""
    missing: Share
    """Of the plants' surface, expected not to be reconstructed."""
    errors: TraitErrors | None
    """Expected of traits; null where there are too few photographs for any."""
    flight_s: Length | None
    """In the air over one plot, from take-off to landing; null without a vehicle, or where it cannot fly them."""


class Numbers(Strict):
    """Numbers of photographs, compared by the score alone."""

    kind: Literal["numbers"] = "numbers"
    version: Literal[1] = 1
    fieldkit: str
    """Version that wrote it."""
    numbers: tuple[NumberEntry, ...]
    """The fewest photographs first."""
    stated: TraitErrors
    """Errors that traits are stated with where nothing enlarges them."""
    least: LeastNumbers
    seconds: Length
    """That it took."""
