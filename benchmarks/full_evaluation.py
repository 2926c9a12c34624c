"""An evaluation of ten photographs to chamfer distance: fieldkit against pycolmap's defaults and SGBM."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.baseline import LEAST_POSES, Baseline
from benchmarks.captures import rendered_capture, rendered_plot, rig_capture
from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.rigs import load_rig, perturb, uniform_subset
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.clouds import Cloud, CloudScore, ReferenceIndex, Volume, score
from fieldkit.clouds.alignment import icp_onto_reference
from fieldkit.errors import ReconstructionError
from fieldkit.evaluation.reference import Reference, build_reference
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.cameras import cameras_of
from fieldkit.reconstruction.pipeline import KnownPlot, reconstruct
from fieldkit.reconstruction.result import clearance
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.scenes.simulate import CaptureNoise

IMAGES = 10
NOISE_M, NOISE_DEG = 0.010, 1.0
_F_DISTANCE_M = 0.010
_MARGIN_M = 0.02
OURS, THEIRS = "fieldkit", "pycolmap + SGBM"
LENT = "pycolmap + SGBM, lent fieldkit's poses"


@dataclass(frozen=True, eq=False)
class Case:
    """A capture with its truth."""

    name: str
    folder: Path
    plot: KnownPlot
    truth: Cloud


@dataclass(frozen=True)
class Side:
    """Times and results of one side."""

    name: str
    stages: dict[str, float]
    """CPU seconds by stage, scoring included."""
    cpu_s: float
    """Total, from reading the photographs to the score."""
    registered: int
    right: int
    """Photographs."""
    chamfer_m: float | None = None
    f_score: float | None = None
    """None without a cloud."""
    refined_chamfer_m: float | None = None
    refined_f_score: float | None = None
    """After ICP to the truth, which is not timed."""
    error: str = ""
    """Why there is no cloud."""
    poses: Mapping[str, Pose] = field(default_factory=dict, repr=False)
    """Of the right photographs, plot frame; only of fieldkit's side."""

    def as_dict(self) -> dict[str, Any]:
        """The figures, without the poses."""
        figures = asdict(replace(self, poses={}))
        del figures["poses"]
        return figures


def run_evaluation(data: Path | None, *, cache: StageCache, progress: Progress) -> StudyResult:
    """Run both sides on two rendered test scenes and, with the recorded sets, on two tens of basil_rig's views."""
    results: dict[str, tuple[Side, ...]] = {}
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        for index in (0, 1):
            case = rendered_case(Path(folder), index, progress)
            results[case.name] = compare(case, progress)
        if data is not None:
            for case in basil_cases(Path(folder), data, cache, progress):
                results[case.name] = compare(case, progress)
    notes = [
        "Both sides: the same photographs, calibrated camera, volume, plant mask, working size and fusion rule.",
        "One thread, nothing from the cache, one side after the other in one process.",
        "fieldkit ran once before, uncounted, so that no compilation is in the figures.",
        f"The true poses differ from those in poses.csv by {1000 * NOISE_M:.0f} mm and {NOISE_DEG:g}° per axis.",
        "fieldkit maps with poses.csv as priors; the baseline maps blindly and is placed by its positions.",
        "Where too few of the baseline's photographs register, a row more lends it fieldkit's poses for the matching.",
    ]
    if data is None:
        notes.append("FIELDKIT_DATA is unset, so the recorded set was left out.")
    return StudyResult(
        name="evaluation",
        title="One evaluation of ten images",
        tables=(summary(results), stage_table(results)),
        notes=tuple(notes),
        figures={name: {side.name: side.as_dict() for side in sides} for name, sides in results.items()},
    )


def rendered_case(folder: Path, index: int, progress: Progress) -> Case:
    """Ten views of a rendered test scene of 2000 × 1500 pixels."""
    plot = rendered_plot("test", index)
    target = folder / f"rendered-{index}"
    noise = CaptureNoise(position_m=NOISE_M, angle_deg=NOISE_DEG)
    rendered_capture(target, plot, count=IMAGES, noise=noise, progress=progress)
    return Case(f"rendered test scene {index}", target, plot.known(), plot.truth)


def basil_cases(folder: Path, data: Path, cache: StageCache, progress: Progress) -> list[Case]:
    """Ten views of basil_rig all around and ten close together, against the reference of all its photographs.

    The volume is the plant's, not the plot's: the plot's comes so near to the cameras that a pair has more disparities
    than columns, and the baseline cannot match.
    """
    rig = load_rig(data, "basil_rig", cache=cache, progress=progress)
    reference = folder / "basil-reference"
    build_reference(data / "basil_rig" / "images", reference, context=Context(cache, progress), scene=False)
    read = Reference(reference)
    plot = replace(read.known_plot(), volume=Volume.around(read.cloud.points, margin_m=_MARGIN_M, trim=0.001))
    accuracy = float(np.hypot(NOISE_M, rig.accuracy_m))
    poses = perturb(rig.nominal, NOISE_M, NOISE_DEG, 0)
    chosen = {
        "basil_rig, 10 views 36° apart": uniform_subset(rig.names, IMAGES),
        "basil_rig, 10 views 9° apart": rig.names[: 2 * IMAGES : 2],
    }
    cases = []
    for number, (name, names) in enumerate(chosen.items()):
        rig_capture(folder / f"basil-{number}", rig, names, poses, accuracy)
        cases.append(Case(name, folder / f"basil-{number}", plot, read.cloud))
    return cases


