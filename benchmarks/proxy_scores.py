"""Rank correlation of a reference's proxy with the reference's photographs, over sets of views."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from benchmarks.captures import rig_capture
from benchmarks.curves import draw_agreement
from benchmarks.recorded_scores import BANDS_PX, RIG, VIEWS
from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.rigs import RigSet, load_rig
from fieldkit.arrays import IntArray
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.evaluation.proxy import make_proxy
from fieldkit.evaluation.reference import Reference, build_reference
from fieldkit.geometry import Pose
from fieldkit.pictures.panels import png
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings, PhotoSource
from fieldkit.planning.objective.recorded import RecordedSource
from fieldkit.planning.objective.simulated import Proxy, SimulatedSource
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.scene_file import read_scene
from fieldkit.vocabulary import SearchFidelity

REAL, REAL_DENSE = "photographs", "photographs, poses of all"
Found = Mapping[str, Sequence[Evaluation]]


def view_sets(count: int, views: int, seed: int = 0) -> dict[str, IntArray]:
    """Ten sets of ``views`` out of ``count`` views around a circle, from even to clumped: names and sorted indices."""
    if count < 2 * views:
        raise ValueError(f"{views} of {count} views leave little to choose")
    sets = {
        "ring": _along(count, views, 360.0),
        "arc of 270°": _along(count, views, 270.0),
        "arc of 180°": _along(count, views, 180.0, count // 3),
        "arc of 120°": _along(count, views, 120.0, count // 6),
        "neighbours": np.arange(views) + count // 2,
        "two clumps": _clumps(count, views, 2),
        "three clumps": _clumps(count, views, 3),
    }
    for k in range(3):
        sets[f"random {k + 1}"] = np.random.default_rng([seed, 33, k]).choice(count, views, replace=False)
    return {name: np.sort(index % count).astype(np.int64) for name, index in sets.items()}


def _along(count: int, views: int, arc_deg: float, start: int = 0) -> IntArray:
    steps = views if arc_deg >= 360.0 else views - 1
    index: IntArray = np.rint(start + np.arange(views) * (count * arc_deg / 360.0 / steps)).astype(np.int64)
    return index


def _clumps(count: int, views: int, clumps: int) -> IntArray:
    parts = np.array_split(np.arange(views), clumps)
    return np.concatenate([round(k * count / clumps) + np.arange(len(part)) for k, part in enumerate(parts)])


def run_proxy(
    data: Path,
    *,
    rig_name: str = RIG,
    views: int = VIEWS,
    fidelities: Sequence[SearchFidelity] = ("standard", "draft"),
    effects: CameraEffects | None = None,
    sets: Sequence[str] | None = None,
    cache: StageCache,
    progress: Progress,
) -> StudyResult:
    """Sets of views of a rig by the objective: on its photographs, and on renderings of the proxy at the same poses.

    Args:
        data: folder of the recorded sets.
        rig_name: one of them.
        views: in each set.
        fidelities: of the renderings; the photographs are evaluated at the first one.
        effects: camera effects of the renderings; None takes the scene file's.
        sets: names of `view_sets`; None takes all.
    """
    rig = load_rig(data, rig_name, cache=cache, progress=progress)
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
        root, images = Path(temporary), data / rig_name / "images"
        build_reference(images, root / "reference", context=Context(cache, progress))
        made = make_proxy(root / "reference", root / "proxy", images=images, progress=progress)
        read, description = Reference(root / "reference"), read_scene(made.scene)
        commanded = _source(root / "commanded", rig, rig.nominal, read, cache)
        dense = _source(root / "dense", rig, rig.dense, read, cache)
        chosen = {
            name: index for name, index in view_sets(len(rig.names), views).items() if sets is None or name in sets
        }
        order = [rig.names.index(view.name) for view in commanded.views]
        asked = [[order.index(int(k)) for k in index] for index in chosen.values()]
        proxy = SimulatedSource(
            Proxy.from_description(description),
            description.noise,
            effects=effects or description.camera_effects,
            claimed_m=rig.accuracy_m,
        )
        found: dict[str, list[Evaluation]] = {
            REAL: _evaluated(REAL, commanded, [commanded.cameras(i) for i in asked], fidelities[0], progress),
            REAL_DENSE: _evaluated(REAL_DENSE, dense, [dense.cameras(i) for i in asked], fidelities[0], progress),
        }
        try:
            for fidelity in fidelities:
                # Poses of the photographs in the model of all of them.
                cameras = [dense.cameras(i) for i in asked]
                found[f"proxy, {fidelity}"] = _evaluated(f"proxy, {fidelity}", proxy, cameras, fidelity, progress)
        finally:
            proxy.close()
    ranks = rank_correlations(found)
    values = {name: [e.value_m for e in each] for name, each in found.items()}
    first = f"proxy, {fidelities[0]}"
    return StudyResult(
        name="proxy",
        title="Does a proxy rank sets of views as the photographs do?",
        tables=(value_table(list(chosen), found), rank_table(ranks)),
        notes=(
            f"Sets of {views} of {len(rig.names)} views of {rig_name}; photographs at {fidelities[0]}.",
            "The proxy: `fieldkit scene from-reference --images` of all of them, rendered from where they were taken.",
            f"Both are scored against the reference of all photographs; mapping knows poses to {rig.accuracy_m} m.",
            (
                f"“{REAL}” places clouds by the rig's commanded positions, which are {1000 * rig.rms_m:.1f} mm off; "
                f"“{REAL_DENSE}” by those of the model of all photographs, as the proxy does."
            ),
        ),
        figures={
            "sets": {name: [rig.names[int(k)] for k in index] for name, index in chosen.items()},
            "values_m": values,
            "chamfer_m": {name: [e.chamfer_m for e in each] for name, each in found.items()},
            "completeness_m": {name: [e.completeness_m for e in each] for name, each in found.items()},
            "right": {name: [e.right for e in each] for name, each in found.items()},
            "cpu_s": {name: [e.cpu_s for e in each] for name, each in found.items()},
            "spearman": ranks,
        },
        pictures={
            "proxy.png": png(
                draw_agreement(
                    {name: (values[name], values[first]) for name in (REAL, REAL_DENSE)}, ("photographs", "proxy")
                )
            )
        },
    )


def _source(
    folder: Path, rig: RigSet, poses: Mapping[str, Pose], reference: Reference, cache: StageCache
) -> RecordedSource:
    rig_capture(folder, rig, rig.names, poses, rig.accuracy_m)
    source = RecordedSource(read_capture(folder), reference.known_plot(), reference.cloud, cache=cache)
    source.prepare()
    return source


def _evaluated(
    title: str, source: PhotoSource, sets: Sequence[Cameras], fidelity: SearchFidelity, progress: Progress
) -> list[Evaluation]:
    objective = Objective(source, ObjectiveSettings(fidelity, bands_px=BANDS_PX))
    found = []
    with progress.stage(title, len(sets)) as advance:
        for cameras in sets:
            found.append(objective.evaluate(cameras))
            advance(1)
    return found


def rank_correlations(found: Found) -> dict[str, dict[str, float]]:
    """Spearman's rank correlation between all ways to evaluate."""
    values = {name: [e.value_m for e in each] for name, each in found.items()}
    return {a: {b: float(spearmanr(values[a], values[b]).statistic) for b in values} for a in values}


def value_table(names: Sequence[str], found: Found) -> ResultTable:
    """A row for each set: its value by each way, and the number of right views unless all are."""
    rows: list[tuple[Cell, ...]] = [
        (
            name,
            *(
                f"{1000 * each[k].value_m:.2f}"
                + ("" if each[k].right == len(each[k].views) else f" ({each[k].right} of {len(each[k].views)})")
                for each in found.values()
            ),
        )
        for k, name in enumerate(names)
    ]
    return ResultTable("Values, mm", ("set", *(f"{name}>" for name in found)), tuple(rows))


def rank_table(ranks: Mapping[str, Mapping[str, float]]) -> ResultTable:
    """Spearman's rank correlations."""
    rows: list[tuple[Cell, ...]] = [(a, *(f"{row[b]:.2f}" for b in ranks)) for a, row in ranks.items()]
    return ResultTable("Spearman", ("", *(f"{name}>" for name in ranks)), tuple(rows))
