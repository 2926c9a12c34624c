"""Blind incremental mapping of uniform rings, on the recorded rigs and on rendered scenes."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.result import Cell, ResultTable, StudyResult, spread
from benchmarks.rigs import RIG_FILE, read_rig, uniform_subset
from benchmarks.scene_views import SceneUnderStudy, load_scene, photograph, ring_about_plants, study_scenes
from fieldkit.captures import Photo, read_capture
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.cameras import guessed_camera
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.features import FeatureSettings
from fieldkit.reconstruction.mapping.blind import map_blindly
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stages import exhaustive_pairs, load_features, load_pairs
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.renderer import Renderer

COUNTS = (10, 13, 16, 20)
RIGS = ("basil_rig", "arabidopsis_rig")
FEATURES = {"": FeatureSettings(), " *": FeatureSettings(max_features=8192, contrast_threshold=0.04)}
"""fieldkit's own, and (starred) those of the recorded figures."""

RECORDED = (
    ("basil_rig (recorded figures) *", "3 of 10", "2 of 13", "9 of 16", "12 of 20"),
    ("arabidopsis_rig (recorded figures) *", None, None, None, "2 of 20"),
)
"""Registered with 8 seeds; basil's 9 of 16 are in two models."""

Centers = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True)
class RingRun:
    """A mapping of a ring."""

    name: str
    """Of the set or scene, marked by its features."""
    views: int
    """In the ring."""
    seed: int
    """Of the mapper."""
    registered: int
    """Images in the largest model."""
    models: tuple[int, ...]
    """Sizes of all models."""
    rms_m: float | None
    """Of the largest model's centres against the known ones after a similarity fit; None below three images."""
    neighbours: float
    """Median of verified matches of neighbouring views."""


def run_blind_rings(
    data: Path | None, scenes: Sequence[str] = (), *, counts: Sequence[int] = COUNTS, progress: Progress
) -> StudyResult:
    """Map rings of the recorded rigs (if ``data`` is given) and about rendered scenes.

    Args:
        data: folder of the recorded sets, or None.
        scenes: as `study_scenes` takes them.
        counts: numbers of views of the rings.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    runs: list[RingRun] = []
    for name in RIGS if data is not None else ():
        assert data is not None
        runs += rig_rings(data, name, counts, progress=progress)
    for name in study_scenes(scenes):
        runs += scene_rings(load_scene(name), counts, progress=progress)
    return StudyResult(
        name="blind-rings",
        title="Blind mapping of rings",
        tables=(ring_table(runs),),
        notes=(
            "Registered in the largest model, median over 3 seeds; in brackets verified matches of neighbours, median.",
            "RMS of the largest model's centres against the known ones after a similarity fit.",
            "Rigs and scenes alike are self-calibrated from a guessed focal length.",
            "Features are fieldkit's; with * 8192 at OpenCV's own contrast threshold, as in the recorded figures.",
            *(() if data is not None else ("Without FIELDKIT_DATA the rigs are left out.",)),
        ),
        figures={"runs": [asdict(run) for run in runs]},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def rig_rings(data: Path, name: str, counts: Sequence[int] = COUNTS, *, progress: Progress) -> list[RingRun]:
    """Uniform subsets of a recorded rig."""
    photos = {photo.name: photo for photo in read_capture(data / name / "images").photos}
    centers = {n: position for n, (position, _) in read_rig(data / name / RIG_FILE).items() if n in photos}
    runs = []
    for count in counts:
        subset = [photos[n] for n in uniform_subset(list(centers), count)]
        runs += map_ring(name, subset, centers, progress=progress)
    return runs


def scene_rings(study: SceneUnderStudy, counts: Sequence[int] = COUNTS, *, progress: Progress) -> list[RingRun]:
    """Rings about the plants of a rendered scene."""
    runs = []
    with Renderer(study.scene) as renderer, tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        for count in counts:
            target = Path(folder) / f"ring-{count}"
            poses = photograph(target, study, renderer, ring_about_plants(study.description, count), count, progress)
            photos = read_capture(target).photos
            centers = {photo.name: pose.center for photo, pose in zip(photos, poses, strict=True)}
            runs += map_ring(study.name, photos, centers, progress=progress)
    return runs


def map_ring(
    name: str, photos: Sequence[Photo], centers: Centers, *, seeds: int = 3, progress: Progress
) -> list[RingRun]:
    """Map a ring's photographs blindly, once for each kind of features and each seed."""
    runs = []
    for mark, settings in FEATURES.items():
        for seed, (sizes, found, neighbours) in enumerate(_map(photos, settings, seeds, progress)):
            runs.append(RingRun(name + mark, len(photos), seed, len(found), sizes, _rms(found, centers), neighbours))
            progress.note(f"{name}{mark}, ring of {len(photos)}, seed {seed}: {sizes or 'no model'}")
    return runs