def compare(case: Case, progress: Progress) -> tuple[Side, ...]:
    """Run both sides on a case; the baseline also with fieldkit's poses if it has too few of its own."""
    with progress.stage(f"{case.name}: warming up"):
        ours(case, Silent())
    with progress.stage(f"{case.name}: fieldkit"):
        first = ours(case, Silent())
    with progress.stage(f"{case.name}: baseline"):
        return first, *theirs(case, Silent(), first.poses)


def ours(case: Case, progress: Progress) -> Side:
    """The side of fieldkit."""
    start = time.process_time()
    capture = read_capture(case.folder)
    try:
        found = reconstruct(
            capture,
            ReconstructionSettings(),
            known_plot=case.plot,
            context=Context(cache=StageCache(None), progress=progress),
        )
    except ReconstructionError as error:
        return Side(OURS, {}, time.process_time() - start, 0, 0, error=str(error))
    stages = {stage.name: stage.cpu_s for stage in found.times}
    side = _scored(case, OURS, found.plants, stages, start, found.sparse.registered, found.sparse.right)
    return replace(side, poses=found.sparse.poses)


def theirs(case: Case, progress: Progress, lent: Mapping[str, Pose]) -> tuple[Side, ...]:
    """The baseline's side; if it has too few poses, also a second one with the ``lent`` poses.

    The second side's time includes the first's.
    """
    start = time.process_time()
    capture = read_capture(case.folder)
    run = Baseline(capture, _camera(case), case.plot, progress)
    poses = run.poses()
    if len(poses) >= LEAST_POSES:
        return (_densified(case, THEIRS, run, poses, start),)
    error = f"{run.registered} of {len(capture.photos)} photographs registered, {run.right} of them rightly"
    alone = Side(THEIRS, run.stages, time.process_time() - start, run.registered, run.right, error=error)
    if len(lent) < LEAST_POSES:
        return (alone,)
    return alone, _densified(case, LENT, run, lent, start)


def _densified(case: Case, name: str, run: Baseline, poses: Mapping[str, Pose], start: float) -> Side:
    cloud = run.cloud(poses)
    if case.plot.ground is not None:
        cloud = cloud.select(case.plot.ground.heights(cloud.points) > clearance(case.plot.ground))
    if len(cloud) == 0:
        spent = time.process_time() - start
        return Side(name, run.stages, spent, run.registered, run.right, error="no point of a plant")
    return _scored(case, name, cloud, run.stages, start, run.registered, run.right)


def summary(results: dict[str, tuple[Side, ...]]) -> ResultTable:
    """The main figures, a row per side."""
    columns = (
        "capture",
        "method",
        "right>",
        "CPU s>",
        "ratio>",
        "F at 10 mm>",
        "chamfer, mm>",
        "F at 10 mm, ICP>",
        "chamfer, mm, ICP>",
    )
    rows: list[tuple[Cell, ...]] = []
    for name, sides in results.items():
        for side in sides:
            ratio = f"{side.cpu_s / sides[0].cpu_s:.1f}"
            rows.append(
                (
                    name,
                    side.name,
                    f"{side.right} of {IMAGES}",
                    f"{side.cpu_s:.1f}",
                    ratio,
                    _number(side.f_score),
                    _number(side.chamfer_m, 1000, 2),
                    _number(side.refined_f_score),
                    _number(side.refined_chamfer_m, 1000, 2),
                )
            )
    return ResultTable("Ten images, photographs to chamfer distance", columns, tuple(rows))


def stage_table(results: dict[str, tuple[Side, ...]]) -> ResultTable:
    """CPU seconds by stage, a column per side."""
    sides = [(name, side) for name, pair in results.items() for side in pair]
    stages = list(dict.fromkeys(stage for _, side in sides for stage in side.stages))
    rows: list[tuple[Cell, ...]] = [
        (stage, *(_number(side.stages.get(stage), 1, 2) for _, side in sides)) for stage in stages
    ]
    rows.append(("everything", *(_number(side.cpu_s, 1, 2) for _, side in sides)))
    columns = ("CPU s", *(f"{name}: {side.name}>" for name, side in sides))
    return ResultTable("CPU seconds by stage", columns, tuple(rows))


def _scored(
    case: Case, name: str, cloud: Cloud, stages: dict[str, float], start: float, registered: int, right: int
) -> Side:
    scoring = time.process_time()
    truth = ReferenceIndex(case.truth)
    found = score(truth, cloud, [_F_DISTANCE_M])
    end = time.process_time()
    motion, _ = icp_onto_reference(cloud, case.truth)
    refined = score(truth, cloud.transformed(motion), [_F_DISTANCE_M])
    return Side(
        name,
        {**stages, "Scoring": end - scoring},
        end - start,
        registered,
        right,
        **_figures(found, ""),
        **_figures(refined, "refined_"),
    )


def _figures(found: CloudScore, prefix: str) -> dict[str, Any]:
    return {f"{prefix}chamfer_m": found.chamfer.chamfer_m, f"{prefix}f_score": found.f_scores[_F_DISTANCE_M].f_score}


def _camera(case: Case) -> Intrinsics:
    return cameras_of(read_capture(case.folder)).cameras[0]


def _number(value: float | None, factor: float = 1.0, digits: int = 3) -> str | None:
    return None if value is None else f"{factor * value:.{digits}f}"
