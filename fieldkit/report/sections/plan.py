"""Plans and missions: their sections, and the summary."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from fieldkit.figures.content import (
    Block,
    Column,
    Details,
    KeyFigure,
    KeyFigures,
    Row,
    Section,
    Statement,
    Table,
    tabulated,
)
from fieldkit.figures.style import (
    decimal,
    format_length,
    format_range,
    format_seconds,
    format_with_error,
    millimetres,
)
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results
from fieldkit.report.sections.shown import Shown
from fieldkit.results.mission import Shot
from fieldkit.results.pattern import Pattern
from fieldkit.results.plan import Plan, Station, station_number
from fieldkit.sites.placement import SiteFrame
from fieldkit.wording import count

if TYPE_CHECKING:
    from fieldkit.planning.run.outcome import Outcome

_FINALISTS_NOTE = (
    "Finalists are evaluated again with new random numbers: the lowest of many noisy values is partly luck. Compare "
    "values within a column only: confirmations may be at a finer quality than the search."
)


def plan_section(result: Loaded[PlanRun], anchor: str, shown: Shown) -> Section:
    """A plan's stations, and the search for them."""
    run = result.report
    blocks: list[Block] = [KeyFigures(tuple(_figures(run))), *shown.view_blocks(anchor)]
    if run.plan is not None:
        blocks.append(_stations(run.plan) if run.plan.pattern is None else _looks(run.plan.pattern))
    if run.outcome is not None and run.outcome.finalists:
        blocks.append(finalist_table(run.outcome))
    return Section(anchor, "Plan" if result.name == "plan" else f"Plan: {result.name}", tuple(blocks))


def mission_section(result: Loaded[FlownMission], anchor: str, shown: Shown) -> Section:
    """A mission's way over the plots."""
    mission, flight = result.report, result.report.flight
    stations, burst = flight.shots, 1 if flight.burst is None else flight.burst.photographs
    figures = [
        KeyFigure("photographs", f"{flight.photographs}"),
        KeyFigure("plots", f"{len(flight.plots)}"),
        KeyFigure("length of the way", format_length(flight.length_m), "from take-off to landing"),
        KeyFigure("time in the air", format_seconds(flight.time_s), "from take-off to landing, estimated"),
    ]
    if stations:
        heights = [station.height_m for station in stations]
        figures.append(KeyFigure("heights of photographs", format_range(heights), "above home"))
    positions = SiteFrame(mission.record.home).points(stations).tolist()
    table = tabulated(
        "Photographs in the order they are flown",
        [
            {
                "photograph": f"{number}" if burst == 1 else f"{(number - 1) * burst + 1} to {number * burst}",
                "plot": station.plot,
                "station>": f"{station_number(station.station)}",
                "east of home, m>": decimal(east),
                "north of home, m>": decimal(north),
                "height above home, m>": decimal(up),
                **_angles(station),
            }
            for number, (station, (east, north, up)) in enumerate(zip(stations, positions, strict=True), 1)
        ],
    )
    blocks: tuple[Block, ...] = (KeyFigures(tuple(figures)), *shown.view_blocks(anchor))
    if not stations:
        return Section(anchor, f"Mission: {mission.mission_file or flight.name}", blocks)
    blocks += (table,) if len(table.rows) <= 14 else (Details(f"All {len(stations)} photographs", (table,)),)
    return Section(anchor, f"Mission: {mission.mission_file or flight.name}", blocks)


def finalist_table(outcome: Outcome) -> Table:
    """The finalists of a search, the plan first; trials count from 1, the `number` of evaluations.jsonl from 0."""
    best = outcome.finalists[0].number if outcome.finalists else -1
    return tabulated(
        "Finalists",
        [
            {
                "trial": f"{found.number + 1}{', the plan' * (found.number == best)}",
                Column("how it was proposed", short="from"): found.origin,
                "expected, mm>": millimetres(found.expected_m),
                Column("in the search, mm", True, short="search, mm"): millimetres(found.search_value_m),
                "confirmed, mm>": millimetres(found.value_m),
                Column("spread, mm", True, short="±, mm"): millimetres(found.spread_m),
                Column("expected after all evaluations, mm", True, short="kind, mm"): millimetres(found.kind_m),
                Column("photographs used", short="used"): ", ".join(map(str, found.right)),
            }
            for found in outcome.finalists
        ],
        _FINALISTS_NOTE,
    )


