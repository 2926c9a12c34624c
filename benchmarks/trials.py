"""Blocks of trials flown as people fly them and evaluated plot by plot, against the truth about every plot."""

from __future__ import annotations

import csv
import resource
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.trial_flights import FLIGHTS, Flight, fly
from fieldkit.cache import StageCache
from fieldkit.evaluation.flight import evaluate_flight
from fieldkit.results.evaluation import EvaluationReport, ImageReport, PlotEvaluation
from fieldkit.results.traits import error_column
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.scene_file import read_scene
from fieldkit.vocabulary import Stage
from fieldkit_sim.trial.files import SCENE_FILE, TRUTH_FILE

_SEEDS: dict[Stage, int] = {"V6": 101, "V10": 102, "V14": 103, "R1": 104}
"""Of the blocks that nothing was chosen on, by stage."""
TUNING_SEED = 7
"""Of the blocks that constants were chosen on."""
BLOCKS = tuple(f"{stage}/five-8" for stage in _SEEDS)
"""What is flown where nothing else is asked for."""
_OFF_M = 0.03
"""Error of a photograph's place that has to be told, metres."""
_TRAITS = {
    "height_m": "height_m",
    "height_p95_m": "height_p95_m",
    "height_p99_m": "height_p99_m",
    "cover_percent": "cover_percent",
    "canopy_volume_m3": "volume_m3",
    "lai": "lai",
}
"""Traits, and the truth's columns of these."""
_RELATIVE = ("canopy_volume_m3", "lai")
"""Traits whose errors are shares of the truth."""

_NOTE = (
    "Blocks with 10 mm of wind and wash, positions to 2 cm, angles to 1°, where a flight's name says no other. Errors "
    "are root mean squares over the plots that have the trait; of volume and LAI in percent of the truth. Within: "
    "plots whose truth lies within the stated error."
)


@dataclass(frozen=True)
class Judged:
    """A flight against the truth."""

    block: str
    plots: int
    photographs: int
    right: int
    loose: int
    off: int
    """Photographs of plots that count and are off by more than `_OFF_M`."""
    rmse: dict[str, float]
    """By trait, over the plots that have it."""
    had: dict[str, int]
    """Plots that have it."""
    within: dict[str, int]
    """Plots whose truth is within the stated error."""
    mapping_cpu_s: float
    """A photograph."""
    plot_cpu_s: float
    """Median of a plot beside mapping."""
    memory_gb: float
    """Peak of the whole process."""


def run_trials(
    blocks: Sequence[str] = (), *, work: Path, workers: int = 1, cache: StageCache, progress: Progress
) -> StudyResult:
    """Fly over blocks, evaluate every plot and compare its traits with their truth.

    Args:
        blocks: such as V10/five-8, a stage and a flight of `FLIGHTS`, of the test blocks; tuning-V10/five-8 of those
            that constants were chosen on. Empty takes `BLOCKS`.
        work: keeps flights and evaluations for later runs.
    """
    spent, results = Spent.now(), []
    for block in blocks or BLOCKS:
        named, _, kind = block.partition("/")
        tuning, _, stage = named.rpartition("-")
        seed = TUNING_SEED if tuning else _SEEDS[stage]  # type: ignore[index]
        flight = fly(work / named / kind, seed, stage, FLIGHTS[kind], progress)  # type: ignore[arg-type]
        context = Context(cache, progress, workers=workers)
        report = evaluate_flight(
            flight.photographs, flight.plots, flight.folder / "scores", None, context, overwrite=True
        )
        results.append(judge(block, flight, report))
    return StudyResult(
        "trials",
        "Traits of every plot of a trial by one flight",
        tables=(_photographs_table(results), _traits_table(results)),
        notes=(_NOTE,),
        figures={"blocks": [asdict(result) for result in results]},
        wall_s=spent.seconds,
        cpu_s=spent.cpu_seconds,
    )


