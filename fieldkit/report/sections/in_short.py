"""What a report begins with: the verdict, a map, what grows there, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fieldkit.campaign import Campaign
from fieldkit.campaign.overview import verdict as campaign_verdict
from fieldkit.figures.content import (
    Block,
    Details,
    Paragraph,
    Section,
    Statement,
    Statements,
    Table,
)
from fieldkit.figures.style import format_length, format_range, format_seconds, format_with_error
from fieldkit.figures.tables.scores import counted_traits, plot_cell, traits_table
from fieldkit.report.sections.demo import demo_errors, demo_statement, demo_traits
from fieldkit.report.sections.loaded import FlownMission, PlanRun, Results
from fieldkit.report.sections.plots import campaign_map, flight_map, led_to
from fieldkit.report.sections.shown import Shown
from fieldkit.results.demo import DemoReport
from fieldkit.results.evaluation import FIELD_PICTURE, EvaluationReport, PlotEvaluation, ReferenceReport
from fieldkit.results.finding import OTHER_PLANTS
from fieldkit.wording import by_key, count, listed

HEADING = "In short"
_LONG = 24  # rows of tables
_ALIKE = 4  # statements with one advice
_AFTER_REFERENCE = "Plan few views on it: `fieldkit plan --reference {} --vehicle VEHICLE -n 13 -o plan`"
_AFTER_PLAN = "Put it on your plots: `fieldkit export-mission {} --vehicle VEHICLE --site site.toml -o mission.plan`"
_AFTER_MISSION = "Look it through, then fly it: `fieldkit check-mission {} --site site.toml --vehicle VEHICLE`"
_AFTER_EVALUATION = (
    "Keep dates and plots together: `fieldkit campaign init season --plan PLAN --site site.toml --vehicle VEHICLE`"
)


def in_short(results: Results, statements: Sequence[Statement], shown: Shown) -> Section:
    """The first section of a report, of all that is said of its results: first with a map, then traits."""
    to_do = tuple(each for each in statements if each.level in ("problem", "note") and each.advice)
    grouped = tuple(_grouped(to_do))
    rest = tuple(each for each in statements if each not in grouped)
    demos = [each.report for each in results.of(DemoReport)]
    plots = {each.folder.name.removeprefix("evaluation-"): each.report.plots for each in results.of(EvaluationReport)}
    compared = [demo_statement(demo) for demo in demos]
    blocks: list[Block] = [Statements((*compared, verdict(results, statements)))]
    maps = [campaign_map(result.report, f"campaign-{k}") for k, result in enumerate(results.of(Campaign), 1)]
    for k, result in enumerate(results.of(EvaluationReport), 1):
        anchor = f"evaluation-{k}"
        maps.append(flight_map(result.report, anchor, shown.pictures(anchor).get(FIELD_PICTURE)))
    blocks += [*(drawn for drawn in maps if drawn is not None), *([] if results.of(Campaign) else shown.first_view())]
    tables: list[Block] = list(_plants(results, shown))
    if demos:
        tables = [block for demo in demos for block in (demo_errors(demo), demo_traits(demo, plots))]
    ordered = sorted(grouped, key=lambda each: each.level != "problem")
    todo: list[Block] = [Statements(tuple(ordered))] if ordered else []
    if step := next_step(results):
        todo.append(Paragraph(step))
    next_block = [Details("What to do next", tuple(todo), is_open=True)] if todo else []
    # Nobody looks for it below long tables.
    long = sum(len(each.rows) for each in tables if isinstance(each, Table)) > _LONG
    blocks += [*next_block, *tables] if long else [*tables, *next_block]
    if rest:
        blocks.append(Details("Everything that was found", (Statements(rest),)))
    return Section("summary", HEADING, tuple(blocks))


def _plants(results: Results, shown: Shown) -> Iterator[Table]:
    """What grows on the plots: of each campaign's last date and of each evaluation."""
    for result in results.of(Campaign):
        if dates := result.report.dates:
            last = [visit for visit in result.report.visits if visit.date == dates[-1]]
            yield traits_table(f"What grows there, {dates[-1]}", last)
    several = len(results.of(EvaluationReport)) > 1
    for k, evaluation in enumerate(results.of(EvaluationReport), 1):
        report = evaluation.report
        lead = led_to(report.plots, f"evaluation-{k}", shown) if report.flight is not None else plot_cell
        plots = [plot for plot in report.plots if plot.error is None or report.flight is not None]
        if any(plot.traits is not None for plot in plots):
            yield traits_table(f"Plants of {report.source}" if several else "Plants", plots, lead)


