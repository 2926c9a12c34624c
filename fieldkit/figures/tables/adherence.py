"""Adherence of photographs to the plan."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence

from fieldkit.figures.content import Column, Mark, Row, Table, Terms, tabulated
from fieldkit.figures.style import decimal
from fieldkit.results.evaluation import AdherenceEntry, PlotEvaluation
from fieldkit.wording import listed

ACHIEVED_BY = {
    "reported": "the autopilot's own estimate",
    "reconstructed": "the reconstruction",
    "tagged": "the photographs' tags",
}
"""Sources of achieved poses, by `AdherenceEntry.achieved_by`."""

_MOST_NAMES = 20
"""Most photographs that are named."""
_AXES = {
    "east_m": (Column("east, m", True), 2),
    "north_m": (Column("north, m", True), 2),
    "up_m": (Column("up, m", True), 2),
    "yaw_deg": (Column("yaw, °", True), 1),
    "pitch_deg": (Column("pitch, °", True), 1),
}
_STATISTICS: tuple[tuple[str, int, Callable[[list[float]], float]], ...] = (
    ("mean", 1, statistics.fmean),
    ("std. dev.", 2, statistics.stdev),
    ("largest", 1, lambda values: max(map(abs, values))),
)
"""Name, least number of stations, and how it is computed."""


def adherence_by_plot(plots: Sequence[PlotEvaluation]) -> Table:
    """Each plot's adherence as root mean squares; no rows if nothing is known of any plot."""
    return tabulated(
        "How the photographs kept to the plan, RMS",
        [
            {
                "plot": plot.name,
                "by": found.achieved_by,
                Column("stations", True): f"{(n := len(found.stations))} of {n + len(found.missing)}",
                Column("horizontal, m", True): decimal(found.horizontal_rms_m),
                Column("yaw, °", True): decimal(found.yaw_rms_deg),
                Column("pitch, °", True): decimal(found.pitch_rms_deg),
            }
            for plot in plots
            if (found := plot.adherence) is not None
        ],
    )


def station_table(found: AdherenceEntry) -> Table:
    """Poses of photographs less their stations': one row per station, and what the errors come to."""
    rows: list[Row] = [
        {
            "station": s.station,
            "photograph": s.image,
            **_errors({axis: getattr(s, axis) for axis in _AXES}),
            Column("speed, m/s", True): decimal(s.speed_mps),
            Column("turning, °/s", True): decimal(s.turning_dps, 1),
        }
        for s in found.stations
    ]
    empty = dict.fromkeys(rows[0]) if rows else {}
    rows += [empty | {"station": name, "photograph": Mark("problem", "no photograph")} for name in found.missing]
    known = {axis: [v for s in found.stations if (v := getattr(s, axis)) is not None] for axis in _AXES}
    for name, least, of in _STATISTICS:
        figures = {axis: of(values) if len(values) >= least else None for axis, values in known.items()}
        if any(value is not None for value in figures.values()):
            rows.append(empty | {"station": name, **_errors(figures)})
    return tabulated(
        "How the flight kept to its plan", rows, f"Achieved less planned, by {ACHIEVED_BY[found.achieved_by]}."
    )


def _errors(values: Mapping[str, float | None]) -> Row:
    return {column: decimal(values[axis], digits) for axis, (column, digits) in _AXES.items()}


def gaps(found: AdherenceEntry) -> Terms | None:
    """Stations without a photograph and photographs of no station; None if complete."""
    rows = [
        (label, listed(list(names), _MOST_NAMES))
        for label, names in (("no photograph of", found.missing), ("of no station", found.extra))
        if names
    ]
    return Terms(tuple(rows)) if rows else None
