"""Results as the content of one page. A new kind of result is a row of `KINDS`, and its reader in `loaded`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Generic

from fieldkit.campaign.reading import Campaign
from fieldkit.figures.content import Block, Column, Details, Page, Paragraph, Row, Section, Statement, Terms, tabulated
from fieldkit.figures.registry import FIGURES, Scored, f_score
from fieldkit.report.sections.campaign import campaign_section, campaign_statements
from fieldkit.report.sections.captures import (
    evaluation_section,
    evaluation_statements,
    reference_section,
    reference_statements,
)
from fieldkit.report.sections.comparison import comparison_section, comparison_statements
from fieldkit.report.sections.in_short import in_short
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results, T
from fieldkit.report.sections.plan import mission_section, mission_statements, plan_section, plan_statements
from fieldkit.report.sections.shown import Seen, Shown, add_photographs
from fieldkit.report.sections.views_3d import NotedView, mission_view, plan_view, plot_views, reference_view
from fieldkit.results.comparison import ComparisonReport
from fieldkit.results.demo import DemoReport
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
from fieldkit.results.plan import PlanSource
from fieldkit.runtime.progress import Progress
from fieldkit.version import __version__

_MOST_SETTINGS = 200
"""Most settings that are listed."""
_LONGEST = 200
"""Most letters of a setting that are shown."""
_SHA256 = Column("SHA-256", mono=True)
_OF_REFERENCES = ("right_share", "reprojection_px", "track_length", "gsd_m")

_GENERAL = {
    "registered": "A photograph whose position and direction reconstruction found, from what it shows alone or "
    "together with what was known beforehand.",
    "reference": "The cloud of a plot from many photographs, which later captures are compared with. It is a "
    "reconstruction, too, and not the truth.",
    "precision, recall": "Share of the capture's points that lie within a distance of the reference; share of the "
    "reference's points that lie within it of the capture's.",
    "F-score": f_score("0.005").meaning,
    "RMS": "Root mean square: like a mean of sizes, in which large values weigh more.",
    "residual": "How far a reconstructed camera position lies from the known one.",
    "plot frame": "Metres from the plot's centre on the ground: x east (or along the row), y north, z up.",
    "station": "A place and direction from which the plan takes one photograph.",
    "yaw, pitch": "Where a camera looks: yaw clockwise from north, pitch 0° at the horizon and −90° straight down.",
    "trial": "One set of camera poses that the search tried: photographed, reconstructed and compared with the "
    "reference.",
    "confirmation": "A further evaluation of one of the best sets, with random numbers the search had not seen: the "
    "lowest of many noisy values is partly luck.",
    "adherence": "How a flight kept to its plan: where each photograph was taken, less where it should have been.",
}
MEANINGS = _GENERAL | {figure.label: figure.meaning for figure in FIGURES.values()}
"""Meanings by term; figures by their labels."""


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
    Part("campaign", Campaign, campaign_section, campaign_statements),
)
"""In the order of the page."""


def build_page(
    results: Results, *, title: str, command: str, most_points: int, progress: Progress
) -> tuple[Page, Shown]:
    """The page of a report, with at most so many points in all 3D views together, and what it shows of its results."""
    shown = Shown()
    with progress.stage("Reading clouds and comparing them"):
        for kind, loaded, anchor in _each(results):
            shown.add_views(anchor, kind.views(loaded, results))
        shown.thin(most_points)
    with progress.stage("Reading photographs"):
        for kind, loaded, anchor in _each(results):
            kind.add_pictures(shown, anchor, loaded, results)
    sections = [kind.section(loaded, anchor, shown) for kind, loaded, anchor in _each(results)]
    head = in_short(results, summarise(results))
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


# Glossary ------------------------------------------------------------------------------------------------------------


def meanings(names: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """The meanings of terms, in the order of `MEANINGS`; KeyError for an unknown one."""
    order = {name: place for place, name in enumerate(MEANINGS)}
    return tuple((name, MEANINGS[name]) for name in sorted(set(names), key=order.__getitem__))


def terms_of(results: Results) -> set[str]:
    """The terms used in a report: those of its kinds of results, and the figures that any plot has."""
    references, plans = results.of(ReferenceReport), results.of(PlanRun)
    plots = [plot for evaluation in results.of(EvaluationReport) for plot in evaluation.report.plots]
    visits = [visit for campaign in results.of(Campaign) for visit in campaign.report.visits]
    scored: list[Scored] = [*plots, *visits]
    compared = {key for comparison in results.of(ComparisonReport) for key in comparison.report.figures}
    used = {
        figure.label
        for figure in FIGURES.values()
        if figure.key in compared or any(figure.value(each) is not None for each in scored)
    }
    terms = (
        ({"registered", "reference", "residual", "RMS", "yaw, pitch"}, references or plots),
        ({FIGURES[key].label for key in _OF_REFERENCES}, references),
        ({"precision, recall", "F-score"}, any(plot.f_score for plot in plots)),
        ({"adherence", "station"}, any(plot.adherence is not None for plot in plots)),
        ({"station", "yaw, pitch", "plot frame", "chamfer distance", "reference"}, plans),
        ({"trial", "confirmation"}, any(plan.report.settings is not None for plan in plans)),
        ({"station", "yaw, pitch"}, results.of(FlownMission)),
        ({"reference", "F-score"}, compared),
        ({"reference", "F-score", "RMS"}, results.of(Campaign)),
    )
    return used.union(*(names for names, shown in terms if shown))


# Provenance ----------------------------------------------------------------------------------------------------------


def provenance_section(results: Results, command: str) -> Section:
    """The results that a report was made from, and the command that made it."""
    shown = [each for each in results.found if not isinstance(each.report, DemoReport)]
    # The flights of a mission have one file.
    inputs = {each.file: _input(each) for each in shown}
    blocks: list[Block] = [
        Terms((("this report", f"fieldkit {__version__}"), ("command", command)), mono=True),
        tabulated("Inputs of this report", list(inputs.values())),
    ]
    for each in shown:
        if (settings := _settings(each.report)) is not None:
            flat = tuple(_flat(settings))[:_MOST_SETTINGS] or (("settings", "none are given"),)
            blocks.append(Details(f"Settings of {each.name}", (Terms(flat, mono=True),)))
    blocks.append(
        Paragraph(
            "The SHA-256 of a file changes with any change to it: compare it with `sha256sum FILE`. The same inputs, "
            "settings and seed give the same result on the same machine and version.",
            faint=True,
        )
    )
    return Section("provenance", "Provenance", (Details("Versions, settings and hashes", tuple(blocks)),))


def _input(loaded: Loaded[Any]) -> Row:
    report = loaded.report
    written: Any = report
    match report:
        case ReferenceReport():
            made = f"“{report.source}”"
        case EvaluationReport():
            against = report.reference_sha256
            made = f"“{report.source}”, {f'reference {_short(against)}' if against else 'no reference'}"
        case PlanRun():
            written = report.plan or report.settings
            made = _planned_on(getattr(written, "source", None))
        case ComparisonReport():
            made = ", ".join(f"“{each.label}”" for each in report.evaluations)
        case FlownMission():
            written, made = report.record, ""
        case _:
            made = ""
    seed = (_settings(report) or {}).get("seed")
    return {
        "input": f"{loaded.name}/{loaded.file.name}",
        "fieldkit": getattr(written, "fieldkit", None),
        Column("seed", True): str(seed) if isinstance(seed, int) and not isinstance(seed, bool) else None,
        "made from": made or None,
        _SHA256: loaded.sha256,
    }


def _planned_on(source: PlanSource | None) -> str:
    if source is None:
        return ""
    return f"{source.kind} “{source.name}”" + (f", {_short(source.sha256)}" if source.sha256 else "")


def _short(sha256: str) -> str:
    return f"{sha256[:12]}…"


def _settings(report: Any) -> Mapping[str, Any] | None:
    """The settings that a result was made with; None where it has none."""
    match report:
        case ReferenceReport() | EvaluationReport():
            return report.settings
        case PlanRun():
            return None if report.settings is None else report.settings.model_dump(mode="json")
        case Campaign():
            return report.evaluation.model_dump(mode="json")
    return None


def _flat(value: Any, key: str = "", depth: int = 0) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value and depth < 6:
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}" if key else str(name), depth + 1)
        return
    text = "none" if value is None else str(value)
    yield key, text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
