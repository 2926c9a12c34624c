"""Adherence of photographs to the plan."""

from __future__ import annotations

from collections.abc import Sequence

from fieldkit.figures.content import Cell, Column, Mark, Table, Terms
from fieldkit.figures.style import decimal, metres
from fieldkit.figures.tables.tabulated import MOST_ROWS, cut_note, tabulated
from fieldkit.results.evaluation import AdherenceEntry, PlotEvaluation
from fieldkit.wording import listed

ACHIEVED_BY = {
    "reported": "the autopilot's own estimate",
    "reconstructed": "the reconstruction",
    "tagged": "the photographs' tags",
}
"""Sources of achieved poses, by `AdherenceEntry.achieved_by`."""

_MOST_NAMES = 20
_AXES = (("east_m", 3), ("north_m", 3), ("up_m", 3), ("yaw_deg", 2), ("pitch_deg", 2))
_AXIS_COLUMNS = tuple(Column(label, True) for label in ("east, m", "north, m", "up, m", "yaw, °", "pitch, °"))
_STATISTICS = (("bias", "mean"), ("std_dev", "std. dev."), ("max", "largest"))


def adherence_by_plot(plots: Sequence[PlotEvaluation]) -> Table:
    """Each plot's adherence as root mean squares; no rows if nothing is known of any plot."""
    found = [(plot.name, plot.adherence) for plot in plots if plot.adherence is not None]
    return tabulated("How the photographs kept to the plan, RMS", found, (
        (Column("plot"), lambda row: row[0]), (Column("by"), lambda row: row[1].achieved_by),
        (Column("stations", True), lambda row: f"{(n := len(row[1].stations))} of {n + len(row[1].missing)}"),
        (Column("horizontal, m", True), lambda row: metres(row[1].horizontal_rms_m)),
        (Column("yaw, °", True), lambda row: decimal(row[1].yaw_rms_deg)),
        (Column("pitch, °", True), lambda row: decimal(row[1].pitch_rms_deg)),
    ))  # fmt: skip


def station_table(found: AdherenceEntry) -> Table:
    """Poses of photographs less their stations': one row per station."""
    columns = (
        Column("station"), Column("photograph"), *_AXIS_COLUMNS, Column("speed, m/s", True),
        Column("turning, °/s", True),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = [
        (s.station, s.image, metres(s.east_m), metres(s.north_m), metres(s.up_m), decimal(s.yaw_deg, 1),
         decimal(s.pitch_deg, 1), decimal(s.speed_mps), decimal(s.turning_dps, 1))
        for s in found.stations
    ]  # fmt: skip
    rows += [(name, Mark("problem", "no photograph"), *(None,) * 7) for name in found.missing]
    note = f"Achieved less planned, by {ACHIEVED_BY[found.achieved_by]}. {cut_note(len(rows))}".strip()
    return Table("How the flight kept to its plan", columns, tuple(rows[:MOST_ROWS]), note)


def difference_table(found: AdherenceEntry) -> Table:
    """Statistics of the differences between sources of poses; no rows with fewer than two sources."""
    rows: list[tuple[Cell, ...]] = []
    for each in found.differences:
        spreads = [(getattr(each, axis), digits) for axis, digits in _AXES]
        photographs = max((spread.count for spread, _ in spreads if spread is not None), default=0)
        for key, name in _STATISTICS:
            cells = [None if spread is None else decimal(getattr(spread, key), digits) for spread, digits in spreads]
            rows.append((f"{each.of} less {each.less}", f"{photographs}", name, *cells))
    columns = (Column("poses"), Column("photographs", True, short="photos"), Column("figure"), *_AXIS_COLUMNS)
    return Table("What the sources of poses say of the same photographs", columns, tuple(rows))


def gaps(found: AdherenceEntry) -> Terms | None:
    """Missing sources with reasons, stations without photograph, photographs of no station; None if complete."""
    rows: list[tuple[str, str]] = [(source, f"not known: {why}") for source, why in found.unknown.items()]
    for label, names in (("no photograph of", found.missing), ("of no station", found.extra)):
        rows += [(label, listed(list(names), _MOST_NAMES))] if names else []
    return Terms(tuple(rows)) if rows else None
