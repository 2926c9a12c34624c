"""Do two figures differ beyond noise? Ranks and drift of a campaign's visits.

A figure's noise is half the interval that holds nine in ten repeats. Of a predicted chamfer distance the
interval is the prediction's own. Of a measured one it is 1.645 standard deviations of the plan's repeats on what it was
made on, where plan.json says them: the scatter of reconstruction, not of weather or of flights. Of a trait it is the
trait's error. Two figures differ beyond noise where they are farther apart than their half intervals, added in squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot

from fieldkit.figures.registry import FIGURES, TRENDS
from fieldkit.results.finding import OTHER_PLANTS
from fieldkit.results.plan import Plan
from fieldkit.results.visit import Visit
from fieldkit.vocabulary import NINE_IN_TEN
from fieldkit.wording import by_key


@dataclass(frozen=True)
class Ranked:
    """How good a visit is, and its place in a ranking."""

    visit: Visit
    value_m: float
    """Chamfer distance: measured, else predicted."""
    predicted: bool
    noise_m: float | None
    """Half the interval that holds nine in ten; None where it is not known."""
    rank: int = 0
    """From 1, the lowest chamfer distance of its kind first; plots that cannot be told from a group's first share its
    rank. 0 outside of a ranking."""
    tied: bool = False
    """Whether others share it."""


@dataclass(frozen=True)
class Drift:
    """How a plot's figure changed since its first date."""

    plot: str
    figure: str
    """Field of `Visit`, or of its traits."""
    first_date: str
    date: str
    """Compared."""
    first: float
    value: float
    """The figure on them."""
    beyond_noise: bool | None
    """None where the noise is not known."""

    @property
    def change(self) -> float:
        """Value less first."""
        return self.value - self.first


def score_of(visit: Visit, plan: Plan) -> Ranked | None:
    """A visit's score; None where it has none, or is of other plants than its reference's."""
    if OTHER_PLANTS in visit.doubts:
        return None
    if visit.chamfer_m is not None:
        return Ranked(visit, visit.chamfer_m, False, measured_noise_m(plan))
    if visit.predicted_chamfer_m is not None:
        return Ranked(visit, visit.predicted_chamfer_m, True, FIGURES["predicted_chamfer_m"].error(visit))
    return None


def measured_noise_m(plan: Plan) -> float | None:
    """Half the interval of a measured chamfer distance; None where the plan does not say its repeats' spread."""
    spread = None if plan.method is None else plan.method.known_spread_m
    return None if spread is None else NINE_IN_TEN * spread


def ranking(visits: Sequence[Visit], plan: Plan, date: str) -> list[Ranked]:
    """The plots of a date, the best first: those with measured distances, then those with predicted ones.

    Each kind has ranks of its own: a distance to a reference and one to the true plants are not compared. Plots whose
    score is not beyond noise of the first of their group share its rank; with unknown noise none do.
    """
    scores = [score for visit in visits if visit.date == date and (score := score_of(visit, plan)) is not None]
    ranked: list[Ranked] = []
    for predicted in (False, True):
        groups: list[list[Ranked]] = []
        own = (score for score in scores if score.predicted is predicted)
        for score in sorted(own, key=lambda score: (score.value_m, score.visit.plot)):
            first = groups[-1][0] if groups else None
            if first and _differ(first.value_m - score.value_m, first.noise_m, score.noise_m) is False:
                groups[-1].append(score)
            else:
                groups.append([score])
        rank = 1
        for group in groups:
            ranked += [replace(score, rank=rank, tied=len(group) > 1) for score in group]
            rank += len(group)
    return ranked


def _differ(difference: float, noise: float | None, other: float | None) -> bool | None:
    """Whether a difference is beyond the noise of both figures; None where one is not known."""
    return None if noise is None or other is None else abs(difference) > hypot(noise, other)


def drift(visits: Sequence[Visit], plan: Plan) -> list[Drift]:
    """Changes of every plot's figures since its first date that has them, by plot as given, figure and date.

    A chamfer distance is compared with one of its own kind only: measured with measured.
    """
    found = []
    by_plot = by_key((visit.plot, visit) for visit in sorted(visits, key=lambda visit: visit.date))
    for plot in dict.fromkeys(visit.plot for visit in visits):
        own = by_plot[plot]
        for figure in TRENDS:
            having = [(visit, value) for visit in own if (value := figure.value(visit)) is not None]
            for visit, after in having[1:]:
                first, before = having[0]
                rose = after > before  # then the first may be higher, and the last lower, than stated
                noise = figure.error_towards(first, rose), figure.error_towards(visit, not rose)
                if figure.key == "chamfer_m":
                    noise = (measured_noise_m(plan),) * 2
                surely = _differ(after - before, *noise)
                found.append(Drift(plot, figure.key, first.date, visit.date, before, after, surely))
    return found
