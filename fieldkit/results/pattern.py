"""A pattern: parallel lines whose photographs look one to a few ways, repeated over any field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from fieldkit.results.fields import STRICT, Heading, Pitch, Share

Metres = Annotated[float, Field(ge=0.1, le=500)]


@dataclass(frozen=True)
class Look:
    """A way that photographs look, and their lines run."""

    __pydantic_config__ = STRICT
    heading_deg: Heading
    """Clockwise from the direction of the rows."""
    pitch_deg: Pitch
    """Of the gimbal: −90 straight down, less steep up to −20."""


@dataclass(frozen=True)
class Pattern:
    """Passes over a field.

    Lines lie wherever their spacing repeats over the field, so that every plot far from the edge is seen alike.
    """

    __pydantic_config__ = STRICT
    looks: Annotated[tuple[Look, ...], Field(min_length=1, max_length=5)]
    height_m: Metres
    """Of the camera above the ground."""
    along_m: Metres
    """From photograph to photograph of a line."""
    between_m: Metres
    """From line to line of one look."""
    offset: Share = 0.5
    """By which the lines of every second look lie beside those of the first, as a share of ``between_m``."""
    speed_mps: Annotated[float, Field(gt=0, le=30)] = 2.0
    """Along lines."""
