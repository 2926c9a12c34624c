"""Plants of simulated plots one by one, counted from a ring of photographs in still air, against the true ones."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.result import ResultTable, StudyResult
from benchmarks.scored_captures import FITTED, HELD_OUT, scene_outline
from fieldkit.captures import read_capture
from fieldkit.evaluation.conversion import plot_evaluation
from fieldkit.planning.objective.simulated import Proxy
from fieldkit.reconstruction.pipeline import reconstruct
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import Sidecars, simulate_capture
from fieldkit_sim.simulation import ring_about
from fieldkit_sim.truth import PIXEL_M, height_map

_RING = (12, 2.0, 2.2)
"""Photographs, radius and height in metres."""
_COLUMNS = ("height", "plants>", "height, mm: median>", "RMSE>", "greatest>", "area, %: median>", "RMSE of it>")
_POSITION_M, _ANGLE_DEG = 0.010, 1.0


def run_plant_counts(scenes: Sequence[str] = (), *, progress: Progress) -> StudyResult:
    """Count the plants of scenes, and compare heights and areas with those of the meshes."""
    names = scenes or (*FITTED, *HELD_OUT)
    rows = []
    with progress.stage("Plots", len(names)) as advance:
        for name in names:
            rows.append(_counted(name))
            advance(1)
    errors = [each for row in rows for each in row["plants"]]
    cells = [
        _errors(label, [each for each in errors if each["certain"] in kinds])
        for label, kinds in (("certain", (True,)), ("not certain", (False,)))
    ]
    return StudyResult(
        name="plant-counts",
        title="Plants counted, their heights and areas",
        tables=(
            ResultTable(
                "Plants by plot",
                ("scene", "true>", "counted>", "gaps>", "why not"),
                tuple((row["scene"], row["true"], row["counted"], row["gaps"], row["why"]) for row in rows),
            ),
            ResultTable("Errors of plants", _COLUMNS, tuple(filter(None, cells))),
        ),
        notes=("Counts are right, or refused with the reason. The outline is the footprint of the scene's volume.",),
        figures={"plots": rows},
    )


def _counted(name: str) -> dict[str, Any]:
    description = read_scene(find_scene(name))
    proxy = Proxy.from_description(description)
    noise = replace(description.noise, position_m=_POSITION_M, angle_deg=_ANGLE_DEG)
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder, Renderer(proxy.scene) as renderer:
        simulate_capture(
            Path(folder) / "ring",
            renderer,
            ring_about(*_RING)(proxy.scene, proxy.camera),
            proxy.camera,
            noise=noise,
            effects=description.camera_effects,
            sidecars=Sidecars(poses=True, accuracy_m=_POSITION_M, camera=True),
        )
        settings = ReconstructionSettings()
        found = reconstruct(read_capture(Path(folder) / "ring"), settings, context=Context())
    plot = plot_evaluation(name, found, settings, score=None, outline=scene_outline(found, proxy))
    assert plot.traits is not None
    plants = [mesh for mesh in proxy.scene.meshes if mesh.plant]
    soil = float(np.nanmedian(height_map([m for m in proxy.scene.meshes if m.name.startswith("soil")], proxy.volume)))
    places = np.array([(plant.x_m, plant.y_m, soil) for plant in description.plot.plants])
    feet = found.sparse.frame.plot_from_source.apply(places)[:, :2]
    each = []
    for plant in plot.plants:
        away = np.linalg.norm(feet - (plant.x_m, plant.y_m), axis=1)
        true = plants[int(away.argmin())]
        area = float(np.isfinite(height_map([true], proxy.volume)).sum()) * PIXEL_M**2
        each.append(
            {
                "off_mm": float(1000.0 * away.min()),
                "certain": plant.height_certain,
                "height_mm": 1000.0 * (plant.height_m - float(true.vertices[:, 2].max()) + soil),
                "area_percent": 100.0 * (plant.area_m2 / area - 1.0),
            }
        )
    why = plot.traits.unknown.get("plants", "")
    return {
        "scene": name,
        "true": len(plants),
        "counted": plot.traits.plants,
        "gaps": plot.traits.row_gaps,
        "why": why,
        "plants": each,
    }


def _errors(label: str, each: Sequence[dict[str, Any]]) -> tuple[str | int, ...]:
    """A row of the table; empty without plants."""
    if not each:
        return ()
    height, area = (np.array([one[key] for one in each]) for key in ("height_mm", "area_percent"))
    figures = (np.median(height), np.sqrt(np.mean(height**2)), height[np.abs(height).argmax()], np.median(area))
    return label, len(each), *(f"{v:.0f}" for v in (*figures, np.sqrt(np.mean(area**2))))
