"""Plans and missions: their sections, and the summary."""

from __future__ import annotations

from collections.abc import Iterator

from fieldkit.figures.content import (
    Block,
    Charts,
    Column,
    Details,
    KeyFigure,
    KeyFigures,
    Row,
    Section,
    Statement,
    Table,
    Terms,
    tabulated,
)
from fieldkit.figures.drawings import Curve, LineChart
from fieldkit.figures.style import (
    decimal,
    format_length,
    format_nominal,
    format_range,
    format_seconds,
    format_with_error,
    millimetres,
    percent,
)
from fieldkit.missions.export_record import site_frame
from fieldkit.planning.run.outcome import Outcome, best_so_far
from fieldkit.planning.settings import SearchSettings
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results
from fieldkit.report.sections.shown import Shown
from fieldkit.results.mission import Shot
from fieldkit.results.plan import Plan, Station, station_number
from fieldkit.wording import count

_FINALISTS_NOTE = (
    "Finalists are evaluated again with new random numbers: the lowest of many noisy values is partly luck. Compare "
    "values within a column only: confirmations may be at a finer quality than the search."
)
_LATER = 0.97  # quantile of the values within the curve's axis; the first random sets are often much worse


def plan_section(result: Loaded[PlanRun], anchor: str, shown: Shown) -> Section:
    """A plan's stations, and the search for them."""
    run = result.report
    blocks: list[Block] = [KeyFigures(tuple(_figures(run))), *shown.view_blocks(anchor)]
    if charts := tuple(_charts(run)):
        blocks.append(Charts(charts))
    if run.plan is not None:
        blocks.append(_stations(run.plan))
    if run.outcome is not None and run.outcome.finalists:
        blocks.append(finalist_table(run.outcome))
    if run.settings is not None:
        blocks.append(Details("What the search was asked for", (Terms(tuple(_settings(run.settings))),)))
    return Section(anchor, "Plan" if result.name == "plan" else f"Plan: {result.name}", tuple(blocks))


def mission_section(result: Loaded[FlownMission], anchor: str, shown: Shown) -> Section:
    """A mission's way over the plots."""
    mission, flight = result.report, result.report.flight
    stations, burst = flight.stations, 1 if flight.burst is None else flight.burst.photographs
    figures = [
        KeyFigure("photographs", f"{flight.photographs}"),
        KeyFigure("plots", f"{len(flight.plots)}"),
        KeyFigure("length of the way", format_length(flight.length_m), "from take-off to landing"),
        KeyFigure("time in the air", format_seconds(flight.time_s), "from take-off to landing, estimated"),
    ]
    if stations:
        heights = [station.height_m for station in stations]
        figures.append(KeyFigure("heights of photographs", format_range(heights), "above home"))
    positions = site_frame(mission.record).points(stations).tolist()
    table = tabulated("Photographs in the order they are flown", [
        {
            "photograph": f"{number}" if burst == 1 else f"{(number - 1) * burst + 1} to {number * burst}",
            "plot": station.plot,
            Column("station", True): f"{station_number(station.station)}",
            Column("east of home, m", True): decimal(east),
            Column("north of home, m", True): decimal(north),
            Column("height above home, m", True): decimal(up),
            **_angles(station),
        }
        for number, (station, (east, north, up)) in enumerate(zip(stations, positions, strict=True), 1)
    ])  # fmt: skip
    blocks: tuple[Block, ...] = (KeyFigures(tuple(figures)), *shown.view_blocks(anchor))
    blocks += (table,) if len(table.rows) <= 14 else (Details(f"All {len(stations)} photographs", (table,)),)
    return Section(anchor, f"Mission: {mission.mission_file or flight.name}", blocks)


