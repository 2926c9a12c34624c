"""Rows of maize around the plot. They hide and confuse; they are no part of the reference."""

from __future__ import annotations

from dataclasses import dataclass

from fieldkit.scenes.maize.description import STAGES, Stage


@dataclass(frozen=True)
class NeighboursDescription:
    """Plants that stand around the plot in its rows and beside them.

    Attributes:
        seed: of everything random about them.
        rows: on each side of the plot's rows; 0 for none.
        row_spacing_m: between rows, and from the plot's bounds to the nearest one.
        plant_spacing_m: within a row.
        length_m: of a row.
        heading_deg: direction of the rows, clockwise from north.
        stage: growth stage of all of them.
    """

    seed: int = 0
    rows: int = 0
    row_spacing_m: float = 0.75
    plant_spacing_m: float = 0.18
    length_m: float = 3.0
    heading_deg: float = 90.0
    stage: Stage = "V8"

    def __post_init__(self) -> None:
        if not 0 <= self.rows <= 5:
            raise ValueError(f"0 to 5 neighbouring rows on each side, not {self.rows}")
        if not (0.2 <= self.row_spacing_m <= 3.0 and 0.05 <= self.plant_spacing_m <= 1.0 and 0 < self.length_m <= 20):
            raise ValueError("row_spacing_m is 0.2 to 3, plant_spacing_m 0.05 to 1, length_m above 0 and at most 20")
        if self.stage not in STAGES:
            raise ValueError(f"{self.stage!r} is no growth stage: it is one of {', '.join(STAGES)}")
