"""Scene files for the studies of realism: photographed with their own camera, noise and wind, from one distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.description import SceneDescription, build
from fieldkit.scenes.library import find_scene, scene_names
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import Outdoors, simulate_capture
from fieldkit_sim.simulation import ring

CAMERA = Intrinsics.pinhole(2000, 1500, 1700.0)
"""The camera of every scene, so that counts can be compared."""

ALL = "all"
_RADIUS_M, _HEIGHT_M, _TARGET_HEIGHT_M = 1.45, 1.15, 0.25


@dataclass(frozen=True, eq=False)
class SceneUnderStudy:
    """A scene file, read and built."""

    description: SceneDescription
    scene: Scene

    @property
    def name(self) -> str:
        return self.description.name


def study_scenes(names: Sequence[str]) -> list[str]:
    """The named scenes; by default the tuning scenes, for "all" these and all cases."""
    known = scene_names()
    if ALL in names:
        return [name for group in ("tuning", "case", "test-case") for name in known if name.startswith(f"{group}-")]
    return list(names) or [name for name in known if name.startswith("tuning-")]


def load_scene(name: str) -> SceneUnderStudy:
    """A scene by its name or path."""
    description = read_scene(find_scene(name))
    return SceneUnderStudy(description, build(description))


def ring_about_plants(description: SceneDescription, count: int, *, start_deg: float = 0.0) -> list[Pose]:
    """``count`` views on a circle 1.7 m from the middle of the plants' places, 0.25 m above the ground."""
    feet = [(plant.x_m, plant.y_m) for plant in description.plot.plants] or [(0.0, 0.0)]
    x, y = (0.5 * (min(place) + max(place)) for place in zip(*feet, strict=True))
    return ring(count, _RADIUS_M, _HEIGHT_M, (x, y, _TARGET_HEIGHT_M), start_deg=start_deg)


def photograph(
    folder: Path, study: SceneUnderStudy, renderer: Renderer, poses: Sequence[Pose], seed: int, progress: Progress
) -> list[Pose]:
    """Take JPEGs with the scene file's camera. Returns the true poses."""
    description = study.description
    return simulate_capture(
        folder,
        renderer,
        poses,
        CAMERA,
        noise=description.noise,
        effects=description.camera_effects,
        outdoors=Outdoors(description.wind_m),
        seed=seed,
        progress=progress,
    )
