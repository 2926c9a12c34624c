"""The cost of a reconstruction against the number of its photographs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.curves import COLORS, dress
from fieldkit.files import write_atomic
from fieldkit.pictures.panels import DPI, FAINT, INK, PAPER, drawable, png


@dataclass(frozen=True)
class Cost:
    """A measured run.

    Attributes:
        name: runs of one name make one line.
        images: photographs.
        cpu_s: CPU seconds, all processes.
        memory_bytes: peak resident memory.
    """

    name: str
    images: int
    cpu_s: float
    memory_bytes: int


def write_cost_plot(path: Path, costs: Sequence[Cost], *, memory_limit_bytes: int | None = None) -> None:
    """Write `draw_cost_plot` as PNG.

    Raises:
        StorageError: the place is full or not writable.
    """
    write_atomic(path, png(draw_cost_plot(costs, memory_limit_bytes=memory_limit_bytes)))


def draw_cost_plot(costs: Sequence[Cost], *, memory_limit_bytes: int | None = None) -> Figure:
    """CPU seconds and memory against the number of photographs, side by side; a dashed line at the memory limit."""
    figure = Figure(figsize=(10.0, 4.0), dpi=DPI, facecolor=PAPER, layout="constrained")
    left, right = figure.subplots(1, 2)
    names = list(dict.fromkeys(cost.name for cost in costs))
    for name, color in zip(names, COLORS * len(names), strict=False):
        runs = sorted((cost for cost in costs if cost.name == name), key=lambda cost: cost.images)
        images = [run.images for run in runs]
        left.plot(images, [run.cpu_s for run in runs], "o-", color=color, markersize=4, label=drawable(name))
        right.plot(images, [run.memory_bytes / 2**30 for run in runs], "o-", color=color, markersize=4)
    if memory_limit_bytes is not None:
        right.axhline(memory_limit_bytes / 2**30, color=FAINT, linewidth=1, linestyle=(0, (5, 3)))
    _dress(left, "CPU seconds", sorted({cost.images for cost in costs}))
    _dress(right, "most memory, GiB", sorted({cost.images for cost in costs}))
    if len(names) > 1:
        left.legend(fontsize=8, frameon=False, labelcolor=INK)
    return figure


def _dress(axes: Axes, label: str, images: Sequence[int]) -> None:
    dress(axes, "photographs", "")
    axes.set_title(label, size=10, color=INK, loc="left")
    axes.set_xticks(list(images))
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
