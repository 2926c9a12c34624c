"""Results as the content of one page. A new kind of result is a row of `KINDS`, and its reader in `loaded`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic

from fieldkit.campaign.reading import Campaign
from fieldkit.figures.content import Details, Page, Paragraph, Section, Statement, Terms
from fieldkit.report.sections.campaign import campaign_section, campaign_statements
from fieldkit.report.sections.captures import (
    evaluation_section,
    evaluation_statements,
    reference_section,
    reference_statements,
)
from fieldkit.report.sections.comparison import comparison_section, comparison_statements
from fieldkit.report.sections.glossary import meanings, terms_of
from fieldkit.report.sections.in_short import in_short
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results, T
from fieldkit.report.sections.photographs import add_campaign_pictures, add_photographs, overview
from fieldkit.report.sections.plan import mission_section, mission_statements, plan_section, plan_statements
from fieldkit.report.sections.provenance import provenance_section
from fieldkit.report.sections.shown import Seen, Shown
from fieldkit.report.sections.views_3d import NotedView, mission_view, plan_view, plot_views, reference_view
from fieldkit.results.comparison import ComparisonReport
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
from fieldkit.runtime.progress import Progress


@dataclass(frozen=True)
class Part(Generic[T]):
    """How a kind of result is told of."""

    noun: str
    """Its name; its sections' anchors begin with it."""
    type: type[T]
    section: Callable[[Loaded[T], str, Shown], Section]
    statements: Callable[[Loaded[T], Results], Iterable[Statement]]
    views: Callable[[Loaded[T], Results], Seen] = lambda *_: ()
    add_pictures: Callable[[Shown, str, Loaded[T], Results], None] = lambda *_: None


def _one(view: Callable[[Loaded[T], Results], NotedView]) -> Callable[[Loaded[T], Results], Seen]:
    """The only view of a result."""

    def views(loaded: Loaded[T], results: Results) -> Seen:
        yield ("", *view(loaded, results))

    return views


KINDS: tuple[Part[Any], ...] = (
    Part("reference", ReferenceReport, reference_section, reference_statements, _one(reference_view), add_photographs),
    Part("plan", PlanRun, plan_section, plan_statements, _one(plan_view)),
    Part("mission", FlownMission, mission_section, mission_statements, _one(mission_view)),
    Part("evaluation", EvaluationReport, evaluation_section, evaluation_statements, plot_views, add_photographs),
    Part("comparison", ComparisonReport, comparison_section, comparison_statements),
    Part("campaign", Campaign, campaign_section, campaign_statements, add_pictures=add_campaign_pictures),
)
"""In the order of the page."""


def build_page(
    results: Results, *, title: str, command: str, most_points: int, progress: Progress
) -> tuple[Page, Shown]:
    """The page of a report, with at most so many points in all 3D views together, and what it shows of its results."""
    shown = Shown()
    with progress.stage("Reading clouds and comparing them"):
        for kind, loaded, anchor in _each(results):
            shown.add_views(anchor, kind.views(loaded, results), partial(overview, loaded))
        shown.thin(most_points)
    with progress.stage("Reading photographs"):
        for kind, loaded, anchor in _each(results):
            kind.add_pictures(shown, anchor, loaded, results)
    sections = [kind.section(loaded, anchor, shown) for kind, loaded, anchor in _each(results)]
    head = in_short(results, summarise(results), shown)
    glossary: list[Details | Paragraph] = [
        Details("Terms that this report uses", (Terms(meanings(terms_of(results))),))
    ]
    if shown.points < shown.points_found:
        text = f"The 3D views show {shown.points:,} of {shown.points_found:,} points, drawn at random; all figures are "
        glossary.append(Paragraph(f"{text}from all points.", faint=True))
    closing = (Section("glossary", "Glossary", tuple(glossary)), provenance_section(results, command))
    name = results.root.name
    page = Page(title or f"Report: {name or 'results'}", _subtitle(results), (head, *sections, *closing))
    return page, shown


def summarise(results: Results) -> tuple[Statement, ...]:
    """The summary in words, by rules from the figures: what was done, how well, and what to do about problems.

    Sentences state only what the figures say. Nothing is called good without a measure, and advice needs a figure.
    """
    statements = [each for kind, loaded, _ in _each(results) for each in kind.statements(loaded, results)]
    statements += [
        Statement("problem", f"{each.name} is damaged and not shown: {each.message}.", each.remedy)
        for each in results.unreadable
    ]
    return tuple(statements)


def counts(results: Results) -> dict[str, int]:
    """The number of results of each kind, by noun."""
    return {kind.noun: len(results.of(kind.type)) for kind in KINDS}


def _each(results: Results) -> Iterator[tuple[Part[Any], Loaded[Any], str]]:
    for kind in KINDS:
        for number, loaded in enumerate(results.of(kind.type), 1):
            yield kind, loaded, f"{kind.noun}-{number}"


def _subtitle(results: Results) -> str:
    held = [f"{k} {noun}s" if k > 1 else f"one {noun}" for noun, k in counts(results).items() if k]
    return f"What {results.root.name or 'the folder'} holds: {', '.join(held)}."
