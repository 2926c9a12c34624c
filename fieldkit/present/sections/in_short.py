"""What a report begins with: the verdict, a picture or a map, what grows there, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fieldkit.present.content import Block, Details, Map, Picture, Section, Statement, Statements, Still
from fieldkit.present.sections.campaign import campaign_anchor, plot_map, traits_table
from fieldkit.present.sections.demo import demo_blocks
from fieldkit.present.sections.loaded_results import Results
from fieldkit.present.tables.scores import plant_tables
from fieldkit.wording import count, listed

HEADING = "In short"


def in_short(results: Results, statements: Sequence[Statement], pictures: Sequence[tuple[str, Picture]]) -> Section:
    """The first section of a report.

    Args:
        results: shown in it.
        statements: all that is said of them.
        pictures: stills of plots with their captions; maps of campaigns come before them.
    """
    to_do = tuple(each for each in statements if each.level in ("problem", "note") and each.advice)
    rest = tuple(each for each in statements if each not in to_do)
    blocks: list[Block] = [Statements((verdict(results, statements),))]
    for demo in results.demos:
        blocks += demo_blocks(demo)
    maps = [
        shown for k, result in enumerate(results.campaigns)
        if (shown := plot_map(result.campaign, campaign_anchor(k))) is not None
    ]  # fmt: skip
    blocks += [Map(shown) for shown in maps]
    blocks += [Still(picture, caption) for caption, picture in ([] if maps else pictures)]
    blocks += [table for result in results.campaigns if (table := traits_table(result.campaign)).rows]
    for evaluation in results.evaluations:
        blocks += plant_tables([plot for plot in evaluation.report.plots if plot.error is None])
    if to_do:
        ordered = sorted(to_do, key=lambda each: each.level != "problem")
        blocks.append(Details("What to do next", (Statements(tuple(ordered)),), is_open=True))
    if rest:
        blocks.append(Details("Everything that was found", (Statements(rest),)))
    return Section("summary", HEADING, tuple(blocks))


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
    """What there is, counted."""
    if results.references:
        yield count(len(results.references), "reference")
    for plan in results.plans[:1]:
        views = None if plan.plan is None else len(plan.plan.stations)
        more = len(results.plans) - 1
        yield (f"a plan of {count(views, 'view')}" if views else "a plan in the making") + (
            f" and {count(more, 'more plan')}" if more else ""
        )
    if results.missions:
        photographs = sum(len(mission.flight.stations) for mission in results.missions)
        yield f"{count(len(results.missions), 'mission')} of {count(photographs, 'photograph')}"
    plots = [plot for evaluation in results.evaluations for plot in evaluation.report.plots]
    if plots:
        done = sum(plot.error is None for plot in plots)
        yield f"{done} of {count(len(plots), 'capture')} reconstructed"
    for result in results.campaigns:
        visits = result.campaign.visits
        last = result.campaign.dates[-1] if visits else ""
        seen = [visit for visit in visits if visit.date == last]
        done = sum(not visit.error for visit in seen)
        yield f"{done} of {count(len(seen), 'plot')} of {last} evaluated" if seen else "a campaign without captures"
