"""Adherence of photographs to the plan."""

from __future__ import annotations

from collections.abc import Sequence

from fieldkit.figures.content import Column, Mark, Row, Table, Terms, tabulated
from fieldkit.figures.style import decimal, metres
from fieldkit.results.evaluation import AdherenceEntry, PlotEvaluation
from fieldkit.wording import listed

ACHIEVED_BY = {
    "reported": "the autopilot's own estimate",
    "reconstructed": "the reconstruction",
    "tagged": "the photographs' tags",
}
"""Sources of achieved poses, by `AdherenceEntry.achieved_by`."""

_MOST_NAMES = 20
_AXES = {
    "east_m": (Column("east, m", True), 3),
    "north_m": (Column("north, m", True), 3),
    "up_m": (Column("up, m", True), 3),
    "yaw_deg": (Column("yaw, °", True), 2),
    "pitch_deg": (Column("pitch, °", True), 2),
}
_STATISTICS = (("bias", "mean"), ("std_dev", "std. dev."), ("max", "largest"))


def adherence_by_plot(plots: Sequence[PlotEvaluation]) -> Table:
    """Each plot's adherence as root mean squares; no rows if nothing is known of any plot."""
    return tabulated("How the photographs kept to the plan, RMS", [
        {
            "plot": plot.name,
            "by": found.achieved_by,
            Column("stations", True): f"{(n := len(found.stations))} of {n + len(found.missing)}",
            Column("horizontal, m", True): metres(found.horizontal_rms_m),
            Column("yaw, °", True): decimal(found.yaw_rms_deg),
            Column("pitch, °", True): decimal(found.pitch_rms_deg),
        }
        for plot in plots if (found := plot.adherence) is not None
    ])  # fmt: skip


def station_table(found: AdherenceEntry) -> Table:
    """Poses of photographs less their stations': one row per station."""
    rows: list[Row] = [
        {
            "station": s.station,
            "photograph": s.image,
            **{column: decimal(getattr(s, axis), digits - 1) for axis, (column, digits) in _AXES.items()},
            Column("speed, m/s", True): decimal(s.speed_mps),
            Column("turning, °/s", True): decimal(s.turning_dps, 1),
        }
        for s in found.stations
    ]
    empty = dict.fromkeys(rows[0]) if rows else {}
    rows += [empty | {"station": name, "photograph": Mark("problem", "no photograph")} for name in found.missing]
    return tabulated(
        "How the flight kept to its plan", rows, f"Achieved less planned, by {ACHIEVED_BY[found.achieved_by]}."
    )


def difference_table(found: AdherenceEntry) -> Table:
    """Statistics of the differences between sources of poses; no rows with fewer than two sources."""
    rows: list[Row] = []
    for each in found.differences:
        spreads = {axis: spread for axis in _AXES if (spread := getattr(each, axis)) is not None}
        photographs = max((spread.count for spread in spreads.values()), default=0)
        rows += [
            {
                "poses": f"{each.of} less {each.less}",
                Column("photographs", True, short="photos"): f"{photographs}",
                "figure": name,
                **{column: decimal(getattr(spreads.get(axis), key, None), n) for axis, (column, n) in _AXES.items()},
            }
            for key, name in _STATISTICS
        ]
    return tabulated("What the sources of poses say of the same photographs", rows)


def gaps(found: AdherenceEntry) -> Terms | None:
    """Missing sources with reasons, stations without photograph, photographs of no station; None if complete."""
    rows: list[tuple[str, str]] = [(source, f"not known: {why}") for source, why in found.unknown.items()]
    for label, names in (("no photograph of", found.missing), ("of no station", found.extra)):
        rows += [(label, listed(list(names), _MOST_NAMES))] if names else []
    return Terms(tuple(rows)) if rows else None
