"""Values of several evaluations, their differences, and the noise of these."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from fieldkit.clouds import Cloud, read_cloud
from fieldkit.errors import FieldkitError
from fieldkit.evaluation.cloud_reference import AnyReference
from fieldkit.evaluation.comparison_figures import PREDICTED, figure_names, figure_value
from fieldkit.evaluation.reference import CLOUD_FILE
from fieldkit.evaluation.score_noise import (
    LEAST_BLOCKS,
    RESAMPLES,
    Blocks,
    block_sums,
    log_sd,
    pooled_spread,
    quantile_95,
)
from fieldkit.results.comparison import (
    BlockEntry,
    ComparedEvaluation,
    ComparisonReport,
    DifferenceEntry,
    NoiseSource,
    ValueEntry,
)
from fieldkit.results.doubtful import OTHER_PLANTS
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation
from fieldkit.results.plan import PlanMethod
from fieldkit.results.report_files import file_sha256
from fieldkit.version import __version__
from fieldkit.wording import listed

_LEAST_PLOTS = 3
_LARGEST = 1e12
_MANY = 10**6


@dataclass(frozen=True, eq=False)
class Run:
    """One evaluation as read."""

    label: str
    folder: Path
    report: EvaluationReport
    plots: Mapping[str, PlotEvaluation]


class Comparer:
    """Puts a comparison together.

    Args:
        runs: evaluations, in order.
        labels: theirs, each once, in order.
        reference: with its cloud, or None.
        method: of the plan, or None.
        seed: of the bootstrap.
    """

    def __init__(
        self,
        runs: Sequence[Run],
        labels: Sequence[str],
        reference: AnyReference | None,
        method: PlanMethod | None,
        seed: int,
    ) -> None:
        self.labels = labels
        self.by_label = {label: [run for run in runs if run.label == label] for label in labels}
        self.reference, self.method, self.seed = reference, method, seed
        self.plots = list(dict.fromkeys(name for run in runs for name in run.plots))
        self.notes: list[str] = []
        shas = {run.report.reference_sha256 for run in runs}
        self.scored = len(shas) == 1 and None not in shas
        self.distances = [d for d in runs[0].report.distances_m if all(d in run.report.distances_m for run in runs)]
        self.figures = figure_names(self.distances, scored=self.scored)
        self.smallest, self.largest_edge = 0, 0.0
        self._note_what_differs(runs, len(shas))

    def report(self) -> ComparisonReport:
        """All values and differences."""
        values: list[ValueEntry] = []
        differences: list[DifferenceEntry] = []
        for plot in self.plots:
            found = {figure: self._values(plot, figure) for figure in self.figures}
            for figure, by_label in found.items():
                values += [
                    ValueEntry(
                        plot=plot, figure=figure, label=label, value=float(np.mean(numbers)), repeats=len(numbers),
                        spread=float(np.std(numbers, ddof=1)) if len(numbers) > 1 else None,
                    )
                    for label, numbers in by_label.items()
                ]  # fmt: skip
            differences += self._differences(plot, found)
        differences += self._over_plots(differences)
        self._note_untold(differences)
        present = {value.figure for value in values}
        return ComparisonReport(
            fieldkit=__version__,
            evaluations=tuple(self._evaluation(label) for label in self.labels),
            figures=tuple(figure for figure in self.figures if figure in present),
            values=tuple(values),
            differences=tuple(differences),
            blocks=None
            if not self.smallest
            else BlockEntry(edge_m=self.largest_edge, fewest=self.smallest, resamples=RESAMPLES, seed=self.seed),
            notes=tuple(dict.fromkeys(self.notes)),
        )

    def _evaluation(self, label: str) -> ComparedEvaluation:
        runs = self.by_label[label]
        shas = {run.report.reference_sha256 for run in runs}
        return ComparedEvaluation(
            label=label,
            sources=tuple(run.report.source for run in runs),
            reference_sha256=shas.pop() if len(shas) == 1 else None,
            plots=tuple(dict.fromkeys(name for run in runs for name in run.plots)),
        )

    def _values(self, plot: str, figure: str) -> dict[str, list[float]]:
        """Values of a figure by label, one per repeat; labels without one are left out."""
        found = {}
        for label in self.labels:
            plots = [run.plots[plot] for run in self.by_label[label] if plot in run.plots]
            numbers = [value for each in plots if (value := figure_value(each, figure)) is not None]
            if numbers:
                found[label] = numbers
        return found

    def _pairs(self, labels: Sequence[str]) -> list[tuple[str, str]]:
        """Each label with the first, then with the one before it."""
        first = [(label, labels[0]) for label in labels[1:]]
        return [*first, *((label, before) for before, label in pairwise(labels) if before != labels[0])]

    def _differences(self, plot: str, found: Mapping[str, Mapping[str, Sequence[float]]]) -> list[DifferenceEntry]:
        entries = []
        blocks, order = self._blocks(plot)
        for label, less in self._pairs(self.labels):
            drawn: dict[str, float] = {}
            if blocks is not None and label in order and less in order:
                drawn = blocks.difference_sd(order.index(label), order.index(less), seed=self.seed)
            for figure, by_label in found.items():
                if label not in by_label or less not in by_label:
                    continue
                difference = float(np.mean(by_label[label]) - np.mean(by_label[less]))
                noise, sd, width = self._noise(plot, figure, by_label, (label, less), drawn.get(figure))
                if sd is not None and not sd < _LARGEST:  # of hostile files
                    noise, sd = None, None
                low, high = (None, None) if sd is None else (difference - width * sd, difference + width * sd)
                entries.append(
                    DifferenceEntry(
                        plot=plot, figure=figure, label=label, less=less, difference=difference, noise=noise,
                        noise_sd=sd, low=low, high=high,
                        beyond=None if low is None or high is None else bool(low > 0.0 or high < 0.0),
                    )
                )  # fmt: skip
        return entries

    def _noise(
        self,
        plot: str,
        figure: str,
        by_label: Mapping[str, Sequence[float]],
        pair: tuple[str, str],
        drawn: float | None,
    ) -> tuple[NoiseSource | None, float | None, float]:
        """Where the noise of a difference is known from, its standard deviation, and half a 95 % interval in these."""
        repeated = pooled_spread(list(by_label.values()))
        if repeated is not None:
            sd = repeated[0] * float(np.sqrt(sum(1.0 / len(by_label[label]) for label in pair)))
            return "repeats", sd, quantile_95(repeated[1])
        if figure == PREDICTED:
            return self._predicted(plot, by_label, pair)
        planned = None if figure != "chamfer_m" or self.method is None else self.method.known_spread_m
        if planned is not None:
            width = quantile_95(min(self.method.repeats or 2, _MANY) - 1 if self.method is not None else 1)
            between = planned * float(np.sqrt(2.0))
            if drawn is None:
                return "plan", between, width
            return "plan and blocks", float(np.hypot(between, drawn)), width
        return (None, None, 0.0) if drawn is None else ("blocks", drawn, quantile_95())

    def _predicted(
        self, plot: str, by_label: Mapping[str, Sequence[float]], pair: tuple[str, str]
    ) -> tuple[NoiseSource | None, float | None, float]:
        """The intervals are of ratios; about the mean of both predictions they become metres."""
        logs = []
        for label in pair:
            prediction = self.by_label[label][0].plots[plot].prediction
            if prediction is None or not prediction.low_m or not prediction.high_m:
                return None, None, 0.0
            logs.append(log_sd(prediction.low_m, prediction.high_m))
        middle = float(np.sqrt(np.prod([by_label[label][0] for label in pair])))
        return "prediction", middle * float(np.hypot(logs[0], logs[1])), quantile_95()

    def _blocks(self, plot: str) -> tuple[Blocks | None, list[str]]:
        """Sums by cubes of a plot's clouds, and the labels that have one. Repeats tell more, so they need none."""
        if self.reference is None or not self.scored or any(len(runs) > 1 for runs in self.by_label.values()):
            return None, []
        clouds: list[Cloud] = []
        order = []
        for label in self.labels:
            run = self.by_label[label][0]
            if plot not in run.plots or run.plots[plot].chamfer_m is None:
                continue
            cloud = self._cloud(run, plot)
            if cloud is not None and len(cloud):
                clouds.append(cloud)
                order.append(label)
        if len(order) < 2:
            return None, []
        blocks = block_sums(self.reference.cloud, clouds, self.distances)
        if blocks is None:
            self.notes.append(f"{plot}: too small for {LEAST_BLOCKS} cubes to draw from")
            return None, []
        self.smallest = min(self.smallest or blocks.fewest, blocks.fewest)
        self.largest_edge = max(self.largest_edge, blocks.edge_m)
        return blocks, order

    def _cloud(self, run: Run, plot: str) -> Cloud | None:
        """A plot's cloud, where it is there and the one that was scored."""
        entry = next((f for f in run.plots[plot].files if f.name.split("/")[-1] == CLOUD_FILE), None)
        why = "is not listed"
        if entry is not None and ".." not in Path(entry.name).parts and not Path(entry.name).is_absolute():
            path = run.folder / entry.name
            try:
                if path.stat().st_size == entry.bytes and file_sha256(path) == entry.sha256:
                    return read_cloud(path)
                why = "was changed"
            except (OSError, FieldkitError):
                why = "cannot be read"
        self.notes.append(f"{run.label}: the cloud of {plot} {why}, so the noise of its distances cannot be told")
        return None

    def _over_plots(self, differences: Sequence[DifferenceEntry]) -> list[DifferenceEntry]:
        """Mean differences over the plots; their scatter from plot to plot is the noise."""
        groups: dict[tuple[str, str, str], list[float]] = defaultdict(list)
        for each in differences:
            groups[each.label, each.less, each.figure].append(each.difference)
        entries = []
        for label, less in self._pairs(self.labels):
            for figure in self.figures:
                found = groups[label, less, figure]
                if len(found) < _LEAST_PLOTS:
                    continue
                mean, sd = float(np.mean(found)), float(np.std(found, ddof=1) / np.sqrt(len(found)))
                width = quantile_95(len(found) - 1)
                low, high = mean - width * sd, mean + width * sd
                entries.append(
                    DifferenceEntry(
                        plot=None, figure=figure, label=label, less=less, difference=mean, noise="plots", noise_sd=sd,
                        low=low, high=high, beyond=bool(low > 0.0 or high < 0.0),
                    )
                )  # fmt: skip
        return entries

    def _note_what_differs(self, runs: Sequence[Run], references: int) -> None:
        if references > 1:
            self.notes.append(
                "the evaluations have different references, so distances and F-scores are not compared: only figures "
                "that need none"
            )
        elif not self.scored:
            self.notes.append("the evaluations have no reference: only figures that need none are compared")
        if self.scored and len({run.report.refine for run in runs}) > 1:
            self.notes.append("some clouds were moved onto the reference before they were scored, others not (refine)")
        first = runs[0].report.settings
        changed = sorted(
            {
                key
                for run in runs[1:]
                for key in {*first, *run.report.settings}
                if first.get(key) != run.report.settings.get(key)
            }
        )
        if changed:
            self.notes.append(f"the evaluations were made with different settings: {', '.join(changed)}")
        if self.method is not None and (self.method.repeats or 0) < 2:
            self.notes.append("the plan was not confirmed by repeats, so it says nothing of the noise")
        for label in self.labels:
            plots = {name for run in self.by_label[label] for name in run.plots}
            without = [name for name in self.plots if name not in plots]
            if without:
                self.notes.append(f"{label} has no plot named {', '.join(without[:5])}{' …' * (len(without) > 5)}")
            for run in self.by_label[label]:
                failed = [name for name, plot in run.plots.items() if plot.error is not None]
                if failed:
                    self.notes.append(f"{label}: failed: {', '.join(failed[:5])}{' …' * (len(failed) > 5)}")
                others = [name for name, plot in run.plots.items() if OTHER_PLANTS in plot.doubts]
                if others:
                    self.notes.append(
                        f"{label}: hardly the reference's plants, distances and F-scores left out: {listed(others)}"
                    )
                doubted = [name for name, plot in run.plots.items() if plot.doubts and name not in others]
                if doubted:
                    self.notes.append(f"{label}: doubtful, its findings say why: {listed(doubted)}")

    def _note_untold(self, differences: Sequence[DifferenceEntry]) -> None:
        if any(d.noise == "blocks" for d in differences):
            self.notes.append(
                "noise from blocks is that of the plot's surface: it does not say what another flight would have given"
            )
        if any(d.noise is not None for d in differences):
            self.notes.append("of twenty differences that are noise alone, one is called beyond it")
        untold = list(dict.fromkeys(d.figure for d in differences if d.plot is not None and d.noise is None))
        if untold:
            self.notes.append(
                f"whether differences of these are beyond noise cannot be told without repeats: {', '.join(untold)}"
            )
        if self.scored and self.reference is None and "chamfer_m" in untold:
            self.notes.append("give the reference, and the noise of distances is told from the clouds")
