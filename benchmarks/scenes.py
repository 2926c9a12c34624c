"""The engine benchmarks' scenes: two for tuning, two held out."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.plot_description import PRINTED, PlotDescription
from fieldkit.scenes.scene import Light
from fieldkit_sim.generator import plant_layout
from fieldkit_sim.simulation import ring

Split = Literal["tuning", "test"]

_SEEDS: dict[Split, tuple[int, int]] = {"tuning": (11, 12), "test": (23, 24)}


def benchmark_scene(split: Split, index: int) -> PlotDescription:
    """One of four plots, three to five plants each.

    Args:
        split: "tuning", on which parameters may be chosen, or "test".
        index: 0 (one row of three or five plants) or 1 (two rows).
    """
    if split not in _SEEDS or index not in (0, 1):
        raise ValueError(f"there is no benchmark scene {split!r} {index}: it is tuning or test, 0 or 1")
    seed = _SEEDS[split][index]
    count = {("tuning", 0): 3, ("tuning", 1): 5, ("test", 0): 5, ("test", 1): 4}[split, index]
    plants = plant_layout(count, seed, layout="row" if index == 0 else "grid", leaves=(7, 9))
    return PlotDescription(plants, replace(PRINTED, seed=seed), Light())


def benchmark_cameras(count: int = 10) -> tuple[list[Pose], Intrinsics]:
    """A ring of ``count`` views of 2000 × 1500 pixels (f = 1700 px), 1.7 m from the plants."""
    return ring(count, 1.45, 1.15), Intrinsics.pinhole(2000, 1500, 1700.0)
