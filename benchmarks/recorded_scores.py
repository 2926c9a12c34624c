"""The objective on a recorded rig: random subsets, scored against stereo of photographs that are never chosen."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from benchmarks.captures import rig_capture
from benchmarks.result import Cell, ResultTable, StudyResult, spread
from benchmarks.rigs import load_rig
from benchmarks.subset_plots import Subset, draw_subsets
from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture, read_image
from fieldkit.captures.model import Capture
from fieldkit.clouds import Cloud, score
from fieldkit.evaluation.reference import Reference, build_reference
from fieldkit.pictures.panels import png
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.objective.recorded import RecordedSource
from fieldkit.reconstruction.dense import compute_depth_maps, fuse, prepare_view, resolution
from fieldkit.reconstruction.pipeline import KnownPlot, place
from fieldkit.reconstruction.result import clearance
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stages import StageTimer
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.vocabulary import SearchFidelity

RIG, VIEWS = "basil_rig", 13
LIMIT_S = 5.0
BANDS_PX = (10.0, 3.0)
"""A rig's poses are known to some millimetres, so two rounds of guided matching suffice."""


def run_recorded(
    data: Path,
    *,
    subsets: int = 20,
    fidelity: SearchFidelity = "standard",
    cache: StageCache,
    progress: Progress,
    rig_name: str = RIG,
    views: int = VIEWS,
) -> StudyResult:
    """Random subsets of every other view of a rig by the objective, against dense stereo of the views between.

    The truth's depth maps use no photograph that a subset may contain. Both share only the frame and the truth's poses,
    which come from mapping all photographs.
    """
    rig = load_rig(data, rig_name, cache=cache, progress=progress)
    candidates, witnesses = split_rig(rig.names)
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
        folder, reference = Path(temporary) / "rig", Path(temporary) / "reference"
        build_reference(data / rig_name / "images", reference, context=Context(cache, progress), scene=False)
        rig_capture(folder, rig, candidates, rig.nominal, rig.accuracy_m)
        read = Reference(reference)
        plot, capture = read.known_plot(), read_capture(folder)
        truth = witnessed_cloud(rig.capture, witnesses, plot, cache, progress)
        whole = RecordedSource(capture, plot, read.cloud, cache=cache)
        fair = RecordedSource(capture, plot, truth, cache=cache)
        names = [view.name for view in fair.views]
        rng = np.random.default_rng([0, 31])
        chosen = [np.sort(rng.choice(len(names), views, replace=False)) for _ in range(subsets)]
        settings = ObjectiveSettings(fidelity, bands_px=BANDS_PX)
        against_whole, against_truth, clouds = [], [], []
        fair.prepare()
        with progress.stage(f"{subsets} subsets", subsets) as advance:
            for index in chosen:
                # The first fills the cache with features, views and pairs; only the second counts.
                against_whole.append(Objective(whole, settings).evaluate(whole.cameras(index)))
                found, cloud = Objective(fair, settings).evaluate_cloud(fair.cameras(index))
                against_truth.append(found)
                clouds.append(cloud)
                advance(1)
        every = Objective(fair, settings).evaluate(fair.cameras())
    values = [e.value_m for e in against_truth]
    order = np.argsort(values)
    centers = np.array([view.pose.center for view in fair.views])
    agreement = float(spearmanr(values, [e.value_m for e in against_whole]).statistic)
    shown = [
        Subset(name, clouds[int(order[k])], [int(i) for i in chosen[int(order[k])]], values[int(order[k])])
        for name, k in (("best subset", 0), ("worst subset", -1))
    ]
    return StudyResult(
        name="recorded",
        title="The objective on a recorded set",
        tables=(summary_table({"witnesses": against_truth, "all views": against_whole}, every),),
        notes=(
            (
                f"{subsets} random subsets of {views} of {len(candidates)} candidate views of {rig_name} (every other "
                f"one around the circle), {fidelity}, with the rig's poses, matched in bands of {BANDS_PX} px."
            ),
            (
                f"Truth: {len(truth):,} points of dense stereo of the {len(witnesses)} views between, none of which "
                "may be chosen; their poses come from mapping all photographs, the candidates among them."
            ),
            (
                f"For comparison the whole reference of all {len(rig.names)} views; Spearman of both values "
                f"{agreement:.2f}. Chamfer distance of the two truths: "
                f"{1000 * score(read.cloud, truth).chamfer.chamfer_m:.2f} mm."
            ),
            "CPU seconds of an evaluation with features, undistorted views and pairs in the cache.",
        ),
        figures={
            "candidates": candidates,
            "witnesses": witnesses,
            "subsets": [[names[int(k)] for k in index] for index in chosen],
            "evaluations": [e.model_dump(exclude={"cpu_s", "wall_s"}) for e in against_truth],
            "against_all_views": [e.model_dump(exclude={"cpu_s", "wall_s"}) for e in against_whole],
            "all_candidates": every.model_dump(exclude={"cpu_s", "wall_s"}),
            "cpu_s": [e.cpu_s for e in against_truth],
            "truth_points": len(truth),
            "truth_spearman": agreement,
            "gap_spearman": float(spearmanr([largest_gap_deg(centers[i], centers) for i in chosen], values).statistic),
        },
        pictures={"recorded.png": png(draw_subsets(centers, shown, values, plot.volume))},
    )


