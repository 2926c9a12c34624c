"""Dense stereo alone: ten rendered views with known poses, `standard`, against OpenCV's semi-global matching."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.captures import RenderedPlot, rendered_plot
from benchmarks.result import ResultTable, StudyResult
from benchmarks.scenes import Split, benchmark_cameras
from benchmarks.sgbm import sgbm_depth_maps
from fieldkit.arrays import ByteArray
from fieldkit.clouds import Cloud, score
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense import View, compute_depth_maps, fuse, prepare_view, resolution
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.renderer import Renderer

IMAGES = 10
DISTANCES_M = (0.005, 0.010, 0.020)
_IMAGE_SIGMA = 2.0
_SPLITS: tuple[Split, ...] = ("tuning", "test")


@dataclass(frozen=True)
class DenseRun:
    """A method on a scene."""

    scene: str
    method: str
    prepare_s: float
    depth_s: float
    fusion_s: float
    """CPU seconds for reduction to working size with the mask, depth maps, fusion."""
    points: int
    chamfer_m: float
    f_score: dict[float, float]
    precision: dict[float, float]
    recall: dict[float, float]
    """By distance in metres."""

    @property
    def cpu_s(self) -> float:
        return self.prepare_s + self.depth_s + self.fusion_s


def run_dense(*, progress: Progress) -> StudyResult:
    """Run both methods on the tuning and the test scenes."""
    runs: list[DenseRun] = []
    for split in _SPLITS:
        for index in (0, 1):
            with progress.stage(f"{split} scene {index}"):
                plot = rendered_plot(split, index)
                poses, intrinsics = benchmark_cameras(IMAGES)
                photographs = photograph(plot, poses, intrinsics)
                if not runs:
                    warm_up(photographs, poses, intrinsics, plot.volume)
                runs += measure(f"{split} {index}", photographs, poses, intrinsics, plot.volume, plot.truth)
    return StudyResult(
        name="dense",
        title="Dense stereo alone",
        tables=(dense_table(runs),),
        notes=(
            f"{IMAGES} views of 2000 × 1500 pixels with exact poses, sensor noise of {_IMAGE_SIGMA:g} grey levels.",
            "Reduced to 2 mm per pixel at the plants (standard), plant mask, one thread, nothing from the cache.",
            "The kernels were compiled before. Truth: the plants' visible surface above 30 mm.",
            "Constants were tuned on the tuning scenes only.",
        ),
        figures={"runs": [{**asdict(run), "cpu_s": run.cpu_s} for run in runs]},
    )


def photograph(plot: RenderedPlot, poses: Sequence[Pose], intrinsics: Intrinsics) -> list[ByteArray]:
    """Noisy photographs of the plot."""
    rng = np.random.default_rng(0)
    images = []
    with Renderer(plot.scene) as renderer:
        for pose in poses:
            clean = renderer.photograph(pose, intrinsics)
            noise = rng.standard_normal(clean.shape, dtype=np.float32) * np.float32(_IMAGE_SIGMA)
            images.append(np.asarray(np.clip(np.rint(clean + noise), 0, 255), dtype=np.uint8))
    return images


def measure(
    scene: str,
    photographs: Sequence[ByteArray],
    poses: Sequence[Pose],
    intrinsics: Intrinsics,
    volume: Volume,
    truth: Cloud,
) -> list[DenseRun]:
    """Run both methods on the same photographs."""
    runs = []
    for method in ("PatchMatch (fieldkit)", "SGBM (OpenCV), 3 pairs"):
        start = time.process_time()
        views = _views(photographs, poses, intrinsics, volume)
        prepared = time.process_time()
        if method.startswith("SGBM"):
            maps = sgbm_depth_maps(views, volume)
        else:
            maps = compute_depth_maps(views, volume, seed=0, context=Context())
        matched = time.process_time()
        cloud, _ = fuse(views, maps, volume)
        fused = time.process_time()
        found = score(truth, cloud, DISTANCES_M)
        runs.append(
            DenseRun(
                scene,
                method,
                prepared - start,
                matched - prepared,
                fused - matched,
                len(cloud),
                found.chamfer.chamfer_m,
                {d: s.f_score for d, s in found.f_scores.items()},
                {d: s.precision for d, s in found.f_scores.items()},
                {d: s.recall for d, s in found.f_scores.items()},
            )
        )
    return runs


def warm_up(photographs: Sequence[ByteArray], poses: Sequence[Pose], intrinsics: Intrinsics, volume: Volume) -> None:
    """Compile the kernels."""
    views = _views(photographs[:3], poses[:3], intrinsics, volume)
    maps = compute_depth_maps(views, volume, seed=0, context=Context())
    fuse(views, maps, volume)


def dense_table(runs: Sequence[DenseRun]) -> ResultTable:
    """A row per scene and method."""
    columns = (
        "scene",
        "method",
        "CPU s>",
        "of these prepare>",
        "depth>",
        "fusion>",
        "F at 5 mm>",
        "F at 10 mm>",
        "F at 20 mm>",
        "precision, recall at 10 mm>",
        "chamfer, mm>",
        "points>",
    )
    rows = tuple(
        (
            run.scene,
            run.method,
            f"{run.cpu_s:.1f}",
            f"{run.prepare_s:.1f}",
            f"{run.depth_s:.1f}",
            f"{run.fusion_s:.1f}",
            *(f"{run.f_score[d]:.3f}" for d in DISTANCES_M),
            f"{run.precision[0.010]:.3f}, {run.recall[0.010]:.3f}",
            f"{1000 * run.chamfer_m:.2f}",
            f"{run.points:,}",
        )
        for run in runs
    )
    return ResultTable("Ten views, known poses", columns, rows)


def _views(
    photographs: Sequence[ByteArray], poses: Sequence[Pose], intrinsics: Intrinsics, volume: Volume
) -> list[View]:
    size = (intrinsics.width, intrinsics.height)
    return [
        prepare_view(f"{i:02d}", image, intrinsics, pose, resolution(size, intrinsics, pose, volume, "standard").size)
        for i, (image, pose) in enumerate(zip(photographs, poses, strict=True))
    ]
