"""Errors of reconstructed plants' traits on simulated plots with few photographs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.scored_captures import FITTED, designs, make_captures, read_captures
from benchmarks.true_plants import kept_truth
from fieldkit.results.traits import Trait, TraitsEntry, error_column
from fieldkit.runtime.progress import Progress

_NAMES: dict[Trait, str] = {
    "height_m": "height",
    "cover_percent": "cover",
    "covered_area_m2": "covered area",
    "canopy_volume_m3": "canopy volume",
}


def run_plant_figures(folder: Path, *, fitted: int = 3, held_out: int = 2, progress: Progress) -> StudyResult:
    """Compare the traits of captures with the truth.

    Args:
        folder: of captures; missing ones are made and kept, also for `score_prediction`.
        fitted, held_out: numbers of captures of each scene; see `designs`.
    """
    make_captures(folder, designs(fitted, held_out), progress=progress)
    rows = compare(folder)
    return StudyResult(
        name="plant-figures",
        title="Traits of reconstructed plants against the true ones",
        tables=(error_table(rows),),
        notes=(
            "Plots of maize of V5 to V12, 6 to 13 photographs of very different quality, with noise of poses and wind.",
            "The plot's outline is the footprint of the plants' true volume. Truth: the plants' meshes.",
            "Refused: traits that are not to be had from the photographs, as fieldkit says.",
        ),
        figures={"captures": rows},
    )


def compare(folder: Path) -> list[dict[str, Any]]:
    """Traits of every stored capture, with those of its scene's plants; captures of earlier versions are left out."""
    rows: list[dict[str, Any]] = []
    for record, _ in read_captures(folder):
        traits = record["plot"].get("traits")
        if record["truth"] is None or traits is None:
            continue
        name = record["design"]["scene"]
        truth = kept_truth(folder, name)[1]
        rows.append(
            {
                "capture": record["plot"]["name"],
                "scene": name,
                "chamfer_m": record["truth"]["chamfer_m"],
                "found": traits,
                "truth": asdict(truth) | {"cover_percent": truth.cover_percent},
            }
        )
    return rows


def error_table(rows: Sequence[dict[str, Any]]) -> ResultTable:
    """Errors of each trait on the scenes that the seam was fitted on, and on the others."""
    cells: list[tuple[Cell, ...]] = []
    for label, tuning in (("tuning", True), ("others", False)):
        chosen = [row for row in rows if (row["scene"] in FITTED) == tuning]
        for trait in _NAMES:
            known = [row for row in chosen if row["found"][trait] is not None]
            if not known:
                continue
            errors = np.array([_error(row, trait) for row in known])
            within = [_within(row, trait) for row in known]
            unit, decimals = (" mm", 0) if trait == "height_m" else (" %", 1)
            size = np.abs(errors)
            figures = (np.median(errors), np.sqrt(np.mean(errors**2)), np.quantile(size, 0.9))
            cells.append(
                (
                    label,
                    _NAMES[trait],
                    len(known),
                    len(chosen) - len(known),
                    *(f"{v:{'+' if k == 0 else ''}.{decimals}f}{unit}" for k, v in enumerate(figures)),
                    f"{sum(within)} of {len(within)}",
                )
            )
    columns = ("scenes", "trait", "captures>", "refused>", "median error>", "RMSE>", "nine in ten within>", "in ±>")
    return ResultTable("Errors of plants' traits", columns, tuple(cells))


def _error(row: dict[str, Any], trait: Trait) -> float:
    """Millimetres of the height, else percent of the true value."""
    found, true = row["found"][trait], row["truth"][trait]
    return float(1000.0 * (found - true) if trait == "height_m" else 100.0 * (found - true) / true)


def _within(row: dict[str, Any], trait: Trait) -> bool:
    """Whether a trait's stated error holds."""
    found, above = TraitsEntry.model_validate(row["found"]), row["truth"][trait] - row["found"][trait]
    below = found.height_error_below_m if trait == "height_m" and above < 0 else None
    return bool(abs(above) <= (getattr(found, error_column(trait)) if below is None else below))
