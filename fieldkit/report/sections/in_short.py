"""What a report begins with: the verdict, a picture or a map, what grows there, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fieldkit.campaign import Campaign, Visit
from fieldkit.figures.content import Block, Details, Paragraph, Picture, Section, Statement, Statements, Still, Table
from fieldkit.figures.registry import FIGURES
from fieldkit.figures.style import format_length, format_range, format_seconds, format_with_error
from fieldkit.figures.tables.comparison import difference_table, leading_figures
from fieldkit.figures.tables.scores import plant_tables
from fieldkit.report.sections.campaign import campaign_anchor, plot_map, traits_table
from fieldkit.report.sections.comparison import noise_counts
from fieldkit.report.sections.demo import demo_blocks, demo_statements
from fieldkit.report.sections.loaded import FlownMission, PlanRun, Results
from fieldkit.results.comparison import ComparisonReport
from fieldkit.results.demo import DemoReport
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation, ReferenceReport
from fieldkit.results.finding import OTHER_PLANTS
from fieldkit.wording import count, listed

HEADING = "In short"
_LONG = 24  # rows of tables
_ALIKE = 4  # statements with one advice
_AFTER_REFERENCE = "Plan few views on it: fieldkit plan with this folder, and -o for the plan's."
_AFTER_PLAN = (
    "Put the plan on your plots: fieldkit export-mission with --plan, --site and --vehicle writes the file to fly."
)
_AFTER_MISSION = (
    "Look through it with fieldkit check-mission, load it with fieldkit upload or the vehicle's own program, fly it. "
    "Before you leave the field, give the photographs to fieldkit check."
)
_AFTER_EVALUATION = "Several dates or plots: fieldkit campaign init keeps them together, with a map and traits.csv."


def in_short(results: Results, statements: Sequence[Statement], pictures: Sequence[tuple[str, Picture]]) -> Section:
    """The first section of a report, of all that is said of its results; maps of campaigns come before pictures."""
    to_do = tuple(each for each in statements if each.level in ("problem", "note") and each.advice)
    grouped = tuple(_grouped(to_do))
    rest = tuple(each for each in statements if each not in grouped)
    demos = [each.report for each in results.of(DemoReport)]
    compared = [each for demo in demos for each in demo_statements(demo)]
    blocks: list[Block] = [Statements((*compared, verdict(results, statements)))]
    blocks += [block for demo in demos for block in demo_blocks(demo)]
    maps = [
        shown for k, result in enumerate(results.of(Campaign))
        if (shown := plot_map(result.report, campaign_anchor(k))) is not None
    ]  # fmt: skip
    blocks += maps
    blocks += [Still(picture, caption) for caption, picture in ([] if maps else pictures)]
    tables = list(_plants(results))
    ordered = sorted(grouped, key=lambda each: each.level != "problem")
    todo: list[Block] = [Statements(tuple(ordered))] if ordered else []
    if step := next_step(results):
        todo.append(Paragraph(step))
    next_block = [Details("What to do next", tuple(todo), is_open=True)] if todo else []
    # Nobody looks for it below long tables.
    long = sum(len(table.rows) for table in tables) > _LONG
    blocks += [*next_block, *tables] if long else [*tables, *next_block]
    if rest:
        blocks.append(Details("Everything that was found", (Statements(rest),)))
    return Section("summary", HEADING, tuple(blocks))


def _plants(results: Results) -> Iterator[Table]:
    """What grows on the plots: of each campaign's last date and of each evaluation; leading figures of comparisons."""
    for result in results.of(Campaign):
        if dates := result.report.dates:
            yield traits_table(result.report, dates[-1])
    for comparison in results.of(ComparisonReport):
        for figure in leading_figures(comparison.report):
            if (table := difference_table(comparison.report, figure)).rows:
                yield table
    several = len(results.of(EvaluationReport)) > 1
    for evaluation in results.of(EvaluationReport):
        plots = [plot for plot in evaluation.report.plots if plot.error is None]
        yield from plant_tables(plots, evaluation.report.source if several else "")


def _grouped(statements: Sequence[Statement]) -> Iterator[Statement]:
    """The first statements of every level and advice, and one with the number of the others."""
    groups: dict[tuple[str, str], list[Statement]] = {}
    for each in statements:
        groups.setdefault((each.level, each.advice), []).append(each)
    for alike in groups.values():
        yield from alike[:_ALIKE]
        if len(alike) > _ALIKE:
            more = f"The same of {len(alike) - _ALIKE} more; “Everything that was found” names them."
            yield Statement(alike[0].level, more, alike[0].advice)


