"""The demo's plot and its two captures, rendered in seconds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from fieldkit.clouds import write_ply
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.progress import Progress, Silent
from fieldkit.scenes.plot import PlotDescription, build_scene, plant_layout, sample_plants
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.rigs import ring
from fieldkit.scenes.scene import Light
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, Site, simulate_capture
from fieldkit.scenes.soil import PRINTED

DENSE_NOISE = CaptureNoise(position_m=0.005, angle_deg=0.5)
FEW_NOISE = CaptureNoise(position_m=0.010, angle_deg=1.0)
_TARGET = (0.0, 0.0, 0.22)


@dataclass(frozen=True)
class DemoCaptures:
    """What `write_demo_captures` wrote.

    Attributes:
        dense: folder of the 30 photographs for the reference.
        few: folder of the 10 photographs to score.
        truth: folder with reference.ply (the plants' true surfaces), dense-poses.csv and few-poses.csv.
    """

    dense: Path
    few: Path
    truth: Path


def make_demo_scene(seed: int = 0) -> PlotDescription:
    """Three young maize plants on soil a little coarser than the benchmark's, so that it is built in seconds."""
    soil = replace(PRINTED, seed=seed, spacing_m=0.007, texture_px=2048, stones=400, residues=200)
    return PlotDescription(plant_layout(3, seed, spacing_m=0.24, leaves=(7, 8)), soil, Light())


def demo_cameras() -> tuple[list[Pose], list[Pose], Intrinsics]:
    """Commanded poses of the dense and of the few capture, and their camera."""
    dense = [*ring(18, 1.35, 0.95, _TARGET), *ring(12, 0.90, 1.55, _TARGET, start_deg=10.0)]
    return dense, ring(10, 1.35, 1.05, _TARGET, start_deg=5.0), Intrinsics.pinhole(1000, 750, 850.0)


def write_demo_captures(folder: Path, seed: int = 0, *, progress: Progress | None = None) -> DemoCaptures:
    """Render the demo's plot and write ``folder``/dense, ``folder``/few and ``folder``/truth.

    Both captures carry poses.csv with their commanded poses and camera.toml.

    Raises:
        RenderingError: this machine cannot render.
        UsageError: one of the folders exists.
        StorageError: the disk is full or not writable.
    """
    progress = progress or Silent()
    captures = DemoCaptures(folder / "dense", folder / "few", folder / "truth")
    with progress.stage("scene", 2) as advance:
        scene = build_scene(make_demo_scene(seed))
        advance(1)
        reference = sample_plants(scene, 120_000, seed)
        advance(1)
    dense, few, intrinsics = demo_cameras()
    with Renderer(scene) as renderer:
        for target, poses, noise, offset in (
            (captures.dense, dense, DENSE_NOISE, 1),
            (captures.few, few, FEW_NOISE, 2),
        ):
            simulate_capture(
                target,
                renderer,
                poses,
                intrinsics,
                noise=noise,
                seed=seed * 1000 + offset,
                site=Site(),
                sidecars=Sidecars(poses=True, camera=True),
                truth=captures.truth / f"{target.name}-poses.csv",
                progress=progress,
            )
    write_ply(captures.truth / "reference.ply", reference)
    return captures
