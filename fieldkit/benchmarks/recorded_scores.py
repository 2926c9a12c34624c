"""The objective on a recorded rig: random subsets, each scored against what the other photographs saw."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from fieldkit.benchmarks.captures import rig_capture
from fieldkit.benchmarks.result import Cell, ResultTable, StudyResult, spread
from fieldkit.benchmarks.rigs import load_rig
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture, read_image
from fieldkit.captures.model import Capture
from fieldkit.clouds import Cloud
from fieldkit.evaluation.reference import Reference, build_reference
from fieldkit.planning.evaluation import Evaluation
from fieldkit.planning.fidelity import FidelityName
from fieldkit.planning.objective import Objective, ObjectiveSettings
from fieldkit.planning.recorded import RecordedSource
from fieldkit.progress import Progress
from fieldkit.reconstruction.dense import DepthMap, View, prepare_view, select_backend
from fieldkit.reconstruction.dense import Settings as DenseSettings
from fieldkit.reconstruction.pipeline import KnownPlot, place
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stage_times import StageTimer
from fieldkit.reporting.objective_plots import draw_subsets, png

RIG, VIEWS = "basil_rig", 13
LEAST_WITNESSES = 3
LIMIT_S = 5.0


def run_recorded(
    data: Path,
    *,
    subsets: int = 20,
    fidelity: FidelityName = "standard",
    cache: StageCache,
    progress: Progress,
) -> StudyResult:
    """Random 13-view subsets of basil_rig by the objective, against the points that held-out views also saw.

    Not wholly independent: the held-out views' depth maps took the subset's views as sources too.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    rig = load_rig(data, RIG, cache=cache, progress=progress)
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
        folder, reference = Path(temporary) / "rig", Path(temporary) / "reference"
        build_reference(data / RIG / "images", reference, cache=cache, progress=progress, scene=False)
        rig_capture(folder, rig, rig.names, rig.nominal, rig.accuracy_m)
        read = Reference(reference)
        plot, capture = read.known_plot(), read_capture(folder)
        source = RecordedSource(capture, plot, read.cloud, cache=cache)
        names = [view.name for view in source.views]
        seen = witnesses(read.cloud, rig.capture, names, plot, cache, progress)
        rng = np.random.default_rng([0, 31])
        chosen = [np.sort(rng.choice(len(names), VIEWS, replace=False)) for _ in range(subsets)]
        settings = ObjectiveSettings(fidelity)
        with progress.stage("cache", 1):  # features and views of all photographs, once
            for start in range(0, len(names), VIEWS):
                index = np.arange(start, min(start + VIEWS, len(names)))
                if len(index) > 1:
                    Objective(source, settings).evaluate(source.cameras(index))
        fair, whole = [], []
        with progress.stage(f"{subsets} subsets", subsets) as advance:
            for index in chosen:
                held_out = np.setdiff1d(np.arange(len(names)), index)
                truth = read.cloud.select(seen[:, held_out].sum(axis=1) >= LEAST_WITNESSES)
                own = RecordedSource(capture, plot, truth, cache=cache)
                own.prepare()
                fair.append(Objective(own, settings).evaluate(own.cameras(index)))
                whole.append(len(truth) / len(read.cloud))
                advance(1)
    values = [e.value_m for e in fair]
    order = np.argsort(values)
    centers = np.array([view.pose.center for view in source.views])
    return StudyResult(
        name="recorded",
        title="The objective on a recorded set",
        tables=(summary_table(fair, whole), subset_table(fair)),
        notes=(
            f"{subsets} random subsets of {VIEWS} of {len(names)} views of {RIG}, {fidelity}, with the rig's poses.",
            f"Truth: the full reference's points that {LEAST_WITNESSES} views outside the subset saw at their depth;",
            "their depth maps and the points' places still come from stereo that also used the subset's views.",
            "CPU seconds of an evaluation with features and undistorted views in the cache.",
        ),
        figures={
            "subsets": [[names[int(k)] for k in index] for index in chosen],
            "evaluations": [e.figures() for e in fair],
            "cpu_s": [e.cpu_s for e in fair],
            "stages": {s.name: [_of(e, s.name) for e in fair] for s in fair[0].times},
            "reference_share": whole,
            "gap_spearman": float(spearmanr([largest_gap_deg(centers[i], centers) for i in chosen], values).statistic),
        },
        pictures={"recorded.png": png(draw_subsets(centers, chosen[order[0]], chosen[order[-1]], values))},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def witnesses(
    cloud: Cloud, capture: Capture, names: Sequence[str], plot: KnownPlot, cache: StageCache, progress: Progress
) -> NDArray[np.bool_]:
    """Which views (n) saw each reference point (m) at its depth: (m, n), from depth maps of all views.

    Args:
        cloud: of the reference.
        capture: all photographs, as the reference was built from them.
        names: of the n views.
        plot: of the reference.
        cache: has the depth maps, if the reference was built with it.
        progress: told of stages.
    """
    settings, dense = ReconstructionSettings(), DenseSettings()
    sparse, _ = place(capture, settings, [], cache, StageTimer(progress), 1, None)
    views = [
        prepare_view(name, read_image(capture.photo(name)), sparse.intrinsics[name], pose, settings.fidelity)
        for name, pose in sparse.poses.items()
    ]
    maps = select_backend("cpu").compute_depth_maps(
        views, plot.volume, dense, seed=settings.seed, progress=progress, cache=cache
    )
    by_name = {view.name: (view, found) for view, found in zip(views, maps, strict=True)}
    seen = np.zeros((len(cloud), len(names)), dtype=np.bool_)
    for k, name in enumerate(names):
        if name in by_name:
            seen[:, k] = _seen(cloud, *by_name[name], dense.max_relative_depth)
    return seen


def _seen(cloud: Cloud, view: View, found: DepthMap, tolerance: float) -> NDArray[np.bool_]:
    local = view.pose.to_camera(cloud.points)
    with np.errstate(invalid="ignore", divide="ignore"):
        pixels = np.floor(view.intrinsics.project(local))
    height, width = found.depth.shape
    inside = (local[:, 2] > 0) & (pixels >= 0).all(axis=1) & (pixels < (width, height)).all(axis=1)
    seen = np.zeros(len(cloud), dtype=np.bool_)
    columns, rows = pixels[inside].astype(np.int64).T
    depth = found.depth[rows, columns]
    seen[inside] = (depth > 0) & (np.abs(depth - local[inside, 2]) <= tolerance * local[inside, 2])
    return seen


def largest_gap_deg(centers: NDArray[np.float64], everything: NDArray[np.float64]) -> float:
    """The widest gap between neighbours of a subset on the rig's circle, degrees."""
    away = centers[:, :2] - everything[:, :2].mean(axis=0)
    angles = np.sort(np.degrees(np.arctan2(away[:, 1], away[:, 0])))
    return float(np.diff(np.append(angles, angles[0] + 360.0)).max())


def summary_table(found: Sequence[Evaluation], shares: Sequence[float]) -> ResultTable:
    """One row of all subsets."""
    row: tuple[Cell, ...] = (
        len(found), spread([1000 * e.value_m for e in found], 2),
        f"{1000 * np.std([e.value_m for e in found]):.2f}",
        f"{np.mean([e.right for e in found]):.1f} of {found[0].images}",
        f"{100 * np.mean(shares):.1f} %", spread([e.cpu_s for e in found]), f"{LIMIT_S:.0f}",
    )  # fmt: skip
    columns = (
        "subsets>",
        "value, mm>",
        "standard deviation, mm>",
        "right>",
        "reference kept>",
        "CPU s each>",
        "allowed>",
    )
    return ResultTable("Random subsets of a recorded rig", columns, (row,))


def subset_table(found: Sequence[Evaluation]) -> ResultTable:
    """CPU seconds by stage, medians over the subsets."""
    stages = list(dict.fromkeys(s.name for e in found for s in e.times))
    rows: list[tuple[Cell, ...]] = [(s, f"{np.median([_of(e, s) for e in found]):.2f}") for s in stages]
    return ResultTable("CPU seconds of one evaluation, warm cache", ("stage", "CPU s>"), tuple(rows))


def _of(evaluation: Evaluation, stage: str) -> float:
    return sum(s.cpu_s for s in evaluation.times if s.name == stage)
