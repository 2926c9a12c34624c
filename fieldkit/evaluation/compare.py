"""fieldkit compare: several evaluations side by side, and which differences are more than noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fieldkit.clouds import Volume
from fieldkit.errors import MetadataError, UsageError
from fieldkit.evaluation.cloud_reference import AnyReference, open_reference, reference_file
from fieldkit.evaluation.comparing import Comparer, Run
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.results.comparison import COMPARE_FILE, ComparisonReport
from fieldkit.results.plan_file import load_plan
from fieldkit.results.report_files import file_sha256, load_evaluation_report
from fieldkit.results.visit import CAMPAIGN_FILE
from fieldkit.runtime.progress import Progress, Silent

TABLE_FILE = "compare.csv"
MOST_EVALUATIONS = 100


@dataclass(frozen=True)
class Comparison:
    """What was compared.

    Attributes:
        report: values, differences and what is said of them; what compare.json holds.
        output: folder with compare.json and compare.csv; None where nothing was to be written.
    """

    report: ComparisonReport
    output: Path | None


def compare_evaluations(
    evaluations: Sequence[Path | str],
    output: Path | None = None,
    *,
    reference: Path | None = None,
    plan: Path | None = None,
    seed: int = 0,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Compare evaluations plot by plot, each with the first and with the one before it.

    A difference is beyond noise where its 95 % interval leaves 0 out. What the noise is known from, the first that can
    be had: repeats (evaluations of one label); else the spread of the plan's own repeats and the block bootstrap of the
    clouds' distances to the reference, both where both are there; for predicted distances, the prediction's interval.

    Args:
        evaluations: folders or evaluation.json in the order of their dates, each with a label before it where one is
            wanted (``"LABEL=PATH"``); those of one label repeat one another.
        output: folder to write; None writes nothing.
        reference: that all were scored against: its cloud tells the noise of distances.
        plan: that was flown: the spread of its objective tells the noise of chamfer distances.
        seed: of the bootstrap.
        overwrite: replace an earlier comparison in ``output``.
        progress: told of stages.

    Raises:
        UsageError: there is nothing to compare, or ``output`` exists.
        MetadataError: an evaluation, the reference or the plan cannot be used.
        StorageError: ``output`` cannot be written.
    """
    progress = progress or Silent()
    runs = _read(evaluations)
    labels = list(dict.fromkeys(run.label for run in runs))
    if len(labels) < 2:
        raise UsageError("there is nothing to compare", remedy="Give two evaluations or more, of different labels.")
    method = None if plan is None else load_plan(plan).method
    known = None
    if reference is not None:
        _check_reference(reference, runs)
        known = _as_scored(reference, runs[0])
    with progress.stage("Comparing"):
        report = Comparer(runs, labels, known, method, seed).report()
    if output is None:
        return Comparison(report, None)
    from fieldkit.figures.spreadsheets import compare_csv

    with atomic_folder(output, overwrite=overwrite, marker=COMPARE_FILE) as folder:
        write_atomic(folder / TABLE_FILE, compare_csv(report))
        write_atomic(folder / COMPARE_FILE, report.model_dump_json(indent=2) + "\n")
    return Comparison(report, Path(output))


def _read(evaluations: Sequence[Path | str]) -> list[Run]:
    if len(evaluations) > MOST_EVALUATIONS:
        raise UsageError(f"{len(evaluations)} evaluations are too many", remedy=f"Give up to {MOST_EVALUATIONS}.")
    runs: list[Run] = []
    taken: set[str] = set()
    for each in evaluations:
        label, path = _labelled(each)
        if (path / CAMPAIGN_FILE).is_file():
            raise UsageError(
                "is a campaign: its dates are compared within it", path=path,
                remedy=f"Use `fieldkit campaign show {path.name}`, or give evaluations within it.",
            )  # fmt: skip
        report = load_evaluation_report(path)
        folder = path if path.is_dir() else path.parent
        if not label:
            name = folder.absolute().name or "evaluation"
            numbered = (name, *(f"{name} {k}" for k in range(2, len(evaluations) + 2)))
            label = next(each for each in numbered if each not in taken)
        taken.add(label)
        runs.append(Run(label, folder, report, {plot.name: plot for plot in report.plots}))
    return runs


def _labelled(text: Path | str) -> tuple[str, Path]:
    if isinstance(text, Path) or Path(text).exists():
        return "", Path(text)
    label, equals, path = text.partition("=")
    if not equals or "/" in label or not label.strip():
        return "", Path(text)
    return label.strip(), Path(path)


def _as_scored(reference: Path, run: Run) -> AnyReference:
    """The reference as a run took it: a bare cloud in the same frame, and within the same bounds."""
    settings = run.report.settings
    bounds = settings.get("bounds")
    volume = Volume(tuple(bounds["lower"]), tuple(bounds["upper"])) if isinstance(bounds, dict) else None
    return open_reference(reference, str(settings.get("reference_frame") or ""), volume)


def _check_reference(reference: Path, runs: Sequence[Run]) -> None:
    try:
        sha = file_sha256(reference_file(reference))
    except OSError as error:
        raise MetadataError(
            "there is no reference", path=reference, remedy="Give what the evaluations were scored against."
        ) from error
    for run in runs:
        if run.report.reference_sha256 != sha:
            raise UsageError(
                f"{run.label} was not scored against this reference", path=reference,
                remedy="Give the reference of all evaluations, or leave --reference out.",
            )  # fmt: skip