def _figures(result: PlanRun) -> Iterator[KeyFigure]:
    plan, settings, outcome = result.plan, result.settings, result.outcome
    if plan is not None and (pattern := plan.pattern) is not None:
        yield KeyFigure("above the ground", f"{pattern.height_m:g} m")
        yield KeyFigure("along lines", f"{pattern.along_m:g} m", "from photograph to photograph")
        yield KeyFigure("between lines", f"{pattern.between_m:g} m", "of one way to look")
        yield KeyFigure("speed", f"{pattern.speed_mps:g} m/s", "along lines")
    elif plan is not None:
        yield KeyFigure("camera poses", f"{len(plan.stations)}")
        if plan.method is not None and plan.method.chamfer_m is not None:
            yield KeyFigure(
                "chamfer distance",
                format_with_error(plan.method.chamfer_m, plan.method.known_spread_m),
                "of what they reconstruct to its reference, on what the plan was made on",
            )
        elif plan.method is not None and plan.method.repeats == 0:
            yield KeyFigure("chamfer distance", "not confirmed", "no photograph was taken of these poses")
    if settings is not None and (result.trials or plan is None):
        yield KeyFigure("trials", f"{len(result.trials)} of {settings.evaluations}", "sets of poses that were tried")
    if outcome is not None:
        yield KeyFigure(
            "time",
            format_seconds(outcome.seconds),
            f"{format_seconds(outcome.evaluation_cpu_s + outcome.proposal_cpu_s)} of processor time",
        )


def _stations(plan: Plan) -> Table:
    axes = [f"{axis}, m>" for axis in "xyz"]
    return tabulated(
        "Stations",
        [
            {
                "station": f"{station_number(number)}",
                **dict(zip(axes, map(decimal, station.position_m), strict=True)),
                **_angles(station),
            }
            for number, station in enumerate(plan.stations)
        ],
        "Plot frame: metres from the plot's centre on the ground; z is the height above it.",
    )


def _looks(pattern: Pattern) -> Table:
    return tabulated(
        "Ways to look",
        [
            {
                Column("heading, °", True): decimal(each.heading_deg, 1),
                Column("pitch, °", True): decimal(each.pitch_deg, 1),
            }
            for each in pattern.looks
        ],
        "Headings are against the rows, clockwise.",
    )


def _angles(station: Station | Shot) -> Row:
    return {
        "yaw, °>": decimal(station.yaw_deg % 360.0, 1),
        "pitch, °>": decimal(station.pitch_deg, 1),
    }


def plan_statements(loaded: Loaded[PlanRun], results: Results) -> Iterator[Statement]:
    """Whether a search is finished, and what went wrong in it."""
    settings, trials = loaded.report.settings, loaded.report.trials
    if loaded.report.plan is None and settings is not None:
        yield Statement(
            "problem",
            f"The search for {settings.cameras} camera poses on “{settings.source.name}” is not finished: "
            f"{len(trials)} of {settings.evaluations} trials are done.",
            f"Go on with it: `fieldkit plan --resume -o {results.path(loaded)}`",
        )
    elif broken := sum(bool(trial.failure) for trial in trials):
        yield Statement(
            "problem" if broken > 0.2 * len(trials) else "note",
            f"{broken} of {count(len(trials), 'trial')} gave no cloud.",
            "evaluations.jsonl says why, in each line's “failure”.",
        )


def mission_statements(loaded: Loaded[FlownMission], _: Results) -> Iterator[Statement]:
    """That a mission's file is not beside its record, or another than was exported."""
    mission, file = loaded.report, loaded.report.mission_file
    if not file:
        told = "only its record is here; the file that the vehicle takes is not beside it."
        yield Statement("fact", f"{mission.flight.name}: {told}")
    elif mission.changed:
        yield Statement("note", f"{file} was changed since it was exported; this report is of the file as it was.")
