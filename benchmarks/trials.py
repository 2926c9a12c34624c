"""Blocks of trials flown as people fly them and evaluated plot by plot, against the truth about every plot."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.trial_flights import FLIGHTS, Flight, fly
from benchmarks.trial_surface import Seen, seen_by_two
from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache
from fieldkit.clouds.ply import read_cloud
from fieldkit.evaluation.evaluate_plot import RESERVED
from fieldkit.evaluation.flight import evaluate_flight
from fieldkit.results.evaluation import CLOUD_FILE, EvaluationReport, ImageReport, PlotEvaluation
from fieldkit.results.traits import error_column
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.scene_file import read_scene
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.vocabulary import Stage
from fieldkit_sim.trial.files import SCENE_FILE, TRUTH_FILE
from fieldkit_sim.trial.ground import ground_height

SEEDS: dict[Stage, int] = {"V6": 101, "V10": 102, "V14": 103, "R1": 104}
"""Of the blocks that nothing was chosen on, by stage."""
TUNING_SEED = 7
"""Of the blocks that constants were chosen on."""
BLOCKS = tuple(f"{stage}/five-8" for stage in SEEDS)
"""What is flown where nothing else is asked for."""
_OFF_M = 0.03
"""Error of a photograph's place that has to be told, metres."""
_WITHIN_M = 0.02
"""Distance from a cloud's point within which surface counts as reconstructed, metres."""
_SURFACES = 4
"""Most plots whose surface is looked for in their clouds."""
SCORES = "scores"
"""A flight's evaluation in its folder."""
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
    """Peak of the evaluation."""
    surface: float
    """Share of the surface that two photographs see within 20 mm of the clouds, of the first `_SURFACES` plots."""
    hidden_m: float
    """Root mean square of what the highest place that two photographs see is below the highest leaf, of these."""
    ground_off_m: float
    """Root mean square error of the plots' ground."""
    camera_off_m: float
    """95th percentile of the cameras' distances from their true places, less what all have in common."""


def run_trials(
    blocks: Sequence[str], *, work: Path, workers: int, cache: StageCache, progress: Progress
) -> StudyResult:
    """Fly over blocks, evaluate every plot and compare its traits with their truth.

    Args:
        blocks: such as V10/five-8, a stage and a flight of `FLIGHTS`, of the test blocks; tuning-V10/five-8 of those
            that constants were chosen on. Empty takes `BLOCKS`.
        work: keeps flights and evaluations for later runs.
    """
    results = []
    for block in blocks or BLOCKS:
        named, stage, seed, kind = block_named(block, TUNING_SEED)
        flight = fly(work / named / kind, seed, stage, FLIGHTS[kind], progress)
        Path("/proc/self/clear_refs").write_text("5", "ascii")  # forgets the peak of memory in drawing (proc(5))
        report = evaluate_flight(
            flight.photographs,
            flight.plots,
            flight.folder / SCORES,
            None,
            Context(cache, progress, workers=workers),
            overwrite=True,
        )
        results.append(judge(block, flight, report))
    return StudyResult(
        "trials",
        "Traits of every plot of a trial by one flight",
        tables=(_photographs_table(results), _traits_table(results)),
        notes=(_NOTE,),
        figures={"blocks": [asdict(result) for result in results]},
    )


def block_named(asked: str, tuning_seed: int) -> tuple[str, Stage, int, str]:
    """The name, stage and seed of a block such as V10 or tuning-V10, and what stands behind a slash."""
    named, _, behind = asked.partition("/")
    tuning, _, stage = named.rpartition("-")
    return named, stage, tuning_seed if tuning else SEEDS[stage], behind  # type: ignore[index, return-value]


def judge(block: str, flight: Flight, report: EvaluationReport) -> Judged:
    """An evaluation of a flight against its truth."""
    images: dict[str, tuple[ImageReport, PlotEvaluation]] = {}
    for plot in report.plots:
        images |= {image.name: (image, plot) for image in plot.image_reports}
    offsets_m = _offsets_m(flight, images)
    # What all have in common, such as a receiver's offset, is no error of a photograph.
    common_m = np.median(list(offsets_m.values()), axis=0) if offsets_m else np.zeros(3)
    off_m = {name: float(np.linalg.norm(offset - common_m)) for name, offset in offsets_m.items()}
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
        rmse[trait] = _rms(errors)
        had[trait], within[trait] = len(errors), held
    memory_gb = int(Path("/proc/self/status").read_text("ascii").partition("VmHWM:")[2].split()[0]) / 1e6
    soil = read_scene(flight.folder / SCENE_FILE).plot.soil
    near, hidden_m = [], []
    for plot, seen in _surfaces(flight, report):
        path = flight.folder / SCORES / plot_file_name(plot.name, RESERVED) / CLOUD_FILE
        cloud = cKDTree(_in_scene(flight, plot, read_cloud(path).points) - common_m)
        near.append(cloud.query(seen.surface)[0] <= _WITHIN_M)
        ground_m = float(np.median(ground_height(soil, *seen.surface[:, :2].T)))
        hidden_m.append(float(truth[plot.name]["height_m"]) - seen.top_m + ground_m)
    feet = [
        _in_scene(flight, plot, plot.frame.ground.above(_middle(plot)))[0] - common_m
        for plot in report.plots
        if plot.frame is not None and plot.frame.ground is not None
    ]
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
        memory_gb,
        float(np.concatenate(near).mean()) if near else float("nan"),
        _rms(hidden_m),
        _rms([place[2] - float(ground_height(soil, *place[:2, None])[0]) for place in feet]),
        float(np.quantile(list(off_m.values()), 0.95)) if off_m else float("nan"),
    )


def _surfaces(flight: Flight, report: EvaluationReport) -> list[tuple[PlotEvaluation, Seen]]:
    """The first plots that have traits, with `seen_by_two`."""
    plots = {plot.name: plot for plot in report.plots if plot.traits is not None}
    names = list(plots)[:_SURFACES]
    return [(plots[name], seen) for name, seen in seen_by_two(flight, names).items()] if names else []


def _middle(plot: PlotEvaluation) -> FloatArray:
    """(1, 2) of a plot's volume."""
    assert plot.volume is not None
    middle: FloatArray = np.mean([plot.volume.lower_m, plot.volume.upper_m], axis=0)[None, :2]
    return middle


def _rms(errors: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else float("nan")


def _in_scene(flight: Flight, plot: PlotEvaluation, points: FloatArray) -> FloatArray:
    """Points (n, 3) of a plot's frame in the frame of the flight's scene."""
    assert plot.frame is not None
    return plot.frame.about(read_scene(flight.folder / SCENE_FILE).site.origin, points)


def _offsets_m(flight: Flight, images: dict[str, tuple[ImageReport, PlotEvaluation]]) -> dict[str, FloatArray]:
    """By photograph with a pose, its place less the true one."""
    true = flight.true_poses()
    return {
        name: _in_scene(flight, plot, np.array([image.center_m]))[0] - true[name].center
        for name, (image, plot) in images.items()
        if image.center_m is not None and plot.frame is not None
    }


def _photographs_table(results: Sequence[Judged]) -> ResultTable:
    columns = (
        "Block/flight",
        "Photographs>",
        "right>",
        "loose>",
        "off by 3 cm, not told>",
        "95 % of cameras off by>",
        "surface within 20 mm>",
        "top hidden by>",
        "ground off by>",
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
            f"{1000.0 * found.camera_off_m:.1f} mm",
            f"{100.0 * found.surface:.1f} %",
            f"{100.0 * found.hidden_m:.1f} cm",
            f"{1000.0 * found.ground_off_m:.0f} mm",
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
