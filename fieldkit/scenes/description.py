"""A simulated plot with all that belongs to it, as one value: what a scene file holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from fieldkit.cache import digest
from fieldkit.clouds import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics
from fieldkit.results.fields import STRICT, Heading
from fieldkit.runtime.progress import Advance, ignore
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.plot_description import PlotDescription
from fieldkit.scenes.recorded import RecordedSurface, build_recorded, recorded_plants
from fieldkit.scenes.sampling import sample_visible
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.simulate import CaptureNoise, Site
from fieldkit.scenes.simulated_field import build_scene

_OVERSAMPLING = 1.7
"""Points drawn for each one wanted: about two in five lie where no view reaches."""

SURFACE_DENSITY = 10
"""Points of the surface in `sample_truth` for each one of the reference."""
_MOST_POINTS = 20_000_000
"""Most points of a truth."""

MAX_WIND_M = 0.2
"""Largest deflection of leaves that is simulated, metres."""


@dataclass(frozen=True, config=STRICT)
class Bounds:
    """The plot as a box, plot frame."""

    lower_m: tuple[float, float, float] = (-0.8, -0.8, 0.0)
    """Lowest corner x, y, z."""
    upper_m: tuple[float, float, float] = (0.8, 0.8, 1.5)
    """Highest corner x, y, z."""

    def __post_init__(self) -> None:
        Volume(self.lower_m, self.upper_m)

    @property
    def volume(self) -> Volume:
        """The same as a volume of interest."""
        return Volume(self.lower_m, self.upper_m)


@dataclass(frozen=True, config=STRICT)
class ReferenceSampling:
    """How the reference cloud is sampled from the plants' surfaces."""

    points: Annotated[int, Field(ge=1_000, le=_MOST_POINTS)] = 150_000
    """Visible points, spread evenly by area."""
    seed: int = 0
    """Of the choice."""


@dataclass(frozen=True, config=STRICT)
class SceneDescription:
    """Everything there is to a simulated plot. The same description gives the same scene, bit for bit."""

    plot: PlotDescription = field(default_factory=lambda: PlotDescription(()))
    """Plants, soil and light."""
    name: str = ""
    """Of the scene; the file's where it is empty."""
    notes: str = ""
    """For people."""
    bounds: Bounds = field(default_factory=Bounds)
    """The plot as a box."""
    row_heading_deg: Heading = 90.0
    """Compass heading of the plot frame's x axis: 90 where it is east."""
    recorded: RecordedSurface | None = None
    """Surfaces made from a reference; then nothing of ``plot`` is built, and it has no plants."""
    reference: ReferenceSampling = field(default_factory=ReferenceSampling)
    """How the truth is sampled."""
    camera: Intrinsics = field(default_factory=lambda: Intrinsics.pinhole(2000, 1500, 1700.0))
    """Of photographs where nothing else is asked for; without distortion."""
    camera_effects: CameraEffects = field(default_factory=CameraEffects)
    """What the camera does to photographs."""
    noise: CaptureNoise = field(default_factory=CaptureNoise)
    """Of poses, GPS and pixels."""
    wind_m: Annotated[float, Field(ge=0, le=MAX_WIND_M)] = 0.0
    """How far leaves sway between photographs, half a metre out along a leaf (root mean square per axis); 0.005 is a
    calm, 0.02 a breeze."""
    site: Site = field(default_factory=Site)
    """Where on Earth the plot lies."""

    def __post_init__(self) -> None:
        if self.camera.distorted:
            raise ValueError("photographs are rendered without distortion: set the camera's distortion to 0")
        if self.recorded is not None and self.plot.plants:
            raise ValueError("a scene is either made from a reference (recorded) or has plants of its own")


def build(description: SceneDescription, advance: Advance = ignore) -> Scene:
    """The scene that ``description`` means; ``advance`` is told of its own plants, one after the other."""
    if description.recorded is not None:
        return build_recorded(description.recorded)
    return build_scene(description.plot, advance)


def sample_reference(description: SceneDescription, scene: Scene) -> Cloud:
    """PC_env of ``description``: points on the plants that can be seen, ground excluded, plot frame.

    ``scene`` is what `build` made of it.
    """
    return _sampled(description, scene, (description.reference.points,))[0]


def sample_truth(description: SceneDescription, scene: Scene) -> tuple[Cloud, Cloud]:
    """`sample_reference`, and up to `SURFACE_DENSITY` times as many points of the same surfaces, positions only."""
    points = description.reference.points
    reference, surface = _sampled(description, scene, (points, min(_MOST_POINTS, SURFACE_DENSITY * points)))
    return reference, Cloud(surface.points)


def _sampled(description: SceneDescription, scene: Scene, counts: Sequence[int]) -> list[Cloud]:
    seed = description.reference.seed
    if description.recorded is not None:
        clouds = [recorded_plants(description.recorded)] * len(counts)
    else:
        clouds = sample_visible(scene, [round(_OVERSAMPLING * count) for count in counts], seed)
    return [_thinned(cloud, count, seed) for cloud, count in zip(clouds, counts, strict=True)]


def _thinned(cloud: Cloud, points: int, seed: int) -> Cloud:
    if len(cloud) <= points:
        return cloud
    rng = np.random.default_rng([seed, 12])
    return cloud.select(np.sort(rng.choice(len(cloud), points, replace=False)))


def scene_digest(scene: Scene) -> str:
    """A digest of all that is drawn: every mesh's arrays, the light and the background."""
    meshes = [
        (m.name, m.plant, m.vertices, m.faces, m.normals, m.uv, m.texture, m.colors, m.shading) for m in scene.meshes
    ]
    return digest(*meshes, scene.light, scene.background)
