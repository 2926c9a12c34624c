"""Tables for the terminal: how photographs kept to the plan."""

from __future__ import annotations

from collections.abc import Iterator

from rich.markup import escape
from rich.table import Table

from fieldkit.present.style import format_length, format_number, table
from fieldkit.results.evaluation import AdherenceEntry, EvaluationReport

_MOST_ROWS = 20
_STATISTICS = (("bias", "bias"), ("std_dev", "std. dev."), ("max", "largest"))


def adherence_tables(report: EvaluationReport) -> Iterator[Table]:
    """Differences between the sources of the poses: all of a single plot's, else achieved less planned by plot."""
    plots = [(plot.name, plot.adherence) for plot in report.plots if plot.adherence is not None]
    if len(plots) == 1:
        yield from _one(*plots[0])
    elif plots:
        rows = table("How the photographs kept to the plan, RMS", "plot", "by", "stations>", "horizontal>", "yaw>",
                     "pitch>")  # fmt: skip
        for name, found in plots[:_MOST_ROWS]:
            rows.add_row(
                escape(name), found.achieved_by, f"{len(found.stations)}/{len(found.stations) + len(found.missing)}",
                format_length(found.horizontal_rms_m), _degrees(found.yaw_rms_deg), _degrees(found.pitch_rms_deg),
            )  # fmt: skip
        if len(plots) > _MOST_ROWS:
            rows.add_row(f"and {len(plots) - _MOST_ROWS} more", *[""] * 5)
        yield rows


def _one(name: str, found: AdherenceEntry) -> Iterator[Table]:
    rows = table(
        f"{escape(name)}: poses of the photographs; lengths in m, angles in °", "difference", "", "east>", "north>",
        "up>", "yaw>", "pitch>",
    )  # fmt: skip
    for each in found.differences:
        spreads = (each.east_m, each.north_m, each.up_m, each.yaw_deg, each.pitch_deg)
        count = max((s.count for s in spreads if s is not None), default=0)
        labels = (f"{each.of} less {each.less}", f"{count} photographs", "")
        for label, (key, title) in zip(labels, _STATISTICS, strict=True):
            cells = [_number(None if s is None else getattr(s, key), 3 - (k > 2)) for k, s in enumerate(spreads)]
            rows.add_row(label, title, *cells)
    yield rows
    said: list[tuple[str, str]] = list(found.unknown.items())
    said += [("no photograph of", ", ".join(found.missing[:_MOST_ROWS]))] if found.missing else []
    said += [("of no station", ", ".join(found.extra[:_MOST_ROWS]))] if found.extra else []
    if said:
        notes = table("What is not known, or missing", "", "")
        notes.show_header = False
        for label, text in said:
            notes.add_row(escape(label), escape(text))
        yield notes


def _number(value: float | None, digits: int) -> str:
    text = format_number(value, digits)
    return text.removeprefix("-") if value is not None and float(text) == 0.0 else text.replace("-", "−")


def _degrees(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}°"
