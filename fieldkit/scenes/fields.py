"""Plots as fields have them: the scenes that the look of rendered photographs was chosen on, and others it was not."""

from __future__ import annotations

from dataclasses import dataclass

from fieldkit.scenes.neighbours import NeighboursDescription
from fieldkit.scenes.plot import Layout, PlotDescription, plant_layout
from fieldkit.scenes.soil import SoilDescription, SoilKind
from fieldkit.scenes.weeds import WeedsDescription


@dataclass(frozen=True)
class _Field:
    seed: int
    plants: int
    layout: Layout
    soil: SoilKind
    cover_per_m2: float
    weeds_per_m2: float
    rows: int = 0


_FIELDS = {
    "tuning": (
        _Field(11, 3, "row", "tilled", 20.0, 2.0),
        _Field(12, 5, "grid", "crumb", 15.0, 2.0),
        _Field(13, 6, "random", "crusted", 10.0, 3.0, rows=1),
    ),
    "test": (
        _Field(31, 3, "row", "crumb", 20.0, 2.0),
        _Field(32, 5, "row", "tilled", 15.0, 2.0, rows=1),
    ),
}


def field_scene(split: str, index: int) -> PlotDescription:
    """A plot of maize in stages V8 to V10 on a moist soil with some weeds, under haze.

    Args:
        split: parameters may be chosen on "tuning" only.
        index: 0 to 2 of "tuning" (the last one between neighbour rows), 0 or 1 of "test" (likewise).

    Raises:
        ValueError: no such scene.
    """
    if split not in _FIELDS or not 0 <= index < len(_FIELDS[split]):
        raise ValueError(f"there is no field scene {split!r} {index}: it is tuning 0 to 2 or test 0 to 1")
    f = _FIELDS[split][index]
    return PlotDescription(
        plant_layout(f.plants, f.seed, layout=f.layout, stages=("V8", "V9", "V10")),
        SoilDescription(seed=f.seed, kind=f.soil),
        weeds=WeedsDescription(f.seed, f.cover_per_m2, f.weeds_per_m2),
        neighbours=NeighboursDescription(f.seed, rows=f.rows),
    )
