"""The demo's two plots and their photographs, as jobs for worker processes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from fieldkit.cache import StageCache
from fieldkit.evaluation.evaluate import evaluate as evaluate_captures
from fieldkit.evaluation.reference import build_reference
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.planning.space.plots import Plot
from fieldkit.reconstruction.settings import FeatureSettings, PriorMappingSettings, ReconstructionSettings
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
from fieldkit.results.traits import TraitsEntry
from fieldkit.runtime.context import Context
from fieldkit.scenes.description import build as build_scene
from fieldkit.scenes.library import scenes_folder
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import Outdoors
from fieldkit_sim.simulation import Stations, dense_about, simulate
from fieldkit_sim.truth import true_traits

SEEN, UNSEEN = "seen", "unseen"
SCENES = {SEEN: "demo", UNSEEN: "demo-unseen"}
"""The plot that is planned on, and one of the same crop with other plants."""
DENSE_VIEWS = 24
"""Number of photographs of the dense capture."""
DENSE_NOISE = (0.005, 0.5)
"""Noise of its poses, metres and degrees: a dense capture is flown slowly."""
# The photographs are small and their poses well known: half the features and neighbours are enough.
_SETTINGS = ReconstructionSettings(
    features=FeatureSettings(max_features=2048), prior=PriorMappingSettings(max_neighbours=12)
)


def scene_path(plot: str) -> Path:
    """The scene file of a plot."""
    return scenes_folder() / f"{SCENES[plot]}.toml"


def measured_height_m(plot: str) -> float:
    """The plants' height as a person measures it before a flight."""
    known, _ = Plot.of(read_scene(scene_path(plot)))
    return known.measured_height_m


def truth(plot: str) -> TraitsEntry:
    """Of the rendered plants, within the box that `evaluate` takes for the plot."""
    scene = read_scene(scene_path(plot))
    known = true_traits(build_scene(scene).meshes, scene.bounds.volume)
    return TraitsEntry(**asdict(known), cover_percent=known.cover_percent)


@dataclass(frozen=True)
class Shooting:
    """Photographs to take."""

    plot: str
    """`SEEN` or `UNSEEN`."""
    output: Path
    stations: Sequence[Pose] | Stations
    """Commanded poses, or what makes them from the scene."""
    camera: Intrinsics | None
    """None takes the scene's."""
    noise: tuple[float, float]
    """Of poses, metres and degrees."""
    outdoors: Outdoors
    """What moves leaves."""
    seed: int
    truth_cloud: Path | None = None
    """PLY for the plants' true surfaces, or None."""


def dense_shooting(plot: str, output: Path, outdoors: Outdoors, seed: int, truth_cloud: Path | None = None) -> Shooting:
    """A dense capture, for a reference."""
    return Shooting(plot, output, dense_about(DENSE_VIEWS), None, DENSE_NOISE, outdoors, seed, truth_cloud)


def photograph(job: Shooting) -> int:
    """Take the photographs of a job; returns how many."""
    scene = read_scene(scene_path(job.plot))
    noise = replace(scene.noise, position_m=job.noise[0], angle_deg=job.noise[1])
    done = simulate(
        replace(scene, noise=noise, camera=job.camera or scene.camera),
        job.stations,
        job.output,
        outdoors=job.outdoors,
        seed=job.seed,
        truth_cloud=job.truth_cloud,
    )
    return done.photographs


def build(seed: int, cache: StageCache, place: tuple[str, Path, Path]) -> ReferenceReport:
    """Build a reference from a dense capture; ``place`` are the plot and the folders of both."""
    plot, captures, output = place
    return build_reference(captures, output, context=Context(cache), scene=False, reconstruction=_settings(plot, seed))


def evaluate(seed: int, cache: StageCache, place: tuple[str, Path, Path, Path]) -> EvaluationReport:
    """Reconstruct and score a plot's captures; ICP takes out how far their own positions are off.

    ``place`` are the plot, and the folders of captures, reference and result.
    """
    plot, captures, reference, output = place
    return evaluate_captures(
        captures,
        output,
        EvaluationSettings(refine=True),
        Context(cache),
        reference=reference,
        reconstruction=_settings(plot, seed),
    )


def _settings(plot: str, seed: int) -> ReconstructionSettings:
    """With the plot's box as bounds, whose footprint is the outline that cover is a share of."""
    return replace(_SETTINGS, bounds=read_scene(scene_path(plot)).bounds.volume, seed=seed)
