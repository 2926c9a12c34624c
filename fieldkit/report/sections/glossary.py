"""The glossary of a report, for readers who do not know its terms."""

from __future__ import annotations

from collections.abc import Iterable

from fieldkit.campaign.reading import Campaign
from fieldkit.figures.registry import FIGURES, Scored, f_score
from fieldkit.report.sections.loaded import FlownMission, PlanRun, Results
from fieldkit.results.comparison import ComparisonReport
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport

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
