"""The three ways of mapping on all photographs of the recorded sets."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.references import SETS
from benchmarks.result import Cell, ResultTable, StudyResult
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.errors import ReconstructionError
from fieldkit.reconstruction.pipeline import place
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stages import StageTimer
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.vocabulary import MappingChoice

WAYS: tuple[tuple[MappingChoice, ...], ...] = (("incremental", "global"), ("prior",))
"""Ways that share a cache: the blind mappers share their matches."""


@dataclass(frozen=True)
class MappingRun:
    """A set, mapped one way."""

    set_name: str
    method: str
    """The set and the way."""
    images: int
    registered: int
    right: int
    """Photographs given, posed, and posed in agreement with what is known."""
    model_sizes: tuple[int, ...]
    """Registered photographs of every model, largest first."""
    rms_m: float | None
    """Of the right centres against the known positions; None if none is right."""
    matching_s: float
    mapping_s: float
    """CPU seconds without features. Blind mappers share one matching. Prior mapping matches within its rounds; its
    ``matching_s`` is for calibrating and orienting the cameras."""


def run_mappings(data: Path, names: Sequence[str] = SETS, *, progress: Progress) -> StudyResult:
    """Map every recorded set every way."""
    wall, cpu = time.perf_counter(), time.process_time()
    runs = []
    for name in names:
        for methods in WAYS:
            with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
                cache = StageCache(Path(folder))
                matching: float | None = None
                for method in methods:
                    run = map_set(name, data, method, cache, progress, matching)
                    matching = run.matching_s
                    runs.append(run)
    return StudyResult(
        name="mappings",
        title="Ways to map, all photographs",
        tables=(mapping_table(runs),),
        notes=(
            "One thread. CPU s without features; the blind mappers share one matching (each image's 40 nearest).",
            "RMS of the right centres against the known positions: the rigs' commanded ones, drone_trees' GPS.",
            "drone_trees is mapped with its EXIF focal length; the rigs' cameras are self-calibrated.",
        ),
        figures={"runs": [asdict(run) for run in runs]},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def map_set(
    name: str, data: Path, method: MappingChoice, cache: StageCache, progress: Progress, matching_s: float | None = None
) -> MappingRun:
    """Map a recorded set; ``matching_s`` is the time of the cached matching, None if there is none yet."""
    timer = StageTimer(progress)
    capture = read_capture(data / name / "images")
    found = None
    with suppress(ReconstructionError):  # no model is a result too
        found, _ = place(capture, ReconstructionSettings(mapping=method), [], Context(cache, timer))
    stages = {stage.name: stage.cpu_s for stage in timer.times({})}
    return MappingRun(
        set_name=name,
        method=method,
        images=len(capture.photos),
        registered=0 if found is None else found.registered,
        right=0 if found is None else found.right,
        model_sizes=() if found is None else found.model_sizes,
        rms_m=None if found is None else found.frame.rms_m,
        matching_s=stages.get("Matching", 0.0) if matching_s is None else matching_s,
        mapping_s=stages.get("Mapping", 0.0),
    )


def mapping_table(runs: Sequence[MappingRun]) -> ResultTable:
    """A row per set and way."""
    columns = ("set", "mapping", "registered>", "right>", "models", "RMS>", "matching, CPU s>", "mapping, CPU s>")
    rows: list[tuple[Cell, ...]] = [
        (
            r.set_name,
            r.method,
            f"{r.registered} of {r.images}",
            r.right,
            ", ".join(str(size) for size in r.model_sizes),
            None if r.rms_m is None else f"{1000 * r.rms_m:.1f} mm",
            f"{r.matching_s:.0f}",
            f"{r.mapping_s:.0f}",
        )
        for r in runs
    ]
    return ResultTable("Mapping", columns, tuple(rows))
