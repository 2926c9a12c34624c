"""Results as the content of one page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from fieldkit.campaign.visits import visit_cloud
from fieldkit.clouds import read_cloud
from fieldkit.errors import FieldkitError
from fieldkit.figures.content import Details, Page, Paragraph, Picture, Section, Terms, View
from fieldkit.figures.drawings import ViewerScene
from fieldkit.figures.registry import FIGURES, Scored
from fieldkit.figures.tables.reconstruction import was_used
from fieldkit.report.sections.campaign import campaign_anchor, campaign_section
from fieldkit.report.sections.comparison import comparison_section
from fieldkit.report.sections.evaluation import evaluation_section
from fieldkit.report.sections.glossary import meanings
from fieldkit.report.sections.in_short import in_short
from fieldkit.report.sections.loaded_results import CampaignResult, EvaluationResult, ReferenceResult, Results
from fieldkit.report.sections.photographs import find_photographs, thumbnails
from fieldkit.report.sections.plan import mission_section, plan_section
from fieldkit.report.sections.provenance import provenance_section
from fieldkit.report.sections.reconstruction import Pictures
from fieldkit.report.sections.reference import reference_section
from fieldkit.report.sections.stills import cloud_still, still
from fieldkit.report.sections.summary import summarise
from fieldkit.report.sections.views_3d import (
    MOST_VIEWS_OF_PLOTS,
    mission_view,
    plan_view,
    plot_view,
    points_of,
    reference_view,
    within_budget,
)
from fieldkit.results.evaluation import PlotEvaluation, ReconstructionEntry
from fieldkit.runtime.progress import Progress

MOST_THUMBNAILS = 300
"""Largest number of a report's thumbnails, about 2 MB."""

_OF_REFERENCES = ("right_share", "reprojection_px", "track_length", "gsd_m")
_MOST_PICTURES = 2
"""Largest number of stills that a report begins with."""

MOST_VIEWS = 10
"""Largest number of a report's views: browsers keep at most sixteen alive."""


@dataclass(frozen=True)
class Built:
    """A page with its numbers.

    Attributes:
        page: its content.
        points: of all 3D views together.
        points_found: number of points before thinning.
        thumbnails: number of photographs shown.
        views: number of 3D views.
    """

    page: Page
    points: int
    points_found: int
    thumbnails: int
    views: int


def build_page(results: Results, *, title: str, command: str, most_points: int, progress: Progress) -> Built:
    """The page of a report, in the order reference, plan, mission, evaluation, comparison, campaign.

    Args:
        results: found and read.
        title: of the page; empty takes the folder's name.
        command: the command that makes the report.
        most_points: largest number of points of all 3D views together.
        progress: receives the stages.
    """
    with progress.stage("Reading clouds and comparing them"):
        found = _Views(results)
        found_points = points_of(found.scenes)
        found.scenes = within_budget(found.scenes, most_points)
    with progress.stage("Reading photographs"):
        pictures = _Pictures(results)
    sections = list(_sections(results, found, pictures))
    head = in_short(results, summarise(results), list(found.pictures()))
    glossary = Details("Terms that this report uses", (Terms(meanings(_used(results))),))
    closing = [Section("glossary", "Glossary", (glossary,)), provenance_section(results, command)]
    shown = points_of(found.scenes)
    if shown < found_points:
        text = (
            f"The 3D views show {shown:,} of {found_points:,} points, drawn at random; all figures are from all points."
        )
        closing[0] = Section("glossary", "Glossary", (glossary, Paragraph(text, faint=True)))
    page = Page(title or f"Report: {results.root.name or 'results'}", _subtitle(results), (head, *sections, *closing))
    return Built(page, shown, found_points, pictures.count, len(found.scenes))


class _Views:
    """The 3D views of results, by their kind and place."""

    def __init__(self, results: Results) -> None:
        self.scenes: list[ViewerScene] = []
        self._places: dict[tuple[str, int, str], int] = {}
        self._notes: dict[tuple[str, int, str], str] = {}
        self._stills: dict[int, Picture | None] = {}
        for k, reference in enumerate(results.references):
            self._add(("reference", k, ""), *reference_view(reference))
        for k, plan in enumerate(results.plans):
            self._add(("plan", k, ""), *plan_view(plan, results))
        for k, mission in enumerate(results.missions):
            if len(self.scenes) < MOST_VIEWS:
                self._add(("mission", k, ""), mission_view(mission, results), "")
        for k, evaluation in enumerate(results.evaluations):
            for plot in _farthest(evaluation):
                if len(self.scenes) < MOST_VIEWS:
                    self._add(("evaluation", k, plot.name), *plot_view(evaluation, plot, results))

    def _add(self, key: tuple[str, int, str], scene: ViewerScene | None, note: str) -> None:
        self._notes[key] = note
        if scene is not None and len(self.scenes) < MOST_VIEWS:
            self._places[key] = len(self.scenes)
            self.scenes.append(scene)

    def view(self, kind: str, number: int, plot: str = "") -> tuple[View | None, str]:
        """A result's view, or the reason why it has none."""
        key = (kind, number, plot)
        note = self._notes.get(key, "")
        place = self._places.get(key)
        if place is None:
            return None, note
        return View(f"view-{place + 1}", self.scenes[place], note, self._still(place)), note

    def pictures(self) -> Iterator[tuple[str, Picture]]:
        """Stills of evaluated plots with their captions; without any, of references, plans and missions."""
        for kind in ("evaluation", "reference", "plan", "mission"):
            places = [place for (of, _, _), place in self._places.items() if of == kind][:_MOST_PICTURES]
            found = [(self.scenes[place].title, picture) for place in places if (picture := self._still(place))]
            if found:
                yield from found
                return

    def _still(self, place: int) -> Picture | None:
        if place not in self._stills:
            self._stills[place] = still(self.scenes[place])
        return self._stills[place]


