"""Traits of the plants of a plot on a date, as reference.json, evaluation.json and visit.json hold them.

A trait is described here once: `Described` says what people are told of it, and tables, maps, drift, comparisons and
the glossary take it from there (`fieldkit.figures.registry`). `fieldkit.evaluation.traits` measures it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, PositiveFloat

from fieldkit.results.fields import Count, Latitude, Length, Longitude, Ordinal, Share, Strict
from fieldkit.wording import by_key

Trait = Literal[
    "height_m",
    "height_p95_m",
    "height_p99_m",
    "cover_percent",
    "covered_area_m2",
    "canopy_volume_m3",
    "lai",
    "plants",
    "row_gaps",
]
TRAITS: tuple[Trait, ...] = get_args(Trait)
Percent = Annotated[float, Field(ge=0, le=100)]


@dataclass(frozen=True)
class Described:
    """What people are told of a trait."""

    label: str
    short: str
    """The label for little room."""
    unit: str
    decimals: int
    of: str
    """What it is of, beside the figure."""
    meaning: str
    """For the glossary."""
    trend: bool = True
    """Whether it is followed over the dates: in maps, charts and drift."""


class TraitsEntry(Strict):
    """Traits of one plot on one date (docs/traits.md). Nine in ten plots like the benchmark's are within the errors."""

    height_m: Annotated[
        Length | None,
        Described(
            "height",
            "height",
            "m",
            2,
            "of the highest leaf",
            "Of the highest leaf above the ground, as a person measures it with a ruler.",
        ),
    ] = None
    """Of the highest leaf above the ground, as by a ruler; null where ``unknown`` says why. So are the others."""
    height_error_m: Length | None = None
    """How far above ``height_m`` the highest leaf may be."""
    height_error_below_m: Length | None = None
    """How far below: less, where the cloud alone tells the height, since it may lack tips and adds none; null in files
    of before, whose height_error_m is of both sides."""
    height_p95_m: Annotated[
        Length | None,
        Described(
            "height, 95 %",
            "height 95 %",
            "m",
            2,
            "below which 95 % of the canopy is",
            "Below which 95 % of the canopy's upper surface is, seen from above: of a closed canopy steadier than the "
            "highest leaf.",
        ),
    ] = None
    """Quantile of the canopy's upper surface above the ground, over the covered area."""
    height_p95_error_m: Length | None = None
    height_p99_m: Annotated[
        Length | None,
        Described(
            "height, 99 %",
            "height 99 %",
            "m",
            2,
            "below which 99 % of the canopy is",
            "Below which 99 % of the canopy's upper surface is, seen from above.",
            trend=False,
        ),
    ] = None
    height_p99_error_m: Length | None = None
    cover_percent: Annotated[
        Percent | None,
        Described(
            "cover",
            "cover",
            "%",
            1,
            "of the plot, seen from above",
            "Share of the plot that lies below plants, seen from straight above.",
        ),
    ] = None
    """Of the plot's outline, below plants as seen from straight above."""
    cover_error_percent: Length | None = None
    """Percent of the plot, as cover_percent."""
    covered_area_m2: Annotated[
        Length | None,
        Described(
            "covered area", "covered", "m²", 3, "of ground below plants", "Ground that lies below plants.", trend=False
        ),
    ] = None
    """Ground below plants: within the plot's outline, where it is known."""
    covered_area_error_m2: Length | None = None
    canopy_volume_m3: Annotated[
        Length | None,
        Described(
            "canopy volume",
            "volume",
            "m³",
            3,
            "between the ground and the plants' upper surface",
            "Volume between the ground and the upper surface of the plants.",
        ),
    ] = None
    """Between the ground and the canopy's upper surface, over the covered area."""
    canopy_volume_error_m3: Length | None = None
    lai: Annotated[
        Length | None,
        Described(
            "leaf area index",
            "LAI",
            "",
            2,
            "of leaf on each area of plot",
            "One side of all leaves within the plot's outline, over the plot's area.",
        ),
    ] = None
    """Leaf area index: one side of all leaves within the outline, over its area."""
    lai_error: Length | None = None
    plants: Annotated[
        Count | None,
        Described(
            "plants", "plants", "", 0, "counted by their stems", "Plants that stand on the plot, by their stems."
        ),
    ] = None
    """That stand on the plot; the ``plants`` of the same file say where."""
    row_gaps: Annotated[
        Count | None,
        Described(
            "gaps in rows",
            "gaps",
            "",
            0,
            "places without a plant between others of a row",
            "Places in rows without a plant: two neighbours stand 1.5 times their usual distance apart, or more.",
            trend=False,
        ),
    ] = None
    plot_area_m2: PositiveFloat | None = None
    """Of the plot's outline; null where it is not known."""
    unknown: dict[Trait, str] = {}  # noqa: RUF012 - pydantic copies it
    """Why a trait cannot be had from these photographs."""

    def row(self) -> dict[str, Any]:
        """Values by column, and the reasons in words as ``no_trait``."""
        return {**{name: getattr(self, name) for name in VALUES}, REASONS: reasons_in_words(self.unknown)}


class RowEntry(Strict):
    """A planted row of a plot."""

    row: Ordinal
    """From right to left, as one looks along the rows."""
    traits: TraitsEntry
    """Of all that stands over its part of the plot, leaves of the rows beside it included."""


class PlantEntry(Strict):
    """One plant of a plot (docs/traits.md)."""

    plant: Ordinal
    """Its number on the plot: row by row, in each along the row."""
    row: Ordinal | None = None
    """Null where plants stand in no rows."""
    in_row: Ordinal | None = None
    """Its number along the row."""
    x_m: float
    """Of its foot, plot frame."""
    y_m: float
    latitude_deg: Latitude | None = None
    """Of its foot, WGS 84; null where the plot has no geographic place."""
    longitude_deg: Longitude | None = None
    height_m: Length
    """Of its highest leaf above the ground."""
    height_certain: bool
    """Whether the photographs show the plant's top with room above it, and that it is this plant's."""
    area_m2: Length
    """Of the ground below it, seen from above, whether or not others stand over it."""
    touching: Share
    """Share of that area where a neighbour is above, below or beside it."""


DESCRIBED: Mapping[Trait, Described] = {
    trait: next(each for each in TraitsEntry.model_fields[trait].metadata if isinstance(each, Described))
    for trait in TRAITS
}
VALUES = tuple(name for name in TraitsEntry.model_fields if name != "unknown")
REASONS = "no_trait"
COLUMNS = (*VALUES, REASONS)
"""The keys of `TraitsEntry.row`, in order."""


def error_column(trait: Trait, side: str = "error") -> str:
    """Of a trait's error: ``height_error_m`` of ``height_m``, or ``height_error_below_m``; ``lai_error``."""
    name, _, unit = trait.rpartition("_")
    return f"{name}_{side}_{unit}" if name else f"{trait}_{side}"


def reasons_in_words(unknown: Mapping[Trait, str], *, labels: bool = False) -> str:
    """Each reason once, after the traits it is of: ``height_m, canopy_volume_m3: no ground was found``."""
    by_reason = by_key((unknown[t], DESCRIBED[t].label if labels else t) for t in TRAITS if t in unknown)
    return "; ".join(f"{', '.join(traits)}: {reason}" for reason, traits in by_reason.items())
