"""The objective against noise in the poses and in the images (the paper's σ_ν and σ_η)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.curves import draw_bands
from benchmarks.objective_scenes import TuningPlot, tuning_plot
from benchmarks.result import Cell, ResultTable, StudyResult, spread
from fieldkit.pictures.panels import png
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.run.evaluations import Job, evaluating
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.simulate import CaptureNoise
from fieldkit.vocabulary import SearchFidelity

POSITIONS_M = (0.0, 0.002, 0.005, 0.010, 0.020, 0.050)
ANGLES_DEG = (0.0, 0.1, 0.5, 1.0, 2.0)
GREY_LEVELS = (0.0, 5.0, 10.0, 20.0, 40.0)
QUIET = CaptureNoise(position_m=0.0, angle_deg=0.0, image_sigma=0.0)


def run_noise(
    plot: TuningPlot | None = None,
    fidelity: SearchFidelity = "standard",
    *,
    positions_m: Sequence[float] = POSITIONS_M,
    angles_deg: Sequence[float] = ANGLES_DEG,
    grey_levels: Sequence[float] = GREY_LEVELS,
    seeds: int = 5,
    workers: int = 1,
    progress: Progress,
) -> StudyResult:
    """Evaluate one configuration (the ring of ten) under each noise alone, over seeds."""
    wall, cpu = time.perf_counter(), time.process_time()
    plot = plot or tuning_plot()
    series: dict[str, dict[float, CaptureNoise]] = {
        "position noise, mm": {1000.0 * v: replace(QUIET, position_m=v) for v in positions_m},
        "angle noise, °": {v: replace(QUIET, angle_deg=v) for v in angles_deg},
        "image noise, grey levels": {v: replace(QUIET, image_sigma=v) for v in grey_levels},
    }
    done: dict[CaptureNoise, list[Evaluation]] = {}
    levels = [noise for levels in series.values() for noise in levels.values()]
    with progress.stage(f"{plot.name}: noise", seeds * len(set(levels))) as advance:
        for noise in levels:
            if noise in done:
                continue
            objective = Objective(plot.source.with_noise(noise), ObjectiveSettings(fidelity))
            with evaluating(objective, Context(workers=workers)) as evaluations:
                done[noise] = []
                for evaluation in evaluations.each(Job(plot.ring, seed) for seed in range(seeds)):
                    done[noise].append(evaluation)
                    advance(1)
    found = {name: {x: done[noise] for x, noise in levels.items()} for name, levels in series.items()}
    curves = {name: {x: [e.value_m for e in es] for x, es in by.items()} for name, by in found.items()}
    return StudyResult(
        name="noise",
        title="The objective against noise",
        tables=(noise_table(found),),
        notes=(
            f"The ring of ten, {fidelity}, {seeds} seeds; prior mapping, told the positions' accuracy.",
            "One noise at a time beside the scene's camera effects: exact poses and no noise of the image otherwise.",
            "The cloud is placed by the commanded centres, so position noise also misplaces it.",
            "Bands: mean ± one standard deviation.",
        ),
        figures={name: {f"{x:g}": _plain(es) for x, es in by.items()} for name, by in found.items()},
        pictures={"noise.png": png(draw_bands(curves, "value"))},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def noise_table(found: dict[str, dict[float, list[Evaluation]]]) -> ResultTable:
    """A row per noise and level: median (least–most) of the value and its terms, and the right photographs."""
    rows: list[tuple[Cell, ...]] = [
        (
            name, f"{x:g}", spread([1000 * e.value_m for e in es], 2),
            spread([None if e.accuracy_m is None else 1000 * e.accuracy_m for e in es], 2),
            spread([None if e.completeness_m is None else 1000 * e.completeness_m for e in es], 2),
            f"{np.mean([e.right for e in es]):.1f} of {es[0].images}",
        )
        for name, by in found.items()
        for x, es in by.items()
    ]  # fmt: skip
    columns = ("noise", "σ>", "value, mm>", "accuracy, mm>", "completeness, mm>", "right>")
    return ResultTable("Value against noise", columns, tuple(rows))


def _plain(evaluations: Sequence[Evaluation]) -> list[dict[str, Any]]:
    return [evaluation.figures() for evaluation in evaluations]
