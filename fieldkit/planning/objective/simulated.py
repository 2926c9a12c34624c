"""The simulated back end: rendered photographs of a scene."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.metrics import ReferenceIndex
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Similarity
from fieldkit.geometry.priors import SourceFrame
from fieldkit.planning.objective.source import Fidelity, PhotoSet
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.plots import LOWEST_M, Plot, above_soil, check_plants, of_interest
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.description import SceneDescription, build, sample_truth
from fieldkit.scenes.drawing import Draw, KeptDrawings, draw
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.sampling import neighbour_points, plants_area_m2, sample_others, sample_plants
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.simulate import CaptureNoise, Outdoors, Sidecars, simulate_capture

_CLAIMED_M = 0.010
_REFERENCE_POINTS = 200_000


@dataclass(frozen=True, eq=False)
class Proxy:
    """A scene with its truth."""

    scene: Scene
    """The one rendered."""
    reference: Cloud
    """PC_env, points on the plants, plot frame."""
    volume: Volume
    """Of interest, plot frame; its floor lies above the soil's bumps."""
    camera: Intrinsics
    """Without distortion, at full size."""
    surface: Cloud | None = None
    """The surfaces of PC_env, sampled more densely, and those of weeds and neighbours; None if unknown. Accuracy is
    measured to it: reconstructed weeds and neighbours are no error, and missing ones cost nothing.
    """

    @classmethod
    def of(
        cls,
        scene: Scene,
        camera: Intrinsics,
        *,
        points: int = _REFERENCE_POINTS,
        lowest_m: float = LOWEST_M,
        seed: int = 0,
    ) -> Proxy:
        """A proxy of a scene: its plants' visible surfaces, sampled uniformly by area.

        Args:
            points: sampled, before hidden and low ones are left out.
            lowest_m: lower points are left out of reference and cloud, since the soil is bumpy.
        """
        return cls(scene, *above_soil(sample_plants(scene, points, seed), lowest_m), camera)

    @classmethod
    def from_description(cls, description: SceneDescription, camera: Intrinsics | None = None) -> Proxy:
        """A proxy of any scene file: maize, mesh plants, or a scene made from a reference.

        PC_env is the part of `sample_truth` that `of_interest` counts; the surface also has `sample_others`.

        Args:
            camera: of the photographs; None takes the description's.
        """
        check_plants(description)
        scene = build(description)
        visible, surface = sample_truth(description, scene)
        reference, volume = of_interest(description, visible)
        if description.recorded is None:
            others = sample_others(scene, volume, len(surface) / plants_area_m2(scene), description.reference.seed)
            real = np.concatenate([surface.points[surface.points[:, 2] > volume.lower[2]], others])
        else:
            real = surface.points[description.bounds.volume.contains(surface.points)]
        return cls(scene, reference, volume, camera or description.camera, Cloud(real))

    @property
    def plot(self) -> Plot:
        """The plot as planning knows it without a photograph."""
        return Plot(self.reference, neighbour_points(self.scene))


