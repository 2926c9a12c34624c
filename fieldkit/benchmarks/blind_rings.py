"""What blind incremental mapping makes of uniform rings around a rendered field, as it is known of the real rigs."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from fieldkit.benchmarks.result import Cell, ResultTable, StudyResult, spread
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.geometry import Intrinsics
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.progress import Progress
from fieldkit.reconstruction.blind_mapping import map_blindly
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stages import exhaustive_pairs, load_features, load_pairs
from fieldkit.scenes.fields import field_scene
from fieldkit.scenes.plot import build_scene
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.rigs import ring
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.simulate import CaptureNoise, simulate_capture

COUNTS = (10, 13, 16, 20)
REAL = (
    ("basil_rig (recorded figures)", "3 of 10", "2 of 13", "9 of 16", "12 of 20"),
    ("arabidopsis_rig (recorded figures)", None, None, None, "2 of 20"),
)
"""Registered in the largest model, 8 seeds; from the same recordings as the match counts."""


@dataclass(frozen=True)
class RingRun:
    """One mapping of one ring.

    Attributes:
        name: of the scene.
        views: in the ring.
        seed: of the mapper.
        registered: images in the largest model.
        models: sizes of all models.
        rms_m: of its centres against the true ones after a similarity fit; None below three images.
    """

    name: str
    views: int
    seed: int
    registered: int
    models: tuple[int, ...]
    rms_m: float | None


def run_blind_rings(
    rendered: Sequence[tuple[str, int]] = (("tuning", 0), ("tuning", 1), ("test", 0)), *, progress: Progress
) -> StudyResult:
    """Rings around rendered fields."""
    wall, cpu = time.perf_counter(), time.process_time()
    runs: list[RingRun] = []
    for split, index in rendered:
        runs += map_rings(f"{split} {index}", build_scene(field_scene(split, index)), progress=progress)
    return StudyResult(
        name="blind-rings",
        title="Blind mapping of rings around rendered fields",
        tables=(ring_table(runs),),
        notes=(
            "The largest model, medians over 3 seeds of the mapper; exact intrinsics, held fixed; fieldkit's features.",
            "RMS against the true centres after a similarity fit; a model of fewer than three images has none.",
        ),
        figures={"runs": [asdict(run) for run in runs]},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def map_rings(
    name: str, scene: Scene, *, counts: Sequence[int] = COUNTS, seeds: int = 3, progress: Progress
) -> list[RingRun]:
    """Photograph rings of a scene and map them blindly, with the exact intrinsics, held fixed."""
    camera = Intrinsics.pinhole(2000, 1500, 1700.0)
    runs = []
    with Renderer(scene) as renderer, tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        for count in counts:
            target = Path(folder) / f"ring-{count}"
            poses = simulate_capture(
                target, renderer, ring(count, 1.45, 1.15), camera, noise=CaptureNoise(), seed=count, progress=progress
            )
            for seed, (sizes, centers) in enumerate(_map(target, camera, seeds, progress)):
                rms = None
                if len(centers) >= 3:
                    index = sorted(centers)
                    source = np.array([centers[i] for i in index])
                    true = np.array([poses[i].center for i in index])
                    error = fit_similarity(source, true).apply(source) - true
                    rms = float(np.sqrt((error**2).sum(axis=1).mean()))
                runs.append(RingRun(name, count, seed, len(centers), sizes, rms))
                progress.note(f"{name}, ring of {count}, seed {seed}: {sizes or 'no model'}")
    return runs


def ring_table(runs: Sequence[RingRun]) -> ResultTable:
    """Registered images by ring, medians over seeds, with the recorded rigs' figures above."""
    counts = sorted({run.views for run in runs})
    rows: list[tuple[Cell, ...]] = [
        (name, *(dict(zip(COUNTS, cells, strict=True)).get(count) for count in counts)) for name, *cells in REAL
    ]
    for name in dict.fromkeys(run.name for run in runs):
        cells = []
        for count in counts:
            group = [run for run in runs if run.name == name and run.views == count]
            errors = [None if run.rms_m is None else 1000 * run.rms_m for run in group]
            cells.append(f"{spread([run.registered for run in group], 0)} of {count}, {spread(errors)} mm")
        rows.append((name, *cells))
    columns = ("set", *(f"ring of {count}>" for count in counts))
    return ResultTable("Blind incremental mapping: registered, and RMS of the centres", columns, tuple(rows))


def _map(
    folder: Path, camera: Intrinsics, seeds: int, progress: Progress
) -> list[tuple[tuple[int, ...], dict[int, np.ndarray]]]:
    settings = ReconstructionSettings()
    photos = read_capture(folder).photos
    names = [photo.name for photo in photos]
    with progress.stage(f"Features of {len(photos)}", len(photos)) as advance:
        keyed = load_features(photos, settings.features, cache=StageCache(None), workers=1, advance=advance)
    wanted = exhaustive_pairs(len(photos), [None] * len(photos), len(photos))
    with progress.stage(f"Pairs of {len(photos)}", len(wanted)) as advance:
        pairs, _ = load_pairs(
            keyed, [camera], [0] * len(photos), wanted, settings.verification, calibrated=True, seed=0,
            cache=StageCache(None), workers=1, advance=advance,
        )  # fmt: skip
    found = []
    for seed in range(seeds):
        mapping = map_blindly(
            "incremental", names, [k.features for k in keyed], [camera], [0] * len(names), pairs,
            fixed_intrinsics=True, seed=seed,
        )  # fmt: skip
        sizes = tuple(int(model.num_reg_images()) for model in mapping.models)
        poses = model_poses(mapping.models[0]) if mapping.models else {}
        found.append((sizes, {names.index(name): pose.center for name, pose in poses.items()}))
    return found
