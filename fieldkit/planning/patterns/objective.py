"""The objective r(z) of patterns: real structure from motion with photographs of a block, one plot's cloud."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import shapely
import shapely.affinity

from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.captures.model import Capture
from fieldkit.clouds.canopy import canopy, inside_outline
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.metrics import ReferenceIndex, nearest_distances, score_distances
from fieldkit.clouds.volume import Volume
from fieldkit.errors import ReconstructionError
from fieldkit.evaluation.flight import MOST_VIEWS
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.priors import SourceFrame
from fieldkit.planning.objective.evaluation import WORST_M, Evaluation, f_score_table, value_m
from fieldkit.planning.patterns.block import ROWS_DEG, Block
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.reconstruction.dense.views import views_of
from fieldkit.reconstruction.pipeline import KnownPlot, place_photographs, reconstruct_placed
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.fields import Length, Strict
from fieldkit.results.pattern import Pattern
from fieldkit.routing.passes import lines_over
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, simulate_capture
from fieldkit.vocabulary import DISTANCES_M

_MOST = 20
"""Photographs that are taken of a pattern, those that show the plot best; dense stereo takes `MOST_VIEWS` of them."""
_BESIDE_M = 0.15
"""Room beside the plot's outline, metres."""
_ABOVE_M = 0.3
"""Room above its plants, metres."""
_REACH = 0.8
"""How far beside the plot photographs look at most that may show it well, in heights above the ground."""
_CELL_M = 0.004
"""Cells of the true canopy, metres."""
_SHARE = 0.99
"""Quantile of height."""


class TraitErrors(Strict):
    """By how much a plot's traits are off."""

    height_m: Length
    """The height below which 99 % of the canopy's surface lies."""
    cover: Length
    """As a share of the plot."""
    volume: Length
    """As a share of it."""


class PatternEvaluation(Evaluation):
    """r(z) of a pattern on one block."""

    photographs: int
    """That were taken: those that show the plot best."""
    errors: TraitErrors | None = None
    """None without a cloud."""


def poses_about(pattern: Pattern, block: Block, camera: Intrinsics, phase: Sequence[float]) -> list[Pose]:
    """Photographs of a pattern over a large field that have the middle of a block's plot in the picture.

    Args:
        phase: by which lines lie beside the plot, (2,) shares of their spacings.
    """
    plot = shapely.Polygon(block.outline)
    middle = np.array([*plot.centroid.coords[0], 0.5 * block.height_m])
    shift = np.asarray(phase) * (pattern.along_m, pattern.between_m)
    reach = _REACH * pattern.height_m + max(pattern.along_m, pattern.between_m)
    field = shapely.affinity.translate(plot.envelope.buffer(reach, join_style="mitre"), *shift)
    poses = []
    for line in lines_over(pattern, field, ROWS_DEG):
        turned = Pose.from_yaw_pitch(middle, line.yaw_deg, line.pitch_deg).rotation
        seen = camera.sees((middle - line.stations_m) @ turned.T)
        poses += [Pose(turned, place) for place in line.stations_m[seen]]
    return poses


def plot_volume(block: Block) -> Volume:
    """Of a block's plot, with room about it."""
    low, high = np.min(block.outline, axis=0) - _BESIDE_M, np.max(block.outline, axis=0) + _BESIDE_M
    return Volume((*low, 0.03), (*high, block.height_m + _ABOVE_M))


def showing(poses: Sequence[Pose], camera: Intrinsics, volume: Volume, most: int) -> list[Pose]:
    """Those that show a volume best, in the order of flight."""
    names = {f"{k:06d}": pose for k, pose in enumerate(poses)}
    return [names[name] for name in sorted(views_of(names, dict.fromkeys(names, camera), volume, most))]


def evaluate(
    pattern: Pattern, block: Block, camera: Intrinsics, noise: NoiseSettings, seed: int, phase: Sequence[float]
) -> PatternEvaluation:
    """Photograph a block as a flight with a pattern does, and reconstruct its plot.

    Args:
        camera: without distortion.
        noise: of the flight.
        seed: of all noise.
        phase: as `poses_about` takes it.
    """
    spent = Spent.now()
    poses = showing(poses_about(pattern, block, camera, phase), camera, plot_volume(block), _MOST)
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
        folder = Path(temporary) / "capture"
        with Renderer(block.scene) as renderer:
            simulate_capture(
                folder,
                renderer,
                poses,
                camera,
                noise=CaptureNoise(noise.pose_m, noise.pose_deg),
                seed=seed,
                effects=block.description.camera_effects,
                outdoors=noise.outdoors,
                sidecars=Sidecars(poses=True, accuracy_m=noise.pose_m, camera=True),
                economy=True,
            )
        return evaluate_capture(read_capture(folder), block, noise, seed, spent)


def evaluate_capture(
    capture: Capture, block: Block, noise: NoiseSettings, seed: int, spent: Spent
) -> PatternEvaluation:
    """The same of photographs that were taken."""
    volume, count = plot_volume(block), len(capture.photos)
    settings = ReconstructionSettings(trust_orientations=True, mapping="prior", seed=seed)
    known = KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), volume, None)
    context = Context(StageCache(None), seed=seed)
    plants, failure, found = Cloud.empty(), "", dict[str, object]()
    try:
        sparse, _ = place_photographs(capture, settings, context, known)
        part = sparse.of(views_of(sparse.poses, sparse.intrinsics, volume, MOST_VIEWS))
        found = {"registered": sparse.registered, "right": sparse.right, "models": len(sparse.model_sizes)}
        made = reconstruct_placed(part, volume, settings, context, own_ground=False)
        plants = made.plants.select(inside_outline(made.plants.points, block.outline))
    except ReconstructionError as error:
        failure = error.message
        found = {"registered": error.registered, "right": error.right} | found
    errors = None
    scored: dict[str, object] = {"value_m": WORST_M}
    if len(plants):
        to_reference, to_cloud = nearest_distances(ReferenceIndex(block.reference, Cloud(block.surface)), plants)
        score = score_distances(to_reference, to_cloud, DISTANCES_M)
        scored = asdict(score.chamfer) | {
            "value_m": value_m(to_cloud, to_reference),
            "f_score": f_score_table({d: score.f_scores[d].f_score for d in DISTANCES_M}),
        }
        measured = traits(plants.points, made.pixel_m, noise.wind_m, None)
        errors = trait_errors(measured, traits(block.surface, _CELL_M), block)
    return PatternEvaluation.model_validate(
        scored
        | found
        | {
            "photographs": count,
            "points": len(plants),
            "failure": failure,
            "errors": errors,
            "cpu_s": max(spent.cpu_seconds, 0.0),
            "wall_s": spent.seconds,
        }
    )


def trait_errors(measured: FloatArray, true: FloatArray, block: Block) -> TraitErrors:
    """Of `traits`."""
    height_m, cover_m2, volume_m3 = np.abs(measured - true).tolist()
    area_m2 = shapely.Polygon(block.outline).area
    return TraitErrors(height_m=height_m, cover=cover_m2 / area_m2, volume=volume_m3 / float(true[2]))


def traits(points: FloatArray, cell_m: float, swayed_m: float = 0.0, seam: float | None = 0.5) -> FloatArray:
    """(3,) height, covered ground in m² and volume in m³ of a plot's points (n, 3); as `canopy` takes the rest."""
    above = canopy(points, points[:, 2], cell_m, swayed_m, seam)
    return np.array([*above.heights_m(_SHARE), above.covered_m2, above.volume_m3])
