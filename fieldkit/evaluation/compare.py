"""Do two figures differ beyond noise? Comparisons of several evaluations; ranks and drift of a campaign's visits.

A comparison knows noise from repeats, the scatter within labels that have several evaluations; else from what the
benchmark found between flights, the errors of traits and the intervals of predictions. Where neither says it, it is not
guessed.

Of visits a figure's noise is half the interval that holds nine in ten repeats. Of a predicted chamfer distance the
interval is the prediction's own. Of a measured one it is 1.645 standard deviations of the plan's repeats on what it was
made on, where plan.json says them: the scatter of reconstruction, not of weather or of flights. Of a trait it is the
trait's error. Two figures differ beyond noise where they are farther apart than their half intervals, added in squares.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot
from pathlib import Path

import numpy as np
from scipy.special import stdtrit

from fieldkit.errors import UsageError
from fieldkit.figures.registry import FIGURES, TRENDS, Figure, figures_of
from fieldkit.figures.spreadsheets import compare_csv
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.results.comparison import (
    COMPARE_FILE,
    ComparedEvaluation,
    ComparisonReport,
    DifferenceEntry,
    NoiseSource,
    ValueEntry,
)
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation, pooled_spread
from fieldkit.results.finding import OTHER_PLANTS
from fieldkit.results.plan import Plan
from fieldkit.results.report_files import load_evaluation_report
from fieldkit.results.visit import Visit
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.version import __version__
from fieldkit.vocabulary import NINE_IN_TEN
from fieldkit.wording import by_key, listed

TABLE_FILE = "compare.csv"
_NORMAL_95 = 1.959964
"""Standard deviations within which 95 % of normal differences lie."""
_LARGEST = 1e12  # numbers of hostile files
_NAMED = 5
"""Most plots that are named."""


@dataclass(frozen=True, eq=False)
class Labelled:
    """One evaluation as read."""

    label: str
    report: EvaluationReport
    plots: Mapping[str, PlotEvaluation]


@dataclass(frozen=True)
class Comparison:
    """What was compared."""

    report: ComparisonReport
    """Values, differences and what is said of them; what compare.json holds."""
    output: Path | None
    """Folder with compare.json and compare.csv; None where nothing was to be written."""


def compare_evaluations(
    evaluations: Sequence[Path | str],
    output: Path | str | None = None,
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Compare evaluations plot by plot, each with the first and with the one before it.

    A difference is beyond noise where its 95 % interval leaves 0 out.

    Args:
        evaluations: folders or evaluation.json in the order of their dates, each with a label before it where one is
            wanted (``"LABEL=PATH"``); those of one label repeat one another.
        output: folder to write; None writes nothing.
        overwrite: replace an earlier comparison in ``output``.

    Raises:
        UsageError: there is nothing to compare, or ``output`` exists.
        MetadataError: an evaluation cannot be used.
        StorageError: ``output`` cannot be written.
    """
    if isinstance(evaluations, str | Path):
        evaluations = [evaluations]
    runs = _read(evaluations)
    if len({run.label for run in runs}) < 2:
        raise UsageError("there is nothing to compare", remedy="Give two evaluations or more, of different labels.")
    with (progress or Silent()).stage("Comparing"):
        report = comparison_of(runs)
    if output is None:
        return Comparison(report, None)
    output = Path(output)
    with atomic_folder(output, overwrite=overwrite, marker=COMPARE_FILE) as folder:
        write_atomic(folder / TABLE_FILE, compare_csv(report))
        write_atomic(folder / COMPARE_FILE, report.model_dump_json(indent=2) + "\n")
    return Comparison(report, output)


def comparison_of(runs: Sequence[Labelled]) -> ComparisonReport:
    """All values and differences of evaluations, in order."""
    by_label = by_key((run.label, run) for run in runs)
    labels = list(by_label)
    references = {run.report.reference_sha256 for run in runs}
    scored = len(references) == 1 and None not in references
    distances = [d for d in runs[0].report.distances_m if all(d in run.report.distances_m for run in runs)]
    figures = figures_of("distance" if scored else "prediction", "trait", "reconstruction", distances_m=distances)
    names = list(dict.fromkeys(name for run in runs for name in run.plots))
    values: list[ValueEntry] = []
    differences: list[DifferenceEntry] = []
    for name in names:
        plots = {label: [run.plots[name] for run in by_label[label] if name in run.plots] for label in labels}
        for figure in figures:
            found = {label: _numbers(figure, plots[label]) for label in labels}
            values += [
                ValueEntry(
                    plot=name,
                    figure=figure.key,
                    label=label,
                    value=float(np.mean(numbers)),
                    repeats=len(numbers),
                    spread=float(np.std(numbers, ddof=1)) if len(numbers) > 1 else None,
                )
                for label, numbers in found.items()
                if numbers
            ]
            differences += [
                _difference(name, figure, label, less, found, plots)
                for label, less in _pairs(labels)
                if found[label] and found[less]
            ]
    present = {value.figure for value in values}
    notes = [*_what_differs(runs, by_label, names, scored), *_what_is_untold(differences)]
    return ComparisonReport(
        fieldkit=__version__,
        evaluations=tuple(
            ComparedEvaluation(
                label=label,
                sources=tuple(run.report.source for run in own),
                reference_sha256=_only({run.report.reference_sha256 for run in own}),
                plots=tuple(dict.fromkeys(name for run in own for name in run.plots)),
            )
            for label, own in by_label.items()
        ),
        figures=tuple(figure.key for figure in figures if figure.key in present),
        values=tuple(values),
        differences=tuple(differences),
        notes=tuple(dict.fromkeys(notes)),
    )