def ring_table(runs: Sequence[RingRun]) -> ResultTable:
    """Registered images by ring, medians over seeds, with the recorded figures in the first rows."""
    counts = sorted({run.views for run in runs})
    rows: list[tuple[Cell, ...]] = [
        (name, *(dict(zip(COUNTS, cells, strict=True)).get(count) for count in counts)) for name, *cells in RECORDED
    ]
    for name in dict.fromkeys(run.name for run in runs):
        cells = []
        for count in counts:
            group = [run for run in runs if run.name == name and run.views == count]
            if not group:
                cells.append("–")
                continue
            errors = [None if run.rms_m is None else 1000 * run.rms_m for run in group]
            rms = "" if all(error is None for error in errors) else f", {spread(errors)} mm"
            cells.append(f"{spread([run.registered for run in group], 0)} of {count}{rms} ({group[0].neighbours:.0f})")
        rows.append((name, *cells))
    columns = ("set", *(f"ring of {count}>" for count in counts))
    return ResultTable("Blind incremental mapping: registered, RMS, (matches of neighbours)", columns, tuple(rows))


def _rms(found: Centers, known: Centers) -> float | None:
    if len(found) < 3:
        return None
    names = sorted(found)
    source, true = np.array([found[n] for n in names]), np.array([known[n] for n in names])
    error = fit_similarity(source, true).apply(source) - true
    return float(np.sqrt((error**2).sum(axis=1).mean()))


def _map(
    photos: Sequence[Photo], settings: FeatureSettings, seeds: int, progress: Progress
) -> list[tuple[tuple[int, ...], Centers, float]]:
    """Sizes of all models, centres in the largest by name, and matches of neighbours, for each seed."""
    n, names = len(photos), [photo.name for photo in photos]
    camera = guessed_camera(photos[0].width, photos[0].height)
    with progress.stage(f"Features of {n}", n) as advance:
        keyed = load_features(photos, settings, advance=advance, context=Context())
    wanted = exhaustive_pairs(n, [None] * n, n)
    with progress.stage(f"Pairs of {n}", len(wanted)) as advance:
        pairs, _ = load_pairs(
            keyed, [camera], [0] * n, wanted, ReconstructionSettings().verification, calibrated=False, seed=0,
            advance=advance, context=Context())  # fmt: skip
    around = [tuple(sorted((i, (i + 1) % n))) for i in range(n)]
    neighbours = float(np.median([len(pairs[i, j].inliers) if (i, j) in pairs else 0 for i, j in around]))
    found: list[tuple[tuple[int, ...], Centers, float]] = []
    for seed in range(seeds):
        models = map_blindly(
            "incremental", names, [k.features for k in keyed], [camera], [0] * n, pairs, fixed_intrinsics=False,
            seed=seed,
        )  # fmt: skip
        sizes = tuple(int(model.num_reg_images()) for model in models)
        poses = model_poses(models[0]) if models else {}
        found.append((sizes, {name: pose.center for name, pose in poses.items()}, neighbours))
    return found
