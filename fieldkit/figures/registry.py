"""Every figure of a plot, once: what it is called, its unit, its value and error, and what it means.

Tables, maps, drift, exports and the glossary read it. Traits come from `fieldkit.results.traits`, where
each is described beside its field.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from fieldkit.figures.content import Cell, Column, Row
from fieldkit.figures.style import DISTANCE_RAMP, decimal, format_nominal, three_digits, with_unit
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.traits import DESCRIBED, Trait, error_column
from fieldkit.results.visit import Visit

Scored: TypeAlias = PlotEvaluation | Visit
Value: TypeAlias = Callable[[Scored], float | None]
Group = Literal["distance", "prediction", "trait", "reconstruction"]
"""To the plot's reference, to its true plants as predicted, of the plants, of the reconstruction."""

GREENS = ("#eef8c4", "#b3dd8b", "#5fb96a", "#1f8a50", "#00582f")
"""Colours of what is only more or less, light to dark."""
F_SCORE = "f_score_"


@dataclass(frozen=True)
class Figure:
    """A figure of a plot on a date."""

    key: str
    """Of columns and JSON; it ends in the unit of the stored value."""
    label: str
    unit: str
    """That people read; empty for none."""
    group: Group
    meaning: str
    value: Value
    error: Value = lambda _: None
    """Half the interval that holds nine in ten repeats, or how far above the value it ends; None where the plot's
    results do not say it."""
    error_below: Value = lambda _: None
    """How far below the value it ends; None where that is as far as above."""
    factor: float = 1.0
    """From the stored value to ``unit``."""
    decimals: int | None = None
    """None writes three significant digits."""
    short: str = ""
    """The label for little room; empty for the same label."""
    of: str = ""
    """What it is of, beside the figure."""
    trend: bool = False
    """Whether it is followed over the dates: in maps, charts and drift."""
    ramp: tuple[str, ...] = DISTANCE_RAMP
    """Its colours on a map, from low to high."""

    @property
    def title(self) -> str:
        """Label and unit: ``accuracy, mm``."""
        return f"{self.label}, {self.unit}" if self.unit else self.label

    @property
    def column(self) -> Column:
        """Of a table."""
        short = self.short or self.label
        detail = self.group == "trait" and not self.trend
        return Column(self.title, True, short=f"{short}, {self.unit}" if self.unit else short, detail=detail)

    def shown(self, plot: Scored) -> float | None:
        """The value in its unit."""
        found = self.value(plot)
        return None if found is None else self.factor * found

    def number(self, value: float | None, more: int = 0) -> str | None:
        """A stored value as people read it, without its unit; with so many more decimals than others."""
        if value is None or self.decimals is None:
            return None if value is None else three_digits(self.factor * value)
        return decimal(self.factor * value, self.decimals + more)

    def amount(self, value: float | None) -> str:
        """The same with its unit; a dash for None."""
        return with_unit(self.number(value), self.unit).rstrip()

    def with_error(self, plot: Scored) -> str | None:
        """``0.81 ± 0.03`` or ``0.81 +0.12 −0.03``, without its unit; None without a value."""
        found = [each(plot) for each in (self.value, self.error, self.error_below)]
        least = min((2.0 * self.factor * error for error in found[1:] if error), default=1.0)
        more = max(0, -math.floor(math.log10(least)) - (self.decimals or 0))  # of a potted plant: none is ± 0.000
        number, above, below = (self.number(each, more) for each in found)
        if number is None or above is None:
            return number
        return f"{number} ± {above}" if below in (None, above) else f"{number} +{above} −{below}"

    def error_towards(self, plot: Scored, above: bool) -> float | None:
        """How far the true value may be on one side of the stated one."""
        below = None if above else self.error_below(plot)
        return self.error(plot) if below is None else below

    def cell(self, plot: Scored) -> Cell:
        """Of a table; a predicted distance's interval stands in a column of its own."""
        return self.with_error(plot) if self.group == "trait" else self.number(self.value(plot))


def f_score(distance: str) -> Figure:
    """The F-score at a distance as `distance_key` writes it."""
    within = format_nominal(float(distance))
    return Figure(
        F_SCORE + distance,
        f"F‑score at {within}",
        "",
        "distance",
        "Precision and recall at one distance as one number (their harmonic mean), from 0 to 1. High is good.",
        lambda plot: (plot.f_score or {}).get(distance),
        decimals=3,
        short=f"F, {within}",
    )


def figures_of(group: Group) -> tuple[Figure, ...]:
    """The figures of a group in the order of tables."""
    return tuple(each for each in FIGURES.values() if each.group == group)


def cells(plot: Scored, figures: Sequence[Figure]) -> Row:
    """The cells of a row, by column."""
    return {each.column: each.cell(plot) for each in figures}


def _stored(key: str) -> Value:
    """The attribute of that name; lengths without a scale are of no use to others."""
    of_visits, length = key in Visit.model_fields, key.endswith("_m")

    def value(plot: Scored) -> float | None:
        known = of_visits if isinstance(plot, Visit) else plot.metric or not length
        found: float | None = getattr(plot, key, None) if known else None
        return found

    return value