def split_rig(names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Candidates and witnesses: every other view around the circle."""
    return tuple(names[0::2]), tuple(names[1::2])


def witnessed_cloud(
    capture: Capture, names: Sequence[str], plot: KnownPlot, cache: StageCache, progress: Progress
) -> Cloud:
    """The plants by dense stereo of some photographs alone, at the poses that mapping all of them found.

    Args:
        capture: all photographs, as the reference was built from them.
        names: of the photographs to use.
        plot: of the reference: its frame and volume.
    """
    settings = ReconstructionSettings()
    sparse, _ = place(capture, settings, [], Context(cache, StageTimer(progress)))
    views = [
        prepare_view(
            photo.name,
            read_image(photo),
            sparse.intrinsics[photo.name],
            sparse.poses[photo.name],
            resolution(
                (photo.width, photo.height),
                sparse.intrinsics[photo.name],
                sparse.poses[photo.name],
                plot.volume,
                settings.fidelity,
            ).size,
            settings.mask,
        )
        for photo in map(capture.photo, names)
        if photo.name in sparse.poses
    ]
    maps = compute_depth_maps(views, plot.volume, seed=settings.seed, context=Context(cache, progress))
    cloud, _ = fuse(views, maps, plot.volume)
    if plot.ground is None:
        return cloud
    return cloud.select(plot.ground.heights(cloud.points) > clearance(plot.ground))


def largest_gap_deg(centers: FloatArray, everything: FloatArray) -> float:
    """The widest gap between neighbours of a subset on the rig's circle, degrees."""
    away = centers[:, :2] - everything[:, :2].mean(axis=0)
    angles = np.sort(np.degrees(np.arctan2(away[:, 1], away[:, 0])))
    return float(np.diff(np.append(angles, angles[0] + 360.0)).max())


def summary_table(found: dict[str, Sequence[Evaluation]], every: Evaluation) -> ResultTable:
    """A row of all subsets for each truth, and one of all candidates."""
    rows: list[tuple[Cell, ...]] = []
    for truth, each in found.items():
        values = [1000 * e.value_m for e in each]
        right = f"{np.mean([e.right for e in each]):.1f} of {len(each[0].views)}"
        timed = not rows  # evaluations of the first truth use the cache
        rows.append(
            (
                truth,
                len(each),
                spread(values, 2),
                f"{np.std(values):.2f}",
                right,
                spread([e.cpu_s for e in each]) if timed else None,
                f"{LIMIT_S:.0f}" if timed else None,
            )
        )
    rows.append(
        (
            f"{next(iter(found))}, all candidates",
            1,
            f"{1000 * every.value_m:.2f}",
            None,
            f"{every.right} of {len(every.views)}",
            None,
            None,
        )
    )
    columns = ("truth", "subsets>", "value, mm>", "standard deviation, mm>", "right>", "CPU s each>", "allowed>")
    return ResultTable("Random subsets of a recorded rig", columns, tuple(rows))