class _Pictures:
    """Thumbnails of results' photographs."""

    def __init__(self, results: Results) -> None:
        self.count = 0
        self.references = [self._of(r, r.report, (r.report.source,), results) for r in results.references]
        self.evaluations: list[Mapping[str, Pictures]] = []
        for e in results.evaluations:
            by_plot = {}
            for plot in e.report.plots:
                sources = (f"{e.report.source}/{plot.name}", e.report.source)
                by_plot[plot.name] = self._of(e, plot, sources if len(e.report.plots) == 1 else sources[:1], results)
            self.evaluations.append(by_plot)
        self.campaigns = [self._plots(result) for result in results.campaigns]

    def _plots(self, result: CampaignResult) -> Mapping[str, Picture]:
        """Stills of the plots' last clouds."""
        campaign = result.campaign
        found: dict[str, Picture] = {}
        for visit in sorted(campaign.visits, key=lambda visit: visit.date, reverse=True):
            if visit.plot in found or self.count >= MOST_THUMBNAILS:
                continue
            try:
                file = visit_cloud(result.folder, visit)
                cloud = None if file is None else read_cloud(file)
            except (FieldkitError, OSError):
                continue
            if cloud is not None and (picture := cloud_still(cloud, visit.plot)) is not None:
                found[visit.plot] = picture
                self.count += 1
        return found

    def _of(
        self, result: ReferenceResult | EvaluationResult, report: ReconstructionEntry, sources: tuple[str, ...],
        results: Results,
    ) -> Pictures:  # fmt: skip
        names = [image.name for image in report.image_reports]
        for source in sources:
            folder = find_photographs(source, names, result.folder, results.root)
            if folder is not None:
                # Unused photographs first: people look for them.
                bad_first = sorted(report.image_reports, key=was_used)
                found = thumbnails(folder, [i.name for i in bad_first], MOST_THUMBNAILS - self.count)
                self.count += len(found)
                return found
        return {}


def _sections(results: Results, views: _Views, pictures: _Pictures) -> Iterator[Section]:
    for k, reference in enumerate(results.references):
        view, note = views.view("reference", k)
        yield reference_section(reference, f"reference-{k + 1}", view, note, pictures.references[k])
    for k, plan in enumerate(results.plans):
        yield plan_section(plan, f"plan-{k + 1}", *views.view("plan", k))
    for k, mission in enumerate(results.missions):
        yield mission_section(mission, f"mission-{k + 1}", views.view("mission", k)[0])
    for k, evaluation in enumerate(results.evaluations):
        by_plot = {plot.name: views.view("evaluation", k, plot.name) for plot in evaluation.report.plots}
        yield evaluation_section(evaluation, f"evaluation-{k + 1}", by_plot, pictures.evaluations[k])
    for k, comparison in enumerate(results.comparisons):
        yield comparison_section(comparison, f"comparison-{k + 1}")
    for k, campaign in enumerate(results.campaigns):
        yield campaign_section(campaign, campaign_anchor(k), pictures.campaigns[k])


def _farthest(result: EvaluationResult) -> list[PlotEvaluation]:
    """The plots shown in 3D: all if they are few, else those with the greatest distances."""
    plots = [plot for plot in result.report.plots if plot.error is None]
    if len(plots) <= MOST_VIEWS_OF_PLOTS:
        return plots
    return sorted(plots, key=lambda plot: -(plot.chamfer_m or 0.0))[:MOST_VIEWS_OF_PLOTS]


def _subtitle(results: Results) -> str:
    kinds = (
        ("reference", results.references), ("plan", results.plans), ("mission", results.missions),
        ("evaluation", results.evaluations), ("comparison", results.comparisons), ("campaign", results.campaigns),
    )  # fmt: skip
    held = [f"{len(found)} {noun}s" if len(found) > 1 else f"one {noun}" for noun, found in kinds if found]
    return f"What {results.root.name or 'the folder'} holds: {', '.join(held)}."


def _used(results: Results) -> set[str]:
    """The terms used in a report: those of its kinds of results, and the figures that any plot has."""
    plots = [plot for evaluation in results.evaluations for plot in evaluation.report.plots]
    visits = [visit for campaign in results.campaigns for visit in campaign.campaign.visits]
    scored: list[Scored] = [*plots, *visits]
    compared = {key for comparison in results.comparisons for key in comparison.report.figures}
    used = {
        figure.label
        for figure in FIGURES.values()
        if figure.key in compared or any(figure.value(each) is not None for each in scored)
    }
    terms = (
        ({"registered", "reference", "residual", "RMS", "yaw, pitch"}, results.references or results.evaluations),
        ({FIGURES[key].label for key in _OF_REFERENCES}, results.references),
        ({"precision, recall", "F-score"}, any(plot.f_score for plot in plots)),
        ({"adherence", "station"}, any(plot.adherence is not None for plot in plots)),
        ({"station", "yaw, pitch", "plot frame", "chamfer distance", "reference"}, results.plans),
        ({"trial", "confirmation"}, any(plan.settings is not None for plan in results.plans)),
        ({"station", "yaw, pitch"}, results.missions),
        ({"reference", "F-score"}, results.comparisons),
        ({"reference", "F-score", "RMS"}, results.campaigns),
    )
    return used.union(*(names for names, shown in terms if shown))
