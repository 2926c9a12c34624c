"""Which plots a trial has, of which varieties, and where their plants stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.scenes.plot_description import GROWTH_STAGES, TrialDescription
from fieldkit.vocabulary import Stage

_JITTER_M = (0.03, 0.02)
"""Standard deviation of plants' feet from even places along and across a row, metres."""
_GAP_PLANTS = 2.5
"""Mean number of plants that are missing side by side."""
_BEHIND = 0.15
"""Share of plants that are a stage behind the others."""
_LEANS_DEG = (12.0, 70.0)
"""Least and greatest lean of a lodged plant, degrees."""


@dataclass(frozen=True)
class Variety:
    """How a variety differs from the usual hybrid; factors but for ``erect_deg``."""

    height: float
    """Of stem and internodes."""
    length: float
    width: float
    """Of leaves: those of laser-scanned field maize are narrower than the usual hybrid's."""
    erect_deg: float
    """By which leaves stand steeper."""
    curl: float
    """Of leaves' twist, fold and sideways sweep."""
    tone: float
    """Of the green."""


@dataclass(frozen=True)
class TrialPlant:
    """One plant of a plot."""

    seed: int
    x_m: float
    y_m: float
    """Where it stands, block's frame."""
    yaw_deg: float
    scale: float
    stage: Stage
    lean_deg: float
    """By which it leans, towards its own x."""


@dataclass(frozen=True)
class TrialPlot:
    """One plot of a block."""

    id: str
    """Such as r2c5."""
    lower_m: tuple[float, float]
    upper_m: tuple[float, float]
    """Corners of its outline: half a row spacing beyond its outer rows, half a plant spacing beyond their ends."""
    variety: Variety
    plants: tuple[TrialPlant, ...]


def plots_of(trial: TrialDescription) -> tuple[TrialPlot, ...]:
    """The plots of a block, range by range."""
    width = trial.rows * trial.row_spacing_m
    plots = []
    for row in range(trial.ranges):
        for column in range(trial.columns):
            rng = np.random.default_rng([trial.seed, 61, row, column])
            lower = np.array([row * (trial.length_m + trial.alley_m), column * width]) - 0.5 * np.array(trial.size_m)
            upper = lower + np.array([trial.length_m, width])
            variety = Variety(
                height=float(rng.uniform(0.85, 1.12)),
                length=float(rng.uniform(0.95, 1.20)),
                width=float(rng.uniform(0.75, 1.20)),
                erect_deg=float(rng.uniform(-8.0, 12.0)),
                curl=float(rng.uniform(0.7, 1.8)),
                tone=float(rng.uniform(0.85, 1.12)),
            )
            corners = tuple(float(v) for v in lower), tuple(float(v) for v in upper)
            plants = _plants(trial, lower, rng)
            plots.append(TrialPlot(f"r{row + 1}c{column + 1}", *corners, variety, plants))  # type: ignore[arg-type]
    return tuple(plots)


def _plants(trial: TrialDescription, lower: FloatArray, rng: np.random.Generator) -> tuple[TrialPlant, ...]:
    behind = GROWTH_STAGES[max(0, GROWTH_STAGES.index(trial.stage) - 1)]
    count = max(1, round(trial.length_m / trial.plant_spacing_m))
    plants = []
    for row in range(trial.rows):
        missing = 0
        for k in range(count):
            if not missing and rng.random() < trial.gaps / _GAP_PLANTS:
                missing = int(rng.geometric(1.0 / _GAP_PLANTS))
            even = np.array([(k + 0.5) * trial.plant_spacing_m, (row + 0.5) * trial.row_spacing_m])
            place = lower + even + rng.normal(0.0, _JITTER_M)
            seed, yaw, scale = int(rng.integers(1 << 30)), float(rng.uniform(0.0, 360.0)), float(rng.normal(1.0, 0.05))
            leans = rng.random() < trial.lodged
            lean = float(rng.uniform(*_LEANS_DEG) if leans else abs(rng.normal(0.0, 3.0)))
            stage = behind if rng.random() < _BEHIND else trial.stage
            if missing:
                missing -= 1
                continue
            scale = float(np.clip(scale, 0.85, 1.15))
            plants.append(TrialPlant(seed, float(place[0]), float(place[1]), yaw, scale, stage, lean))
    return tuple(plants)
