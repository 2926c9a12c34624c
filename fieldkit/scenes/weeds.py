"""Leafy ground cover and weeds between the maize plants. They are no part of the reference."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WeedsDescription:
    """What grows between the plants.

    Attributes:
        seed: of everything random about it.
        cover_per_m2: small prostrate plants (clover-like, 1 to 3 cm high) per square metre where they grow densest.
        weeds_per_m2: larger broad-leaved weeds (rosettes, 3 to 8 cm high) per square metre.
        patchiness: 0 even cover, 1 patches with bare soil between them.
        radius_m: how far from the origin they grow.
    """

    seed: int = 0
    cover_per_m2: float = 0.0
    weeds_per_m2: float = 0.0
    patchiness: float = 0.5
    radius_m: float = 2.5

    def __post_init__(self) -> None:
        if not (0 <= self.cover_per_m2 <= 2000 and 0 <= self.weeds_per_m2 <= 200):
            raise ValueError("cover_per_m2 is 0 to 2000, weeds_per_m2 0 to 200")
        if not (0 <= self.patchiness <= 1 and 0 < self.radius_m <= 10):
            raise ValueError("patchiness is 0 to 1, radius_m above 0 and at most 10")
