"""Plots side by side: a map coloured by a figure of choice, and where the page tells of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from fieldkit.campaign.reading import Campaign
from fieldkit.figures.content import (
    MOST_ROWS,
    Corner,
    Link,
    MappedPlot,
    Measure,
    Picture,
    PlotMap,
    Row,
)
from fieldkit.figures.registry import TRENDS, Figure, Scored
from fieldkit.figures.tables.scores import error_of, name_of
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.report.sections.shown import Shown
from fieldkit.results.evaluation import EvaluationReport
from fieldkit.wording import by_key

FOLLOWED = sorted(TRENDS, key=lambda figure: figure.group != "trait")
"""Figures of maps and charts: what grows comes first."""
_FARTHEST_M = 200_000.0
"""Distance from the first plot beyond which no map is drawn, metres."""
_MOST_VISITS = 2000
"""Most visits that are told of one by one."""


def plot_anchors(plots: Iterable[Scored], anchor: str, dates: int = 1) -> dict[str, str]:
    """The place on the page that tells of each plot, by name, in their order; there are so many dates of each."""
    names = list(dict.fromkeys(map(name_of, plots)))[: min(MOST_ROWS, _MOST_VISITS // max(1, dates))]
    return {name: f"{anchor}-plot-{number}" for number, name in enumerate(names, 1)}


def campaign_map(campaign: Campaign, anchor: str) -> PlotMap | None:
    """The plots of a campaign on every date; None without visits, or if they lie too far apart."""
    rings = {}
    for plot in campaign.plots:
        corners = plot.shape or ((plot.latitude_deg, plot.longitude_deg),)
        frame = LocalFrame(campaign.plots[0].latitude_deg, campaign.plots[0].longitude_deg, 0.0, "unknown")
        latitude, longitude = zip(*corners, strict=True)
        rings[plot.name] = frame.to_local(latitude, longitude, [0.0] * len(corners))[:, :2].tolist()
    days = by_key((visit.date, visit) for visit in campaign.visits)
    anchors = plot_anchors(campaign.visits, anchor, len(days))
    return _map(f"The plots of {campaign.name}", rings, dict(sorted(days.items())), anchors, anchor)


def flight_map(report: EvaluationReport, anchor: str, picture: Picture | None) -> PlotMap | None:
    """The plots of a flight, over a picture of the field where there is one; None of other evaluations."""
    frame = next((plot.frame for plot in report.plots if plot.frame is not None), None)
    if report.flight is None or frame is None:
        return None
    turn = np.array(frame.plot_from_source)[:2, :2]
    rings = {plot.name: (np.array(plot.outline) @ turn).tolist() for plot in report.plots if plot.outline}
    corners = np.array(report.flight.picture)
    beneath = (picture, tuple(map(tuple, (corners @ turn).tolist()))) if picture and len(corners) == 4 else None
    anchors = plot_anchors(report.plots, anchor)
    return _map(f"The plots of {report.source}", rings, {"": report.plots}, anchors, anchor, beneath)


def _map(
    title: str,
    rings: Mapping[str, Sequence[Sequence[float]]],
    days: Mapping[str, Sequence[Scored]],
    anchors: Mapping[str, str],
    identifier: str,
    beneath: tuple[Picture, tuple[Corner, ...]] | None = None,
) -> PlotMap | None:
    """Plots by name coloured by a figure of choice; None without figures, or if they lie too far apart.

    Measured and predicted distances have scales of their own: one is not the other.
    """
    measures = [measure for figure in FOLLOWED if (measure := _measure(days, figure)) is not None]
    if not rings or not measures or np.ptp(np.concatenate(list(rings.values())), axis=0).max() > _FARTHEST_M:
        return None
    measures.sort(key=lambda measure: -sum(map(len, measure.values.values())))  # the one with most values comes first
    plots = tuple(MappedPlot(name, tuple((x, y) for x, y in ring)) for name, ring in rings.items())
    return PlotMap(title, plots, tuple(measures), anchors, identifier, beneath)


def _measure(days: Mapping[str, Sequence[Scored]], figure: Figure) -> Measure | None:
    """A figure by date and plot; None where no plot has it."""
    values: dict[str, dict[str, float]] = {day: {} for day in days}
    notes: dict[str, dict[str, str]] = {day: {} for day in days}
    for day, plot in ((day, plot) for day, plots in days.items() for plot in plots):
        if (value := figure.shown(plot)) is None:
            notes[day][name_of(plot)] = error_of(plot) or f"no {figure.label}"
        else:
            values[day][name_of(plot)] = value
    return Measure(figure.label, figure.unit, values, notes, figure.ramp) if any(values.values()) else None


def led_to(plots: Sequence[Scored], anchor: str, shown: Shown) -> Callable[[Scored], Row]:
    """What rows of a flight's plots begin with: a name that the map leads to and that leads on, and a photograph."""
    anchors = plot_anchors(plots, anchor)

    def lead(plot: Scored) -> Row:
        name = name_of(plot)
        link = Link(name, f"{anchors[name]}-more", anchors[name]) if name in anchors else name
        return {"plot": link, "photograph": next(iter(shown.pictures(anchor, name).values()), None)}

    return lead