def finalist_table(outcome: Outcome) -> Table:
    """The finalists of a search, the plan first; trials count from 1, the `number` of evaluations.jsonl from 0."""
    best = outcome.finalists[0].number if outcome.finalists else -1
    return tabulated("Finalists", [
        {
            "trial": f"{found.number + 1}{', the plan' * (found.number == best)}",
            Column("how it was proposed", short="from"): found.origin,
            Column("expected, mm", True): millimetres(found.expected_m),
            Column("in the search, mm", True, short="search, mm"): millimetres(found.search_value_m),
            Column("confirmed, mm", True): millimetres(found.value_m),
            Column("spread, mm", True, short="±, mm"): millimetres(found.spread_m),
            Column("expected after all evaluations, mm", True, short="kind, mm"): millimetres(found.kind_m),
            Column("photographs used", short="used"): ", ".join(map(str, found.right)),
        }
        for found in outcome.finalists
    ], _FINALISTS_NOTE)  # fmt: skip


def _figures(result: PlanRun) -> Iterator[KeyFigure]:
    plan, settings, outcome = result.plan, result.settings, result.outcome
    if plan is not None:
        yield KeyFigure("camera poses", f"{len(plan.stations)}")
        if plan.method is not None and plan.method.chamfer_m is not None:
            yield KeyFigure(
                "chamfer distance", format_with_error(plan.method.chamfer_m, plan.method.known_spread_m),
                "of what they reconstruct to its reference, on what the plan was made on",
            )  # fmt: skip
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


def _charts(result: PlanRun) -> Iterator[LineChart]:
    trials = result.trials
    if len(trials) < 2:
        return
    values = [(trial.number + 1.0, 1000.0 * trial.value_m if trial.measured else None) for trial in trials]
    best = [
        (trial.number + 1.0, None if b is None else 1000.0 * b)
        for trial, b in zip(trials, best_so_far(trials), strict=True)
    ]
    measured = sorted(value for _, value in values if value is not None)
    known = [value for _, value in best if value is not None]
    if measured and known:
        at = "" if result.settings is None else f" at {result.settings.confirm_fidelity}"
        value_m = None if result.outcome is None else result.outcome.chamfer_m
        confirmed = None if value_m is None else (1000.0 * value_m, f"the plan, confirmed{at}")
        first, last = (format_length(0.001 * value) for value in (known[0], known[-1]))
        described = f"The best value fell from {first} to {last} in {count(len(trials), 'trial')}."
        yield LineChart(
            "The search: every trial, and the best so far", described, "trial", "value, mm",
            (Curve("trial", tuple(values), "dots"), Curve("best so far", tuple(best), "step")),
            level=confirmed,
            y_top=1.08 * measured[min(len(measured) - 1, int(_LATER * len(measured)))],
        )  # fmt: skip


def _stations(plan: Plan) -> Table:
    axes = [Column(f"{axis}, m", True) for axis in "xyz"]
    return tabulated("Stations", [
        {
            "station": f"{station_number(number)}",
            **dict(zip(axes, map(decimal, station.position_m), strict=True)),
            **_angles(station),
        }
        for number, station in enumerate(plan.stations)
    ], "Plot frame: metres from the plot's centre on the ground; z is the height above it.")  # fmt: skip


def _angles(station: Station | Shot) -> Row:
    return {
        Column("yaw, °", True): decimal(station.yaw_deg % 360.0, 1),
        Column("pitch, °", True): decimal(station.pitch_deg, 1),
    }


def _settings(s: SearchSettings) -> Iterator[tuple[str, str]]:
    e = s.envelope
    yield "planned on", f"{s.source.kind} {s.source.name}"
    yield "method", f"{s.method} (mapping {s.mapping})"
    yield "trials", f"{s.evaluations} at {s.fidelity}, seed {s.seed}"
    yield "confirmations", f"{count(s.finalists, 'finalist')}, {s.repeats} each, at {s.confirm_fidelity}"
    low, high = map(format_nominal, e.height_m)
    yield "heights", f"{low} to {high} above the ground, within {format_nominal(e.margin_m)} of the plants' box"
    yield "distances", f"{format_nominal(e.clearance_m)} from plants, {format_nominal(e.separation_m)} between stations"
    yield "gimbal pitch", f"{e.pitch_deg[0]:g}° to {e.pitch_deg[1]:g}°".replace("-", "−")
    if s.vehicle is not None:
        yield "vehicle", s.vehicle.title
    n = s.noise
    if n.any:
        pose, wind = f"{format_nominal(n.pose_m)} and {n.pose_deg:g}°", format_nominal(n.wind_m)
        yield "planned for", f"pose errors of {pose}, image noise {n.image_grey:g}, wind {wind}"