def _read(evaluations: Sequence[Path | str]) -> list[Labelled]:
    runs: list[Labelled] = []
    taken: set[str] = set()
    for each in evaluations:
        label, path = _labelled(each)
        report = load_evaluation_report(path)
        folder = path if path.is_dir() else path.parent
        if not label:
            name = folder.absolute().name or "evaluation"
            numbered = (name, *(f"{name} {k}" for k in range(2, len(evaluations) + 2)))
            label = next(each for each in numbered if each not in taken)
        taken.add(label)
        runs.append(Labelled(label, report, {plot.name: plot for plot in report.plots}))
    return runs


def _labelled(text: Path | str) -> tuple[str, Path]:
    if isinstance(text, Path) or Path(text).exists():
        return "", Path(text)
    label, equals, path = text.partition("=")
    if not equals or "/" in label or not label.strip():
        return "", Path(text)
    return label.strip(), Path(path)


def _pairs(labels: Sequence[str]) -> list[tuple[str, str]]:
    """Each label with the first, then with the one before it."""
    first = [(label, labels[0]) for label in labels[1:]]
    return [*first, *((label, before) for before, label in pairwise(labels) if before != labels[0])]


def _numbers(figure: Figure, plots: Sequence[PlotEvaluation]) -> list[float]:
    """A figure's values, one per repeat; without those of failures, distances to other plants and senseless numbers."""
    found = [
        figure.value(plot)
        for plot in plots
        if plot.error is None and not (figure.group == "distance" and OTHER_PLANTS in plot.doubts)
    ]
    return [float(value) for value in found if value is not None and abs(value) <= _LARGEST]


def _difference(
    plot: str,
    figure: Figure,
    label: str,
    less: str,
    found: Mapping[str, Sequence[float]],
    plots: Mapping[str, Sequence[PlotEvaluation]],
) -> DifferenceEntry:
    noise: NoiseSource | None = None
    sd, width = np.inf, _NORMAL_95
    repeated = pooled_spread(list(found.values()))
    if repeated is not None:
        noise, width = "repeats", float(stdtrit(repeated[1], 0.975))
        sd = repeated[0] * float(np.sqrt(1.0 / len(found[label]) + 1.0 / len(found[less])))
    else:
        after, before = figure.error(plots[label][0]), figure.error(plots[less][0])
        if after is not None and before is not None:
            noise, sd = "flights", hypot(after, before) / NINE_IN_TEN
    difference = float(np.mean(found[label]) - np.mean(found[less]))
    entry = DifferenceEntry(plot=plot, figure=figure.key, label=label, less=less, difference=difference)
    if not sd < _LARGEST:
        return entry
    low, high = difference - width * sd, difference + width * sd
    beyond = bool(low > 0.0 or high < 0.0)
    told = {"noise": noise, "noise_sd": sd, "low": low, "high": high, "beyond": beyond}
    return entry.model_copy(update=told)


def _only(hashes: set[str | None]) -> str | None:
    return hashes.pop() if len(hashes) == 1 else None


def _what_differs(
    runs: Sequence[Labelled], by_label: Mapping[str, Sequence[Labelled]], names: Sequence[str], scored: bool
) -> Iterator[str]:
    """What of the evaluations is not alike, or not to be compared."""
    if len({run.report.reference_sha256 for run in runs}) > 1:
        yield (
            "the evaluations have different references, so distances and F-scores are not compared: only figures that "
            "need none"
        )
    elif not scored:
        yield "the evaluations have no reference: only figures that need none are compared"
    if scored and len({run.report.refine for run in runs}) > 1:
        yield "some clouds were moved onto the reference before they were scored, others not (refine)"
    first = runs[0].report.settings
    others = [run.report.settings for run in runs[1:]]
    changed = {key for each in others for key in {*first, *each} if first.get(key) != each.get(key)}
    if changed:
        yield f"the evaluations were made with different settings: {', '.join(sorted(changed))}"
    for label, own in by_label.items():
        having = {name: plot for run in own for name, plot in run.plots.items()}
        foreign = [name for name, plot in having.items() if OTHER_PLANTS in plot.doubts]
        for what, plots in (
            ("there is no plot", [name for name in names if name not in having]),
            ("failed:", [name for name, plot in having.items() if plot.error is not None]),
            ("hardly the reference's plants, distances and F-scores left out:", foreign),
            ("doubtful, as findings say:", [n for n, plot in having.items() if plot.doubts and n not in foreign]),
        ):
            if plots:
                yield f"{label}: {what} {listed(plots, _NAMED)}"


def _what_is_untold(differences: Sequence[DifferenceEntry]) -> Iterator[str]:
    if any(each.noise is not None for each in differences):
        yield "of twenty differences that are noise alone, one is called beyond it"
    untold = list(dict.fromkeys(each.figure for each in differences if each.noise is None))
    if untold:
        yield f"whether differences of these are beyond noise cannot be told without repeats: {', '.join(untold)}"


# Visits of a campaign -------------------------------------------------------------------------------------------------


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
