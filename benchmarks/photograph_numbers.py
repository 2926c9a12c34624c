"""`numbers`: what `fieldkit plan -n 6,8,10` expects of distances and traits, beside evaluations outdoors."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.scored_captures import scene_outline, settle_in_scene
from benchmarks.true_plants import true_traits
from fieldkit.cache import StageCache
from fieldkit.clouds.alignment import REFERENCE_REACH_M, icp_onto_reference
from fieldkit.clouds.metrics import nearest_distances
from fieldkit.evaluation.traits import plot_traits
from fieldkit.planning.objective.evaluation import value_m
from fieldkit.planning.objective.objective import FIDELITIES, Objective
from fieldkit.planning.objective.simulated import SimulatedSource
from fieldkit.planning.run.numbers import even_rings, expected_errors, missing_shares
from fieldkit.planning.run.request import search_settings
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.planning.space.cameras import Cameras
from fieldkit.reconstruction.pipeline import reconstruct
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.silhouettes import outlines
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress

SCENES, NUMBERS = ("tuning-1", "tuning-2"), (6, 8, 10, 13, 16, 20)
_VEHICLE, _NOISE = "dji-mavic-3-enterprise", {"pose_m": 0.02, "pose_deg": 1.0}


def run_numbers(
    scenes: Sequence[str] = SCENES, numbers: Sequence[int] = NUMBERS, *, seeds: int = 1, workers: int = 1,
    progress: Progress,
) -> StudyResult:  # fmt: skip
    """Expected and evaluated distance and errors of traits for each number of photographs.

    Args:
        seeds: draws of the photographs' noise.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    rows = [row for scene in scenes for row in _compared(scene, numbers, seeds, workers, progress)]
    return StudyResult(
        name="numbers", title="How many photographs", tables=(_table(rows),),
        notes=(
            f"{_NOISE['pose_m']} m and {_NOISE['pose_deg']}°, 10 mm of wind, the wash of {_VEHICLE}; standard.",
            "Errors as nine in ten are expected within, and as evaluated on the given plot, draw by draw.",
        ),
        figures={"numbers": rows}, wall_s=time.perf_counter() - wall, cpu_s=time.process_time() - cpu,
    )  # fmt: skip


def _compared(scene: str, numbers: Sequence[int], seeds: int, workers: int, progress: Progress) -> list[dict[str, Any]]:
    settings = search_settings(scene=Path(scene), vehicle=_VEHICLE, noise=_NOISE, method="score")
    context = Context(StageCache(None), progress, workers)
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        setup = set_up_run(settings, Path(folder), context)
    objective, rows = setup.objective.on(0), []
    found = even_rings(setup.problem, numbers, settings)
    with progress.stage(scene, seeds * len(numbers)) as advance:
        for (cameras, expected_m), missing in zip(found, missing_shares(setup.problem, found), strict=True):
            errors = expected_errors(missing, setup.problem).model_dump()
            for seed in range(1, 1 + seeds):
                measured = _measured(objective, cameras, seed, progress)
                rows.append({"scene": scene, "cameras": len(cameras), "seed": seed, "expected_m": expected_m,
                             "missing": missing, "expected": errors, **measured})  # fmt: skip
                advance(1)
    setup.objective.close()
    return rows


def _measured(objective: Objective, cameras: Cameras, seed: int, progress: Progress) -> dict[str, float | None]:
    """Distance (m) and errors of height (m), area and volume (shares); None where they are not to be had."""
    source = objective.source
    assert isinstance(source, SimulatedSource)
    flown = cameras if objective.stretch is None else cameras.stretched(objective.stretch)
    with source.photograph(flown, FIDELITIES["standard"], seed, progress) as photos:
        wanted = ReconstructionSettings(features=photos.features, fidelity="standard", trust_orientations=True)
        found = reconstruct(
            photos.capture, wanted, Context(source.cache, progress), reach_m=REFERENCE_REACH_M,
            known_plot=replace(source.plot, settle=settle_in_scene),
        )  # fmt: skip
        shown = outlines(found.sparse, wanted.mask)
    motion, _ = icp_onto_reference(found.plants, source.reference, with_scale=True)
    plants = found.moved_plants(motion, with_ground=True)
    to_reference, to_cloud = nearest_distances(source.reference, plants)
    true = true_traits(source.proxy)
    traits, _ = plot_traits(found, found.plants, scene_outline(found, source.proxy), shown)
    height, area, volume = traits.height_m, traits.covered_area_m2, traits.canopy_volume_m3
    return {
        "value_m": value_m(to_cloud, to_reference), "right": found.sparse.right,
        "height_m": None if height is None else height - true.height_m,
        "area": None if area is None else area / true.covered_area_m2 - 1.0,
        "volume": None if volume is None else volume / true.canopy_volume_m3 - 1.0,
    }  # fmt: skip


def _table(rows: Sequence[dict[str, Any]]) -> ResultTable:
    cells: list[tuple[Cell, ...]] = []
    for key in dict.fromkeys((row["scene"], row["cameras"]) for row in rows):
        own = [row for row in rows if (row["scene"], row["cameras"]) == key]
        first, expected = own[0], own[0]["expected"]

        def drawn(name: str, scale: float, digits: int, own: list[dict[str, Any]] = own) -> str:
            return ", ".join("–" if row[name] is None else f"{scale * row[name]:+.{digits}f}" for row in own)

        cells.append((
            key[0], str(key[1]), f"{1000 * first['expected_m']:.1f}", drawn("value_m", 1000, 1).replace("+", ""),
            f"± {1000 * expected['height_m']:.0f}", drawn("height_m", 1000, 0),
            f"± {100 * expected['area']:.0f}", drawn("area", 100, 0),
            f"± {100 * expected['volume']:.0f}", drawn("volume", 100, 0),
        ))  # fmt: skip
    columns = ("scene", "photographs>", "expected, mm>", "evaluated>", "height, mm>", "evaluated>", "area, %>",
               "evaluated>", "volume, %>", "evaluated>")  # fmt: skip
    return ResultTable("Expected and evaluated", columns, tuple(cells))
