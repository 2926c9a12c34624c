"""What the ground of a simulated plot is asked to look like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

SCATTER_M = 1.25
"""Stones and residue lie in the square of twice this side about the origin, metres."""

SoilKind = Literal["tilled", "crumb", "crusted", "printed"]


@dataclass(frozen=True)
class SoilDescription:
    """What the ground looks like.

    Attributes:
        seed: of everything random about it.
        core_m: side of the square about the origin where the grid is finest.
        spacing_m: grid spacing there; it widens outwards.
        texture_px: side of the colour texture.
        clod_height_m: height of the largest clods of a tilled soil; the other kinds are flatter in proportion.
        stones, residues: how many stones and pieces of straw lie within `SCATTER_M` of the origin.
        contrast: of the colour, 1 as a dry tilled loam; what is seen beyond it is shading.
        kind: "tilled" with clods, "crumb" a fine seedbed, "crusted" bare and sealed by rain with cracks; "printed" is
            the height field on a 5 mm grid under a contrasty colour texture of the engine's benchmark.
    """

    seed: int = 0
    core_m: float = 1.2
    spacing_m: float = 0.005
    texture_px: int = 2048
    clod_height_m: float = 0.030
    stones: int = 120
    residues: int = 60
    contrast: float = 0.5
    kind: SoilKind = "tilled"

    def __post_init__(self) -> None:
        if self.kind not in get_args(SoilKind):
            raise ValueError(f"{self.kind!r} is no kind of soil: it is one of {', '.join(get_args(SoilKind))}")
        if not (0.1 <= self.core_m <= 10.0 and 0.001 <= self.spacing_m <= 0.1 and self.spacing_m < self.core_m / 4):
            raise ValueError("the soil's core_m is 0.1 to 10, its spacing_m 0.001 to 0.1 and a small part of core_m")
        if not 64 <= self.texture_px <= 8192:
            raise ValueError(f"texture_px is 64 to 8192, not {self.texture_px}")
        if min(self.clod_height_m, self.stones, self.residues, self.contrast) < 0:
            raise ValueError("clod_height_m, stones, residues and contrast cannot be negative")


PRINTED = SoilDescription(kind="printed", spacing_m=0.005, texture_px=4096, stones=700, residues=320, contrast=1.0)
"""The soil of the engine's benchmark; only its seed differs from scene to scene."""
