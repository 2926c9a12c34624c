"""CPU seconds and memory of `fieldkit reference` against the number of photographs, each run in its own process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.captures import rig_capture
from benchmarks.curves import COLORS, dress
from benchmarks.result import ResultTable, StudyResult
from benchmarks.rigs import RigSet, load_rig, uniform_subset
from fieldkit.cache import StageCache
from fieldkit.errors import ReconstructionError
from fieldkit.pictures.panels import DPI, FAINT, INK, PAPER, drawable
from fieldkit.runtime.progress import Progress


@dataclass(frozen=True)
class Cost:
    """A measured run."""

    name: str
    """Runs of one name make one line."""
    images: int
    """Photographs."""
    cpu_s: float
    """CPU seconds, all processes."""
    memory_bytes: int
    """Peak resident memory."""


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


SIZES = (10, 20, 40, 79)
MEMORY_LIMIT_BYTES = 4 * 10**9
PLANTS, SCENE = "plants only (--no-scene)", "plants and scene"
_FIELDKIT = "import sys; from fieldkit.cli.main import main; sys.exit(main())"


def run_scaling(
    data: Path, sizes: Sequence[int] = SIZES, *, scene: bool, cache: StageCache, progress: Progress
) -> StudyResult:
    """References of uniform subsets of basil_rig, with cold caches."""
    rig = load_rig(data, "basil_rig", cache=cache, progress=progress)
    costs = []
    kinds = {PLANTS: ["--no-scene"], SCENE: []} if scene else {PLANTS: ["--no-scene"]}
    with (
        tempfile.TemporaryDirectory(prefix="fieldkit-") as folder,
        progress.stage("References", len(sizes) * len(kinds)) as advance,
    ):
        for size in sizes:
            images = Path(folder) / f"images-{size}"
            write_subset(images, rig, size)
            for name, options in kinds.items():
                costs.append(reference_cost(name, images, size, options))
                advance(1)
    picture = BytesIO()
    draw_cost_plot(costs, memory_limit_bytes=MEMORY_LIMIT_BYTES).savefig(picture, format="png", metadata={})
    return StudyResult(
        name="scaling",
        title="Cost against the number of photographs",
        tables=(cost_table(costs),),
        notes=(
            "Uniform subsets of basil_rig (2304 × 1296 pixels); standard, one worker, one thread, --no-cache.",
            "poses.csv has the commanded poses, completed; camera.toml the dense model's calibration.",
            "A process of its own for each; CPU seconds of user and system, start included; memory is its ru_maxrss.",
        ),
        figures={"costs": [asdict(cost) for cost in costs], "memory_limit_bytes": MEMORY_LIMIT_BYTES},
        pictures={"cost.png": picture.getvalue()},
    )


def write_subset(folder: Path, rig: RigSet, size: int) -> None:
    """A capture of ``size`` photographs with the positions that the rig's operator knows."""
    rig_capture(folder, rig, uniform_subset(rig.names, size), rig.nominal, rig.accuracy_m)


def reference_cost(name: str, images: Path, count: int, options: Sequence[str]) -> Cost:
    """Run `fieldkit reference` on a folder and measure the process."""
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        arguments = [
            sys.executable,
            "-c",
            _FIELDKIT,
            "reference",
            str(images),
            "-o",
            str(Path(folder) / "reference"),
            "--no-cache",
            "--json",
            *options,
        ]
        cpu_s, memory, code = process_cost(arguments)
    if code != 0:
        raise ReconstructionError(f"fieldkit reference failed on {count} photographs with exit code {code}")
    return Cost(name, count, cpu_s, memory)


def process_cost(arguments: Sequence[str]) -> tuple[float, int, int]:
    """CPU seconds (including awaited children), peak resident bytes and exit code of a command."""
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    unit = 1 if sys.platform == "darwin" else 1024
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss * unit, process.returncode


def cost_table(costs: Sequence[Cost]) -> ResultTable:
    """A row per run."""
    columns = ("photographs>", "what", "CPU s>", "CPU s per photograph>", "most memory, GB>")
    rows = tuple(
        (c.images, c.name, f"{c.cpu_s:.0f}", f"{c.cpu_s / c.images:.2f}", f"{c.memory_bytes / 1e9:.2f}") for c in costs
    )
    return ResultTable("fieldkit reference", columns, rows)
