"""References of the recorded sets, built by the command's function and compared with known data."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.result import Cell, ResultTable, StudyResult
from fieldkit.cache import StageCache
from fieldkit.clouds import Cloud, icp, read_cloud, read_las
from fieldkit.clouds.neighbors import PointIndex
from fieldkit.evaluation.reference import build_reference
from fieldkit.geometry import Similarity
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.pictures.overview import OVERVIEW_FILE, write_overviews
from fieldkit.results.evaluation import CLOUD_FILE, SCENE_FILE, ReferenceReport
from fieldkit.results.report_files import load_reference_report
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress

SETS = ("basil_rig", "arabidopsis_rig", "drone_trees")
RECALL_DISTANCES_M = (0.002, 0.005, 0.010)
_ICP_REACH_M = 0.02


@dataclass(frozen=True)
class ReferenceResult:
    """The reference of one recorded set."""

    name: str
    """Of the set."""
    images: int
    registered: int
    right: int
    """Photographs given, posed, and posed in agreement with the known positions."""
    position_rms_m: float | None
    """Of the known positions' residuals in the metric frame, as reported."""
    aligned_rms_m: float | None
    """The same after the least-squares similarity between both sets of centres."""
    points: int
    scene_points: int | None
    """Of cloud.ply and scene.ply."""
    recall: dict[float, float] | None
    """Share of the published cloud's points within each distance of scene.ply, after ICP; None without a cloud."""
    crs_epsg: int | None
    """Of the LAZ file; None without one."""
    seconds: float
    cpu_seconds: float
    """Of the whole run."""


def run_references(data: Path, *, cache: StageCache, progress: Progress) -> StudyResult:
    """References of all recorded sets, ground included."""
    results, pictures = [], {}
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        for name in SETS:
            results.append(reference_of_set(name, data, Path(folder), cache=cache, progress=progress))
            write_overviews(Path(folder) / name, load_reference_report(Path(folder) / name))
            pictures[f"{name}.png"] = (Path(folder) / name / OVERVIEW_FILE).read_bytes()
    return StudyResult(
        name="references",
        title="References of the recorded sets",
        tables=(reference_table(results),),
        notes=(
            "fieldkit reference with its defaults (standard, plant mask), one worker, stage cache as it was found.",
            "RMS: camera centres against the known positions; aligned: after the least-squares similarity.",
            "Share of the published cloud's points within 2, 5 and 10 mm of scene.ply, after ICP.",
        ),
        figures={"references": [asdict(result) for result in results]},
        pictures=pictures,
    )


def reference_table(results: Sequence[ReferenceResult]) -> ResultTable:
    """A row per set."""
    columns = (
        "set",
        "registered (right)",
        "RMS, m>",
        "aligned, m>",
        "points>",
        "scene points>",
        "published cloud within>",
        "LAZ, EPSG>",
        "CPU s>",
    )
    rows: list[tuple[Cell, ...]] = []
    for r in results:
        recall = None if r.recall is None else " / ".join(f"{100 * share:.1f}" for share in r.recall.values()) + " %"
        rms, aligned = (None if v is None else f"{v:.4f}" for v in (r.position_rms_m, r.aligned_rms_m))
        scene = None if r.scene_points is None else f"{r.scene_points:,}"
        rows.append(
            (
                r.name,
                f"{r.registered} ({r.right}) of {r.images}",
                rms,
                aligned,
                f"{r.points:,}",
                scene,
                recall,
                r.crs_epsg,
                f"{r.cpu_seconds:.0f}",
            )
        )
    return ResultTable("fieldkit reference", columns, tuple(rows))


def reference_of_set(name: str, data: Path, output: Path, *, cache: StageCache, progress: Progress) -> ReferenceResult:
    """Build the reference of ``data``/``name``/images and compare it with known data of the set."""
    folder = output / name
    report = build_reference(data / name / "images", folder, context=Context(cache, progress))
    published = data / name / "reference_cloud.ply"
    recall = None
    if published.is_file():
        # The rigs' files are in millimetres, poses.csv and so our source frame in metres.
        known = read_cloud(published).transformed(Similarity(0.001, np.eye(3), np.zeros(3)))
        to_plot = report.frame.of_source(report.metric_source).from_source
        recall = recall_of(known.transformed(to_plot), read_cloud(folder / SCENE_FILE))
    laz = (folder / CLOUD_FILE).with_suffix(".laz")
    return ReferenceResult(
        name=name,
        images=report.images,
        registered=report.registered,
        right=report.right,
        position_rms_m=report.pose_rms_m,
        aligned_rms_m=_aligned_rms(report),
        points=report.points,
        scene_points=report.scene_points,
        recall=recall,
        crs_epsg=read_las(laz).crs.to_epsg() if laz.is_file() else None,
        seconds=report.seconds,
        cpu_seconds=report.cpu_seconds,
    )


def recall_of(known: Cloud, scene: Cloud) -> dict[float, float]:
    """Share of ``known``'s points within each distance of ``scene``, after ICP between the two."""
    motion, _ = icp(known, scene, max_distance_m=_ICP_REACH_M)
    distances, _ = PointIndex(scene.points).nearest(known.transformed(motion).points)
    return {limit: float(np.mean(distances <= limit)) for limit in RECALL_DISTANCES_M}


def _aligned_rms(report: ReferenceReport) -> float | None:
    pairs = [(i.center_m, i.known_center_m) for i in report.image_reports if i.center_m and i.known_center_m]
    if len(pairs) < 3:
        return None
    found, known = (np.array(column) for column in zip(*pairs, strict=True))
    residual = fit_similarity(found, known).apply(found) - known
    return float(np.sqrt((residual**2).sum(axis=1).mean()))
