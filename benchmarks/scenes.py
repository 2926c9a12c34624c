"""The engine benchmarks' scenes: two for tuning, two held out."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.plot_description import PlotDescription
from fieldkit.scenes.scene_file import read_scene
from fieldkit_sim.simulation import ring

Split = Literal["tuning", "test"]

_FOLDER = Path(__file__).parent / "rendered"


def benchmark_scene(split: Split, index: int) -> PlotDescription:
    """One of four plots, three to five plants each.

    Args:
        split: "tuning", on which parameters may be chosen, or "test".
        index: 0 (one row of three or five plants) or 1 (two rows).
    """
    return read_scene(_FOLDER / f"{split}-{index}.toml").plot


def benchmark_cameras(count: int = 10) -> tuple[list[Pose], Intrinsics]:
    """A ring of ``count`` views of 2000 × 1500 pixels (f = 1700 px), 1.7 m from the plants."""
    return ring(count, 1.45, 1.15), Intrinsics.pinhole(2000, 1500, 1700.0)