def verdict(results: Results, statements: Sequence[Statement]) -> Statement:
    """Whether it worked, in a sentence."""
    problems = sum(each.level == "problem" for each in statements)
    remarks = sum(each.level == "note" and bool(each.advice) for each in statements)
    made = listed(list(_made(results)))
    if problems:
        text = f"Look at {count(problems, 'problem')} below before you use these results: {made}."
        return Statement("problem", text)
    if remarks:
        return Statement("fact", f"It worked: {made}. {count(remarks, 'remark')} below may be worth acting on.")
    return Statement("good", f"It worked: {made}. Nothing speaks against it.")


def _made(results: Results) -> Iterator[str]:
    """What there is, counted, with its main figure where there is one of a kind."""
    references, plans, missions = results.of(ReferenceReport), results.of(PlanRun), results.of(FlownMission)
    if references:
        right, images = (sum(getattr(each.report, name) for each in references) for name in ("right", "images"))
        yield f"{count(len(references), 'reference')} from {right} of {count(images, 'photograph')}"
    for plan in plans[:1]:
        yield _plan(plan.report) + (f" and {count(len(plans) - 1, 'more plan')}" if len(plans) > 1 else "")
    if missions:
        photographs = sum(mission.report.flight.photographs for mission in missions)
        flown = f"{count(len(missions), 'mission')} of {count(photographs, 'photograph')}"
        if len(missions) == 1:
            flight = missions[0].report.flight
            flown += f" ({count(len(flight.plots), 'plot')}, {format_length(flight.length_m)}, "
            flown += f"{format_seconds(flight.time_s)})"
        yield flown
    plots = [plot for evaluation in results.of(EvaluationReport) for plot in evaluation.report.plots]
    if plots:
        done = [plot for plot in plots if plot.error is None]
        # The demo's plots are methods, whose range says nothing.
        figures = "" if results.of(DemoReport) else _distances(done)
        yield f"{len(done)} of {count(len(plots), 'capture')} reconstructed{figures}"
    for comparison in results.of(ComparisonReport):
        beyond, within, _ = noise_counts(comparison.report)
        said = f" ({beyond} of {count(beyond + within, 'difference')} beyond noise)" if beyond + within else ""
        yield f"a comparison of {count(len(comparison.report.evaluations), 'evaluation')}{said}"
    for result in results.of(Campaign):
        visits = result.report.visits
        last = result.report.dates[-1] if visits else ""
        seen = [visit for visit in visits if visit.date == last]
        evaluated = [visit for visit in seen if not visit.error]
        told = f"{len(evaluated)} of {count(len(seen), 'plot')} of {last} evaluated{_grown(evaluated)}"
        yield told if seen else "a campaign without captures"


def _plan(result: PlanRun) -> str:
    if result.plan is None:
        return "a plan in the making"
    text, method = f"a plan of {count(len(result.plan.stations), 'view')}", result.plan.method
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


def _grown(visits: Sequence[Visit]) -> str:
    """Heights and cover of plots, from the least to the greatest."""
    parts = []
    for figure in (FIGURES["height_m"], FIGURES["cover_percent"]):
        known = [value for visit in visits if (value := figure.value(visit)) is not None]
        ends = list(dict.fromkeys(figure.number(value) for value in (min(known), max(known)))) if known else []
        some = f" on {len(known)} of {count(len(visits), 'plot')}" if len(known) < len(visits) else ""
        parts += [f"{figure.label} {' to '.join(map(str, ends))} {figure.unit}{some}"] if ends else []
    return f" ({', '.join(parts)})" if parts else ""


def next_step(results: Results) -> str:
    """The step that follows the furthest of the results; empty where none does."""
    references, plans, missions = results.of(ReferenceReport), results.of(PlanRun), results.of(FlownMission)
    if any(results.of(kind) for kind in (DemoReport, Campaign)):
        return ""
    if results.of(EvaluationReport):
        return "" if references or plans or missions else _AFTER_EVALUATION
    if missions:
        return _AFTER_MISSION
    if any(each.report.plan is not None for each in plans):
        return _AFTER_PLAN
    return _AFTER_REFERENCE if references and not plans else ""