def plan_statements(loaded: Loaded[PlanRun], results: Results) -> Iterator[Statement]:
    """The quality of a plan by its confirmations, and against the circles tried."""
    result, more = loaded.report, f"`fieldkit plan --resume --evaluations {{}} -o {results.path(loaded)}`"
    plan, settings, outcome = result.plan, result.settings, result.outcome
    where = f" on “{settings.source.name}”" if settings is not None else ""
    if plan is None:
        assert settings is not None
        yield Statement(
            "problem",
            f"The search for {settings.cameras} camera poses{where} is not finished: {len(result.trials)} of "
            f"{settings.evaluations} trials are done.",
            f"Go on with it: `fieldkit plan --resume -o {results.path(loaded)}`",
        )
        return
    text = f"The plan has {count(len(plan.stations), 'camera pose')}{where}."
    method = plan.method
    if method is not None and method.chamfer_m is not None:
        spread = ""
        if method.known_spread_m is not None:
            spread = f" (standard deviation of {method.repeats} confirmations)"
        value = format_with_error(method.chamfer_m, method.known_spread_m)
        text += f" What they reconstruct there is {value}{spread} from its reference (chamfer distance)."
    elif method is not None and method.repeats == 0:
        text += " It was not confirmed: no photograph was taken of them."
    yield Statement("fact", text)
    if settings is None:
        return
    measured = [trial for trial in result.trials if trial.measured]
    if outcome is not None and outcome.finalists and settings.method != "circle":
        circles = [trial.value_m for trial in measured if trial.origin.startswith("circle")]
        chosen = outcome.finalists[0].search_value_m
        if outcome.finalists[0].origin.startswith("circle"):
            yield Statement(
                "note", f"The plan is one of {count(len(circles), 'circle')} tried: nothing else was better.",
                f"More trials may find something: {more.format(2 * settings.evaluations)}",
            )  # fmt: skip
        elif circles and chosen:
            best = min(circles)
            better = "lower" if chosen < best else "higher"
            yield Statement(
                "good" if chosen < best else "note",
                f"At the search's own quality ({settings.fidelity}) the plan's value is {format_length(chosen)}, "
                f"{percent(abs(1 - chosen / best), 0)} % {better} than the best of {count(len(circles), 'circle')} "
                f"tried ({format_length(best)}).",
                "" if chosen < best else f"A circle does as well here; more trials: {more.format(2 * len(measured))}",
            )
    broken = sum(bool(trial.failure) for trial in result.trials)
    if broken:
        yield Statement(
            "problem" if broken > 0.2 * len(result.trials) else "note",
            f"{broken} of {count(len(result.trials), 'trial')} gave no cloud.",
            "evaluations.jsonl says why, in each line's “failure”.",
        )


def mission_statements(loaded: Loaded[FlownMission], _: Results) -> Iterator[Statement]:
    """A sentence on a mission."""
    result, flight = loaded.report, loaded.report.flight
    over = count(len(flight.plots), "plot")
    advice = ""
    if not result.mission_file:
        advice = "Only its record is here; the file that the vehicle takes is not beside it."
    elif result.changed:
        advice = f"{result.mission_file} was changed since it was exported; this is of the file as it was."
    yield Statement(
        "note" if result.changed else "fact",
        f"The mission “{flight.name}” takes {count(flight.photographs, 'photograph')} over {over} on a way of "
        f"{format_length(flight.length_m)} in {format_seconds(flight.time_s)}, from take-off to landing.",
        advice,
    )
