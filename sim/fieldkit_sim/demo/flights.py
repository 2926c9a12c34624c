"""The demo's flights over its block, as jobs for worker processes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fieldkit.cache import StageCache
from fieldkit.evaluation.flight import evaluate_flight
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.results.evaluation import EvaluationReport
from fieldkit.runtime.context import Context
from fieldkit.scenes.scene_file import read_scene
from fieldkit_sim.simulation import simulate
from fieldkit_sim.trial.files import PLOTS_FILE, SCENE_FILE

BLOCK, FLIGHTS = "block", "flights"


@dataclass(frozen=True)
class Flight:
    """Photographs to take over a block."""

    name: str
    poses: Sequence[Pose]
    """As commanded, block's frame."""
    camera: Intrinsics
    noise: NoiseSettings
    """Of its poses, and what moves leaves."""
    seed: int


def photograph(folder: Path, flight: Flight) -> int:
    """Take a flight's photographs into the demo's folder, tagged by a receiver with RTK; returns how many."""
    scene = read_scene(folder / BLOCK / SCENE_FILE)
    noise = replace(scene.noise, position_m=flight.noise.pose_m, angle_deg=flight.noise.pose_deg)
    done = simulate(
        replace(scene, noise=noise, camera=flight.camera),
        flight.poses,
        folder / FLIGHTS / flight.name,
        outdoors=flight.noise.outdoors,
        seed=flight.seed,
        poses_csv=False,
    )
    return done.photographs


def evaluate(folder: Path, cache: StageCache, settings: EvaluationSettings, name: str) -> EvaluationReport:
    """Measure the block's plots by a flight's photographs, as `fieldkit evaluate --plots` does."""
    photographs, plots = folder / FLIGHTS / name, folder / BLOCK / PLOTS_FILE
    return evaluate_flight(photographs, plots, folder / f"evaluation-{name}", settings, Context(cache))
