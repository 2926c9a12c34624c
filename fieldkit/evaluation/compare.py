"""fieldkit compare: several evaluations side by side, and which differences are more than noise.

Noise is known from repeats, the scatter within labels that have several evaluations; else from what the benchmark found
between flights, the errors of traits and the intervals of predictions. Where neither says it, it is not guessed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot
from pathlib import Path

import numpy as np
from scipy.special import stdtrit

from fieldkit.errors import UsageError
from fieldkit.figures.registry import Figure, figures_of
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
from fieldkit.results.report_files import load_evaluation_report
from fieldkit.results.visit import CAMPAIGN_FILE
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.version import __version__
from fieldkit.vocabulary import NINE_IN_TEN
from fieldkit.wording import by_key, listed

TABLE_FILE = "compare.csv"
MOST_EVALUATIONS = 100
"""Most evaluations that are compared."""
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
        evaluations=tuple(_evaluation(label, own) for label, own in by_label.items()),
        figures=tuple(figure.key for figure in figures if figure.key in present),
        values=tuple(values),
        differences=tuple(differences),
        notes=tuple(dict.fromkeys(notes)),
    )


def _read(evaluations: Sequence[Path | str]) -> list[Labelled]:
    if len(evaluations) > MOST_EVALUATIONS:
        raise UsageError(f"{len(evaluations)} evaluations are too many", remedy=f"Give up to {MOST_EVALUATIONS}.")
    runs: list[Labelled] = []
    taken: set[str] = set()
    for each in evaluations:
        label, path = _labelled(each)
        if (path / CAMPAIGN_FILE).is_file():
            raise UsageError(
                "is a campaign: its dates are compared within it",
                path=path,
                remedy=f"Use `fieldkit campaign show {path.name}`, or give evaluations within it.",
            )
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
    if not sd < _LARGEST:
        return DifferenceEntry(plot=plot, figure=figure.key, label=label, less=less, difference=difference)
    low, high = difference - width * sd, difference + width * sd
    return DifferenceEntry(
        plot=plot,
        figure=figure.key,
        label=label,
        less=less,
        difference=difference,
        noise=noise,
        noise_sd=sd,
        low=low,
        high=high,
        beyond=bool(low > 0.0 or high < 0.0),
    )


def _evaluation(label: str, runs: Sequence[Labelled]) -> ComparedEvaluation:
    references = {run.report.reference_sha256 for run in runs}
    return ComparedEvaluation(
        label=label,
        sources=tuple(run.report.source for run in runs),
        reference_sha256=references.pop() if len(references) == 1 else None,
        plots=tuple(dict.fromkeys(name for run in runs for name in run.plots)),
    )


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
        having = {name for run in own for name in run.plots}
        without = [name for name in names if name not in having]
        if without:
            yield f"{label} has no plot named {listed(without, _NAMED)}"
        for plots in (run.plots for run in own):
            failed = [name for name, plot in plots.items() if plot.error is not None]
            foreign = [name for name, plot in plots.items() if OTHER_PLANTS in plot.doubts]
            doubtful = [name for name, plot in plots.items() if plot.doubts and name not in foreign]
            if failed:
                yield f"{label}: failed: {listed(failed, _NAMED)}"
            if foreign:
                yield f"{label}: hardly the reference's plants, distances and F-scores left out: {listed(foreign)}"
            if doubtful:
                yield f"{label}: doubtful, its findings say why: {listed(doubtful)}"


def _what_is_untold(differences: Sequence[DifferenceEntry]) -> Iterator[str]:
    if any(each.noise is not None for each in differences):
        yield "of twenty differences that are noise alone, one is called beyond it"
    untold = list(dict.fromkeys(each.figure for each in differences if each.noise is None))
    if untold:
        yield f"whether differences of these are beyond noise cannot be told without repeats: {', '.join(untold)}"