class SimulatedSource:
    """Renders photographs at the commanded poses, with noise; see `PhotoSource`.

    The scene is uploaded once and the renderer kept; it is not pickled. The noise of photograph k depends only on the
    seed and k, so all sets of cameras have the same noise at one seed.

    Args:
        noise: of poses and images; by default only the sensor's, as in the paper.
        effects: camera effects, stated for the proxy's camera at full size; none by default.
        outdoors: moves the plants, by the evaluation's seed, and takes bursts; the air is still by default.
        claimed_m: least accuracy claimed for the commanded positions, even if they are exact: mapping must not know
            more than in the field.
    """

    def __init__(
        self, proxy: Proxy, noise: CaptureNoise | None = None, *, effects: CameraEffects | None = None,
        outdoors: Outdoors | None = None, claimed_m: float = _CLAIMED_M,
    ) -> None:  # fmt: skip
        self.proxy, self.noise, self.claimed_m = proxy, noise or CaptureNoise(), claimed_m
        self.effects, self.outdoors = effects, outdoors or Outdoors()
        self._renderer: Renderer | None = None
        self._reference: ReferenceIndex | None = None
        self._drawings: Draw | None = None
        self._cache = StageCache(None)  # no two photographs are the same

    @classmethod
    def from_description(
        cls, description: SceneDescription, noise: CaptureNoise | None = None, *, camera: Intrinsics | None = None,
        outdoors: Outdoors | None = None,
    ) -> SimulatedSource:  # fmt: skip
        """Photographs of a scene as its file describes them, but in still air by default.

        Like the poses' noise, wind is for plans that must survive it.

        Args:
            noise: of poses and images, instead of the description's.
            camera: of the photographs, instead of the description's.
            outdoors: instead of still air.
        """
        return cls.of_scene(description, Proxy.from_description(description, camera), noise, outdoors)

    @classmethod
    def of_scene(
        cls, description: SceneDescription, proxy: Proxy, noise: CaptureNoise | None = None,
        outdoors: Outdoors | None = None,
    ) -> SimulatedSource:  # fmt: skip
        """As `from_description`, with the description's proxy given."""
        return cls(proxy, noise or description.noise, effects=description.camera_effects, outdoors=outdoors)

    def with_noise(self, noise: CaptureNoise) -> SimulatedSource:
        """The same plot and camera under another noise of poses and images; the renderer is not shared."""
        return SimulatedSource(
            self.proxy, noise, effects=self.effects, outdoors=self.outdoors, claimed_m=self.claimed_m
        )

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_renderer": None, "_reference": None, "_drawings": None}

    @property
    def plot(self) -> KnownPlot:
        return KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), self.proxy.volume, None)

    @property
    def reference(self) -> ReferenceIndex:
        if self._reference is None:
            self._reference = ReferenceIndex(self.proxy.reference, self.proxy.surface)
        return self._reference

    @property
    def cache(self) -> StageCache:
        return self._cache

    def prepare(self) -> None:
        """Upload the scene and index the reference."""
        assert self.reference is not None
        if self._renderer is None:
            self._renderer = Renderer(self.proxy.scene)
            self._drawings = KeptDrawings() if self.outdoors.still else draw

    @contextmanager
    def photograph(self, cameras: Cameras, fidelity: Fidelity, seed: int, progress: Progress) -> Iterator[PhotoSet]:
        """JPEGs in a temporary folder, with the commanded poses and the camera beside them."""
        self.prepare()
        assert self._renderer is not None
        assert self._drawings is not None
        camera = fidelity.camera(self.proxy.camera, cameras, self.proxy.volume)
        scale = camera.width / self.proxy.camera.width
        claimed = max(self.noise.position_m, self.claimed_m)
        sidecars = Sidecars(poses=True, accuracy_m=claimed, camera=True)
        with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
            folder = Path(temporary) / "capture"
            with progress.stage("Rendering"):
                simulate_capture(
                    folder, self._renderer, cameras.poses(), camera, noise=self.noise, seed=seed,
                    effects=_reduced(self.effects, scale), outdoors=self.outdoors,
                    sidecars=sidecars, economy=fidelity.economy, drawing=self._drawings,
                )  # fmt: skip
            with progress.stage("Reading photographs"):
                capture = read_capture(folder)
            yield PhotoSet(capture, capture.names, fidelity.features)

    def forget_drawings(self) -> None:
        """Draw everything anew."""
        if self._drawings is not None and self.outdoors.still:
            self._drawings = KeptDrawings()

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = self._drawings = None


def _reduced(effects: CameraEffects | None, scale: float) -> CameraEffects | None:
    """The effects in an image ``scale`` times as large; lengths in pixels are scaled."""
    if effects is None:
        return None
    return replace(effects, defocus_px=effects.defocus_px * scale, grain_px=max(1.0, effects.grain_px * scale))