def judge(block: str, flight: Flight, report: EvaluationReport) -> Judged:
    """An evaluation of a flight against its truth."""
    images: dict[str, tuple[ImageReport, PlotEvaluation]] = {}
    for plot in report.plots:
        images |= {image.name: (image, plot) for image in plot.image_reports}
    off_m = _errors_m(flight, images)
    with (flight.folder / TRUTH_FILE).open(encoding="utf-8") as file:
        truth = {row["plot"]: row for row in csv.DictReader(file)}
    rmse, had, within = {}, {}, {}
    for trait, column in _TRAITS.items():
        errors, held = [], 0
        for plot in report.plots:
            value = getattr(plot.traits, trait, None)
            if value is None or plot.traits is None:
                continue
            true = float(truth[plot.name][column])
            above = getattr(plot.traits, error_column(trait))  # type: ignore[arg-type]
            below = plot.traits.height_error_below_m if trait == "height_m" else above
            errors.append((value - true) / (true if trait in _RELATIVE else 1.0))
            held += value - below <= true <= value + above
        rmse[trait] = float(np.sqrt(np.mean(np.square(errors)))) if errors else float("nan")
        had[trait], within[trait] = len(errors), held
    own_s = [sum(time.cpu_s for time in plot.times) for plot in report.plots]
    assert report.flight is not None
    return Judged(
        block,
        len(report.plots),
        report.flight.images,
        report.flight.right,
        report.flight.loose,
        sum(off_m[name] > _OFF_M for name, (image, _) in images.items() if image.counts),
        rmse,
        had,
        within,
        (report.cpu_seconds - sum(own_s)) / report.flight.images,
        float(np.median(own_s)),
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
    )


def _errors_m(flight: Flight, images: dict[str, tuple[ImageReport, PlotEvaluation]]) -> dict[str, float]:
    """How far photographs with a pose are off, less what all have in common: a receiver's offset is no error of it."""
    scene, true = read_scene(flight.folder / SCENE_FILE), flight.centers()
    off = {}
    for name, (image, plot) in images.items():
        frame = plot.frame
        if image.center_m is None or frame is None or frame.origin is None:
            continue
        source = frame.of_source(plot.metric_source or "").from_source.inverse().apply(np.array([image.center_m]))
        latitude, longitude, altitude = frame.origin.to_geodetic(source)
        off[name] = scene.site.origin.to_local(latitude, longitude, altitude)[0] - true[name]
    common = np.median(list(off.values()), axis=0) if off else np.zeros(3)
    return {name: float(np.linalg.norm(error - common)) for name, error in off.items()}


def _photographs_table(results: Sequence[Judged]) -> ResultTable:
    columns = (
        "Block/flight",
        "Photographs>",
        "right>",
        "loose>",
        "off by 3 cm, not told>",
        "CPU s a photograph>",
        "a plot>",
        "GB>",
    )
    rows: list[tuple[Cell, ...]] = [
        (
            found.block,
            found.photographs,
            found.right,
            found.loose,
            found.off,
            f"{found.mapping_cpu_s:.1f}",
            f"{found.plot_cpu_s:.0f}",
            f"{found.memory_gb:.1f}",
        )
        for found in results
    ]
    return ResultTable("Photographs and cost", columns, tuple(rows))


def _traits_table(results: Sequence[Judged]) -> ResultTable:
    """RMSE, plots that have the trait, and those within the stated error."""

    def cell(found: Judged, trait: str) -> str:
        if not found.had[trait]:
            return "refused"
        error = 100.0 * found.rmse[trait] if trait != "cover_percent" else found.rmse[trait]
        unit = "%" if trait in (*_RELATIVE, "cover_percent") else "cm"
        return f"{error:.1f} {unit}; {found.within[trait]} of {found.had[trait]}"

    names = tuple(f"{trait}>" for trait in _TRAITS)
    rows: list[tuple[Cell, ...]] = [(found.block, *(cell(found, trait) for trait in _TRAITS)) for found in results]
    return ResultTable(
        "Errors (RMS) of traits; plots within the stated error of those that have it",
        ("Block/flight", *names),
        tuple(rows),
    )
