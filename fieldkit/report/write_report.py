"""fieldkit report: one HTML file from a folder of results."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic

from fieldkit.campaign.reading import Campaign
from fieldkit.errors import UsageError
from fieldkit.figures.content import Block, Column, Details, Page, Paragraph, Row, Section, Statement, Terms, tabulated
from fieldkit.figures.registry import FIGURES, f_score
from fieldkit.files import check_writable, write_atomic
from fieldkit.regular_files import check_replaceable
from fieldkit.report.html.document import render
from fieldkit.report.sections.campaign import campaign_section, campaign_statements
from fieldkit.report.sections.captures import (
    evaluation_section,
    evaluation_statements,
    reference_section,
    reference_statements,
)
from fieldkit.report.sections.in_short import in_short
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results, T, read_results
from fieldkit.report.sections.plan import mission_section, mission_statements, plan_section, plan_statements
from fieldkit.report.sections.shown import Seen, Shown, add_photographs
from fieldkit.report.sections.views_3d import NotedView, mission_view, plan_view, plot_views, reference_view
from fieldkit.results.demo import DemoReport
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.version import __version__

REPORT_FILE = "report.html"
POINTS = 1_000_000
"""Default limit of the points of all 3D views of a report together."""

MOST_POINTS = 10_000_000
"""Largest limit of the points of all 3D views together."""
_SUFFIXES = (".html", ".htm", "")


@dataclass(frozen=True)
class ReportSummary:
    """The written report, its size and how much it shows."""

    output: Path
    bytes: int
    references: int
    plans: int
    missions: int
    evaluations: int
    campaigns: int
    unreadable: tuple[str, ...]
    """Names of damaged results."""
    views: int
    """Of 3D views."""
    points: int
    """Of all views together."""
    points_found: int
    """Before thinning."""
    thumbnails: int


def write_report(
    folder: Path | str,
    output: Path | str | None = None,
    *,
    points: int = POINTS,
    title: str = "",
    overwrite: bool = False,
    progress: Progress | None = None,
) -> ReportSummary:
    """Write the results of a folder as one HTML file that needs no network and no other file.

    The same results give the same file, byte for byte.

    Args:
        folder: a result of fieldkit, or a folder that holds results up to two levels below. Only the report is
            written to it, if ``output`` is None.
        output: the file; None takes report.html in the folder.
        points: largest number in all 3D views together; more are thinned at random from a fixed seed.
        title: of the report; empty takes the folder's name.
        overwrite: replace an older file.

    Raises:
        UsageError: the file is not HTML by its suffix, it exists and ``overwrite`` is off, no regular file is there, or
            a number is out of range.
        MetadataError: the folder holds no result of fieldkit, or all are damaged.
        StorageError: the folder cannot be read, or the file not written.
    """
    if not 1000 <= points <= MOST_POINTS:
        raise UsageError(f"cannot show {points} points", remedy=f"Give 1000 to {MOST_POINTS}.")
    folder = Path(folder)
    output = folder / REPORT_FILE if output is None else Path(output)
    if output.suffix.lower() not in _SUFFIXES:
        raise UsageError(
            f"a report is an HTML file, not {output.suffix}",
            path=output,
            remedy=f"Give {output.with_suffix('.html').name}; for a PDF, open it in a browser and print it to a file.",
        )
    check_replaceable(output, overwrite=overwrite)
    results = read_results(folder)
    check_writable(output.parent)
    progress = progress or Silent()
    command = f"fieldkit report {results.root.name}"
    page, shown = build_page(results, title=title, command=command, most_points=points, progress=progress)
    with progress.stage("Writing the report"):
        data = render(page).encode("utf-8")
        write_atomic(output, data)
    return ReportSummary(
        output,
        len(data),
        unreadable=tuple(each.name for each in results.unreadable),
        views=shown.views,
        points=shown.points,
        points_found=shown.points_found,
        thumbnails=shown.thumbnails,
        **{f"{noun}s": number for noun, number in counts(results).items()},
    )


_SHA256 = Column("SHA-256", mono=True)
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
    Part("reference", ReferenceReport, reference_section, reference_statements, _one(reference_view)),
    Part("plan", PlanRun, plan_section, plan_statements, _one(plan_view)),
    Part("mission", FlownMission, mission_section, mission_statements, _one(mission_view)),
    Part("evaluation", EvaluationReport, evaluation_section, evaluation_statements, plot_views, add_photographs),
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
    head = in_short(results, summarise(results), shown)
    sections = [kind.section(loaded, anchor, shown) for kind, loaded, anchor in _each(results)]
    glossary: list[Details | Paragraph] = [Details("Terms that reports use", (Terms(tuple(MEANINGS.items())),))]
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
            pairs = tuple((name, json.dumps(value)) for name, value in settings.items())
            blocks.append(Details(f"Settings of {each.name}", (Terms(pairs, mono=True),)))
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
    if isinstance(report, PlanRun):
        report = report.plan or report.settings
    elif isinstance(report, FlownMission):
        report = report.record
    return {
        "input": f"{loaded.name}/{loaded.file.name}",
        "fieldkit": getattr(report, "fieldkit", None),
        _SHA256: loaded.sha256,
    }


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
