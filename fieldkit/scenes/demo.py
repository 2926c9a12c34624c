"""The demo's plot (sim/scenes/demo.toml) and its two captures, rendered in seconds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fieldkit.clouds import write_ply
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.progress import Progress, Silent
from fieldkit.scenes.description import SceneDescription, build, sample_reference
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, simulate_capture
from fieldkit.scenes.simulation import dense_about, ring_about, with_noise

SCENE = "demo"
DENSE_VIEWS, FEW_VIEWS = 30, 10
DENSE_NOISE, FEW_NOISE = (0.005, 0.5), (0.010, 1.0)
"""Of poses: metres and degrees."""


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


def demo_scene() -> SceneDescription:
    """Three young maize plants, small photographs.

    Raises:
        SceneError: the scene file that belongs to fieldkit is missing or was changed into something invalid.
    """
    return read_scene(find_scene(SCENE))


def demo_cameras(scene: Scene, camera: Intrinsics) -> tuple[list[Pose], list[Pose]]:
    """Commanded poses of the dense and of the few capture."""
    return list(dense_about(DENSE_VIEWS)(scene, camera)), list(ring_about(FEW_VIEWS)(scene, camera))


def write_demo_captures(folder: Path, seed: int = 0, *, progress: Progress | None = None) -> DemoCaptures:
    """Render the demo's plot and write ``folder``/dense, ``folder``/few and ``folder``/truth.

    Both captures carry poses.csv with their commanded poses and camera.toml.

    Args:
        folder: of the three.
        seed: of the captures' noise.
        progress: told of the scene and each photograph.

    Raises:
        SceneError: as `demo_scene`.
        RenderingError: this machine cannot render.
        UsageError: one of the folders exists.
        StorageError: the disk is full or not writable.
    """
    progress = progress or Silent()
    captures = DemoCaptures(folder / "dense", folder / "few", folder / "truth")
    description = demo_scene()
    with progress.stage("scene", 2) as advance:
        scene = build(description)
        advance(1)
        reference = sample_reference(description, scene)
        advance(1)
    dense, few = demo_cameras(scene, description.camera)
    with Renderer(scene) as renderer:
        for target, poses, pose_noise, offset in (
            (captures.dense, dense, DENSE_NOISE, 1),
            (captures.few, few, FEW_NOISE, 2),
        ):
            noise: CaptureNoise = with_noise(description.noise, pose=pose_noise)
            simulate_capture(
                target, renderer, poses, description.camera, noise=noise, seed=seed * 1000 + offset,
                effects=description.camera_effects, site=description.site,
                row_heading_deg=description.row_heading_deg, sidecars=Sidecars(poses=True, camera=True),
                truth=captures.truth / f"{target.name}-poses.csv", progress=progress,
            )  # fmt: skip
    write_ply(captures.truth / "reference.ply", reference)
    return captures
