"""Errors of reconstructed plants' figures on simulated plots with few photographs."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.scored_captures import designs, make_captures, read_captures, stored_cloud
from benchmarks.true_plants import TrueFigures, kept_truth
from fieldkit.clouds.ground import Plane
from fieldkit.clouds.plant_figures import PlantFigures, plant_figures
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Similarity
from fieldkit.runtime.progress import Progress

_LEVEL = Plane(np.array([0.0, 0.0, 1.0]), 0.0, 0.0, 0.0, 0.01)
GOOD_M = 0.015
"""Chamfer distance up to which a reconstruction counts as good in the table."""


def run_plant_figures(folder: Path, *, fitted: int = 3, held_out: int = 2, progress: Progress) -> StudyResult:
    """Compare the figures of captures with the truth.

    Args:
        folder: of captures; missing ones are made and kept, also for `score_prediction`.
        fitted, held_out: numbers of captures of each scene; see `designs`.
        progress: receives the stages.

    Raises:
        RenderingError: this machine cannot render.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    make_captures(folder, designs(fitted, held_out), progress=progress)
    rows = compare(folder)
    return StudyResult(
        name="plant-figures",
        title="Height, cover and hull of reconstructed plants against the true ones",
        tables=(error_table(rows),),
        notes=(
            "Plots of maize of V5 to V12, 6 to 13 photographs of very different quality, with noise of poses and wind.",
            "Within the plants' true volume, as with --bounds or a reference. Truth: the plants' meshes.",
            f"Good: chamfer distance to the true surface up to {1000 * GOOD_M:.0f} mm.",
            "Height is above the ground that each capture found for itself; above the true one where it found none.",
        ),
        figures={"captures": rows},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def compare(folder: Path) -> list[dict[str, Any]]:
    """Figures of every stored capture, with those of its scene's plants."""
    rows: list[dict[str, Any]] = []
    scenes: dict[str, tuple[Volume, TrueFigures]] = {}
    for record, arrays in read_captures(folder):
        if record["truth"] is None:
            continue
        name = record["design"]["scene"]
        if name not in scenes:
            scenes[name] = kept_truth(folder, name)
        volume, truth = scenes[name]
        found, own_ground = capture_figures(record, arrays, volume)
        if found is None:
            continue
        rows.append({
            "capture": record["plot"]["name"], "scene": name, "chamfer_m": record["truth"]["chamfer_m"],
            "own_ground": own_ground, "found": asdict(found) | {"covered_m2": found.covered_m2}, "truth": asdict(truth),
        })  # fmt: skip
    return rows


def capture_figures(
    record: dict[str, Any], arrays: dict[str, NDArray[Any]], volume: Volume
) -> tuple[PlantFigures | None, bool]:
    """Figures of a stored capture within the scene's volume, and whether a ground was found in it."""
    to_scene = Similarity.from_matrix(arrays["plot_from_source"]).inverse()
    ground = record["plot"]["frame"]["ground"]
    plane = _LEVEL
    if ground is not None:
        normal = np.array(ground["normal"])
        turned = to_scene.rotation @ normal
        offset = float(turned @ to_scene.apply(ground["offset_m"] * normal))
        plane = Plane(turned, offset, ground["rms_m"], ground["inlier_share"], ground["tolerance_m"])
    cloud = stored_cloud(arrays).transformed(to_scene)
    return plant_figures(cloud, volume, plane, record["plot"]["gsd_m"]), ground is not None


def error_table(rows: Sequence[dict[str, Any]]) -> ResultTable:
    """Errors of each figure, as median and 90th percentile, of all captures and of good ones."""
    cells: list[tuple[Cell, ...]] = []
    for label, chosen in (
        ("all", list(rows)), ("good", [row for row in rows if row["chamfer_m"] <= GOOD_M]),
    ):  # fmt: skip
        for key, name, unit in (
            ("height_m", "height (95 %)", "m"), ("height_max_m", "highest point", "m"),
            ("covered_m2", "covered ground", "%"), ("hull_m3", "hull", "%"),
        ):  # fmt: skip
            errors = np.array([_error(row, key, relative=unit == "%") for row in chosen])
            if not len(errors):
                continue
            scale, suffix = (100.0, " %") if unit == "%" else (1000.0, " mm")
            size = np.abs(errors)
            cells.append(
                (
                    label, len(chosen), name, f"{scale * np.median(errors):+.0f}{suffix}",
                    f"{scale * np.median(size):.0f}{suffix}", f"{scale * np.quantile(size, 0.9):.0f}{suffix}",
                )
            )  # fmt: skip
    columns = ("captures", "number>", "figure", "median error>", "median size>", "nine in ten within>")
    return ResultTable("Errors of plants' figures", columns, tuple(cells))


def _error(row: dict[str, Any], key: str, *, relative: bool) -> float:
    found, true = row["found"][key], row["truth"][key]
    return float((found - true) / true if relative else found - true)
