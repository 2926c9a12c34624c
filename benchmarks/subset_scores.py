"""Few views of the recorded rigs, scored by `fieldkit evaluate` against the references of all their photographs."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.captures import rig_capture
from benchmarks.few_views import SUBSETS
from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.rigs import load_rig, perturb, uniform_subset
from fieldkit.cache import StageCache
from fieldkit.evaluation.evaluate import evaluate
from fieldkit.evaluation.reference import build_reference
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.results.evaluation import PlotEvaluation, distance_key
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress

NOISE_M, NOISE_DEG = 0.010, 1.0
F_DISTANCES_M = (0.002, 0.005, 0.010)
_FIGURES = (
    "name", "images", "registered", "right", "chamfer_m", "accuracy_m", "completeness_m", "f_score", "near_3px",
    "near_6px", "inside",
)  # fmt: skip


def run_subset_scores(
    data: Path, subsets: Mapping[str, tuple[int, ...]] = SUBSETS, *, cache: StageCache, progress: Progress
) -> StudyResult:
    """One evaluation per rig, whose plots are the uniform subsets at both phases; with and without ICP."""
    rows: list[tuple[Cell, ...]] = []
    figures = {}
    for name, sizes in subsets.items():
        rig = load_rig(data, name, cache=cache, progress=progress)
        accuracy = float(np.hypot(NOISE_M, rig.accuracy_m))
        with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
            reference, captures = Path(folder) / "reference", Path(folder) / "captures"
            build_reference(data / name / "images", reference, context=Context(cache, progress), scene=False)
            captures.mkdir()
            for phase in (0, 1):
                poses = perturb(rig.nominal, NOISE_M, NOISE_DEG, phase)
                for size in sizes:
                    target = captures / f"{size}-views-phase-{phase}"
                    rig_capture(target, rig, uniform_subset(rig.names, size, phase), poses, accuracy)
            for refine in (False, True):
                report = evaluate(
                    captures,
                    Path(folder) / f"evaluation-{refine}",
                    EvaluationSettings(refine=refine),
                    Context(cache, progress),
                    reference=reference,
                )
                plots = sorted(report.plots, key=lambda plot: (plot.images, plot.name))
                rows += [score_row(name, plot, refine=refine) for plot in plots]
                figures[f"{name}, {'refined' if refine else 'as placed'}"] = [
                    plot.model_dump(mode="json", include=set(_FIGURES)) for plot in plots
                ]
    return StudyResult(
        name="subset-scores",
        title="Few views, scored",
        tables=(score_table(rows),),
        notes=(
            "fieldkit evaluate captures/ --reference REF with its defaults: one command per rig and per --refine.",
            f"poses.csv off by {1000 * NOISE_M:.0f} mm and {NOISE_DEG:g}° per axis beyond the rig's own error.",
            "The reference is the plants' cloud of all photographs. Phase 1 starts at the second photograph.",
        ),
        figures=figures,
    )


def score_row(rig: str, plot: PlotEvaluation, *, refine: bool) -> tuple[Cell, ...]:
    """A plot's row of the table."""
    means = (plot.chamfer_m, plot.accuracy_m, plot.completeness_m)
    f_scores = [None if plot.f_score is None else plot.f_score[distance_key(d)] for d in F_DISTANCES_M]
    cells = [
        *(None if v is None else f"{1000 * v:.2f}" for v in means),
        *(None if v is None else f"{v:.3f}" for v in f_scores),
        *(None if v is None else f"{100 * v:.1f}" for v in (plot.near_3px, plot.near_6px, plot.inside)),
    ]
    return (
        rig,
        plot.name,
        "ICP" if refine else "as placed",
        f"{plot.right} of {plot.images}",
        *cells,
        f"{plot.cpu_seconds:.0f}",
    )


def score_table(rows: list[tuple[Cell, ...]]) -> ResultTable:
    """All rows."""
    columns = (
        "rig",
        "capture",
        "placed by",
        "right>",
        "chamfer, mm>",
        "accuracy, mm>",
        "completeness, mm>",
        "F at 2 mm>",
        "F at 5 mm>",
        "F at 10 mm>",
        "plants within 3 px, %>",
        "6 px, %>",
        "points on plants, %>",
        "CPU s>",
    )
    return ResultTable("fieldkit evaluate", columns, tuple(rows))