def _grouped(statements: Sequence[Statement]) -> Iterator[Statement]:
    """The first statements of every level and advice, and one with the number of the others."""
    for alike in by_key(((each.level, each.advice), each) for each in statements).values():
        yield from alike[:_ALIKE]
        if len(alike) > _ALIKE:
            more = f"The same of {len(alike) - _ALIKE} more; “Everything that was found” names them."
            yield Statement(alike[0].level, more, alike[0].advice)


def verdict(results: Results, statements: Sequence[Statement]) -> Statement:
    """Whether it worked, in a sentence."""
    problems = sum(each.level == "problem" for each in statements)
    remarks = sum(each.level == "note" and bool(each.advice) for each in statements)
    made = "; ".join(said for said, _ in _made(results))
    if problems:
        text = f"Look at {count(problems, 'problem')} below before you use these results: {made}."
        return Statement("problem", text)
    if not all(complete for _, complete in _made(results)):
        return Statement("note", f"Done in part: {made}.")
    if remarks:
        return Statement("fact", f"It worked: {made}. {count(remarks, 'remark')} below may be worth acting on.")
    return Statement("good", f"It worked: {made}. Nothing speaks against it.")


def _made(results: Results) -> Iterator[tuple[str, bool]]:
    """What there is of what was asked for, with its main figure where there is one of a kind; and whether it is all."""
    references, plans, missions = results.of(ReferenceReport), results.of(PlanRun), results.of(FlownMission)
    if references:
        right, images = (sum(getattr(each.report, name) for each in references) for name in ("right", "images"))
        yield f"{count(len(references), 'reference')} from {right} of {count(images, 'photograph')}", True
    for plan in plans[:1]:
        yield _plan(plan.report) + (f" and {count(len(plans) - 1, 'more plan')}" if len(plans) > 1 else ""), True
    if missions:
        photographs = sum(mission.report.flight.photographs for mission in missions)
        flown = f"{count(len(missions), 'mission')} of {count(photographs, 'photograph')}"
        if len(missions) == 1:
            flight = missions[0].report.flight
            flown += f" ({count(len(flight.plots), 'plot')}, {format_length(flight.length_m)}, "
            flown += f"{format_seconds(flight.time_s)})"
        yield flown, True
    plots = [plot for evaluation in results.of(EvaluationReport) for plot in evaluation.report.plots]
    if plots:
        done = [plot for plot in plots if plot.error is None]
        told, complete = f"{len(done)} of {count(len(plots), 'plot')} reconstructed", len(done) == len(plots)
        if not results.of(DemoReport):  # whose plots are methods: their range says nothing
            traits, all_known = counted_traits(done, len(plots))
            told, complete = f"{told}{_distances(done)}; {traits}", complete and all_known
        yield told, complete
    yield from (campaign_verdict(result.report) for result in results.of(Campaign))


def _plan(result: PlanRun) -> str:
    if result.plan is None:
        return "a plan in the making"
    pattern, method = result.plan.pattern, result.plan.method
    text = f"a plan of {count(len(result.plan.stations), 'view')}"
    if pattern is not None:
        text = f"a pattern of {count(len(pattern.looks), 'way')} to look"
    if method is None or method.chamfer_m is None:
        return text
    return f"{text} ({format_with_error(method.chamfer_m, method.known_spread_m)} from its reference)"


def _distances(plots: Sequence[PlotEvaluation]) -> str:
    """How far plots are from their references, measured before predicted; neither is compared with the other."""
    same = [plot for plot in plots if OTHER_PLANTS not in plot.doubts]
    measured = [plot.chamfer_m for plot in same if plot.chamfer_m is not None]
    predicted = [p.chamfer_m for plot in same if plot.chamfer_m is None and (p := plot.prediction) is not None]
    parts = [
        f"{said} {format_range(known)}"
        for values, said in ((measured, "chamfer distance"), (predicted, "predicted chamfer distance"))
        if (known := [value for value in values if value is not None])
    ]
    return f" ({listed(parts)})" if parts else ""


def next_step(results: Results) -> str:
    """The step that follows the furthest of the results; empty where none does."""
    references, plans, missions = results.of(ReferenceReport), results.of(PlanRun), results.of(FlownMission)
    if any(results.of(kind) for kind in (DemoReport, Campaign)):
        return ""
    if results.of(EvaluationReport):
        return "" if references or plans or missions else _AFTER_EVALUATION
    if missions:
        return _AFTER_MISSION.format(f"{results.path(missions[0])}/{missions[0].report.flight.file}")
    if made := next((each for each in plans if each.report.plan is not None), None):
        return _AFTER_PLAN.format(results.path(made))
    return _AFTER_REFERENCE.format(results.path(references[0])) if references and not plans else ""