def _predicted(key: str) -> Value:
    def value(plot: Scored) -> float | None:
        told = plot if isinstance(plot, Visit) else plot.prediction
        found: float | None = getattr(told, f"predicted_{key}" if isinstance(plot, Visit) else key, None)
        return found

    return value


def predicted_interval(plot: Scored) -> tuple[float | None, float | None]:
    """The ends between which nine in ten such plots lie, metres."""
    return _predicted("low_m")(plot), _predicted("high_m")(plot)


def _half_interval(plot: Scored) -> float | None:
    low, high = predicted_interval(plot)
    return None if low is None or high is None else 0.5 * (high - low)


def _trait(trait: Trait) -> Figure:
    def of(column: str) -> Value:
        return lambda plot: None if plot.traits is None else getattr(plot.traits, column, None)

    told = DESCRIBED[trait]
    return Figure(
        trait,
        told.label,
        told.unit,
        "trait",
        told.meaning,
        of(trait),
        of(error_column(trait)),
        of(error_column(trait, "error_below")),
        decimals=told.decimals,
        short=told.short,
        of=told.of,
        trend=told.trend,
        ramp=GREENS,
    )


def _length_mm(key: str, label: str, group: Group, meaning: str, short: str = "", of: str = "") -> Figure:
    return Figure(key, label, "mm", group, meaning, _stored(key), factor=1000.0, short=short, of=of)


_ALL = (
    Figure(
        "chamfer_m", "chamfer distance", "mm", "distance", "Accuracy plus completeness. Low is good.",
        _stored("chamfer_m"), factor=1000.0, short="chamfer", of="accuracy + completeness", trend=True,
    ),
    _length_mm(
        "accuracy_m", "accuracy", "distance",
        "Mean distance from the points of a capture to the reference: what is there but should not be, or lies in the "
        "wrong place.",
        of="how far its points are from the reference",
    ),
    _length_mm(
        "completeness_m", "completeness", "distance",
        "Mean distance from the points of the reference to what was reconstructed: what should be there but is not. "
        "Low is good, for both.",
        "complete", "how far the reference is from what was reconstructed",
    ),
    Figure(
        "predicted_chamfer_m", "predicted chamfer", "mm", "prediction",
        "Where a plot has no reference: how far its cloud is likely to be from its true plants (chamfer distance), "
        "from figures that need none. Nine in ten plots like those it was made on lie in the interval.",
        _predicted("chamfer_m"), _half_interval, factor=1000.0, trend=True,
    ),
    *(_trait(trait) for trait in DESCRIBED),
    Figure(
        "right_share", "photographs used", "%", "reconstruction",
        "Registered, and not in contradiction to where the photograph is known to have been taken. Only these make the "
        "cloud.",
        lambda plot: plot.right / plot.images if plot.images else None, factor=100.0, decimals=1, short="used",
    ),
    _length_mm(
        "pose_rms_m", "known positions RMS", "reconstruction",
        "How far the reconstructed camera positions lie from the known ones (root mean square).", "pose RMS",
    ),
    Figure(
        "reprojection_px", "reprojection error", "px", "reconstruction",
        "How far the reconstructed points fall from where the photographs show them, in pixels. Below 1 is good.",
        _stored("reprojection_px"), decimals=2, short="error",
    ),
    *(
        Figure(
            f"near_{px}px", f"plants within {px} px", "%", "reconstruction",
            f"Share of the plants' pixels in the photographs that have a point of the cloud within {px} pixels (of a "
            "photograph 1600 wide). What is low has holes, or lacks a side.",
            _stored(f"near_{px}px"), factor=100.0, decimals=1, short=f"{px} px",
        )
        for px in (3, 6)
    ),
    Figure(
        "inside", "points on plants", "%", "reconstruction",
        "Share of the cloud's points that fall on plants' pixels in the photographs.", _stored("inside"), factor=100.0,
        decimals=1,
    ),
    Figure(
        "track_length", "track length", "", "reconstruction",
        "How many photographs see one point, on average. Above 3 is good.", _stored("track_length"), decimals=2,
    ),
    Figure(
        "points", "points", "", "reconstruction", "Points of the plants' cloud.", _stored("points"), decimals=0,
    ),
    Figure(
        "points_per_plant_voxel", "points per voxel", "", "reconstruction",
        "Mean number of the plants' points in a voxel that has any.", _stored("points_per_plant_voxel"), decimals=1,
    ),
    _length_mm(
        "gsd_m", "ground sampling distance", "reconstruction",
        "How much of the plot one pixel covers. Details smaller than two of these are not in a cloud.", "pixel",
    ),
)  # fmt: skip

FIGURES: Mapping[str, Figure] = {each.key: each for each in _ALL}
"""By key, in the order of tables; F-scores are made by `f_score`."""
TRENDS: tuple[Figure, ...] = tuple(each for each in _ALL if each.trend)
"""Those that are followed over the dates."""
