"""The simulated back end: rendered photographs of a scene, or of plots of its kind."""

from __future__ import annotations

import pickle
import shutil
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.captures.bursts import by_station
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.metrics import ReferenceIndex
from fieldkit.clouds.volume import Volume
from fieldkit.files import lock, write_atomic
from fieldkit.geometry import Intrinsics, Similarity
from fieldkit.geometry.priors import SourceFrame
from fieldkit.planning.objective.objective import Fidelity, PhotoSet
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.plots import Plot, check_plants, of_interest
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.reconstruction.steady import steady_capture
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.description import SceneDescription, build, sample_truth
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.sampling import neighbour_points, plants_area_m2, sample_others
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.simulate import CaptureNoise, Outdoors, Sidecars, simulate_capture
from fieldkit.scenes.simulated_field import simulated_field

_CLAIMED_M = 0.010
"""Default standard deviation that is claimed of positions, metres."""


@dataclass(frozen=True, eq=False)
class Proxy:
    """A scene with its truth."""

    scene: Scene
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
    def from_description(cls, description: SceneDescription, camera: Intrinsics | None = None) -> Proxy:
        """A proxy of any scene file: maize, mesh plants, or a scene made from a reference.

        PC_env is the part of `sample_truth` that `of_interest` counts; the surface also has `sample_others`. ``camera``
        is the description's where not given.
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
        self,
        proxy: Proxy,
        noise: CaptureNoise | None = None,
        *,
        effects: CameraEffects | None = None,
        outdoors: Outdoors | None = None,
        claimed_m: float = _CLAIMED_M,
    ) -> None:
        self.proxy, self.noise, self.claimed_m = proxy, noise or CaptureNoise(), claimed_m
        self.effects, self.outdoors = effects, outdoors or Outdoors()
        self._renderer: Renderer | None = None
        self._reference: ReferenceIndex | None = None
        self.plot = KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), proxy.volume, None)
        self.cache = StageCache(None)  # no two photographs are the same

    @classmethod
    def from_description(
        cls,
        description: SceneDescription,
        noise: CaptureNoise | None = None,
        *,
        outdoors: Outdoors | None = None,
        proxy: Proxy | None = None,
    ) -> SimulatedSource:
        """Photographs of a scene as its file describes them, but in still air by default.

        Like the poses' noise, wind is for plans that must survive it. ``noise`` takes the place of the description's,
        ``outdoors`` of still air; ``proxy`` is of the description, or of a plot that is photographed as it.
        """
        proxy = proxy or Proxy.from_description(description)
        return cls(proxy, noise or description.noise, effects=description.camera_effects, outdoors=outdoors)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_renderer": None, "_reference": None}

    @property
    def reference(self) -> ReferenceIndex:
        if self._reference is None:
            self._reference = ReferenceIndex(self.proxy.reference, self.proxy.surface)
        return self._reference

    def prepare(self) -> None:
        """Upload the scene and index the reference."""
        assert self.reference is not None
        if self._renderer is None:
            self._renderer = Renderer(self.proxy.scene)

    @contextmanager
    def photograph(self, cameras: Cameras, fidelity: Fidelity, seed: int, progress: Progress) -> Iterator[PhotoSet]:
        """JPEGs in a temporary folder, with the commanded poses and the camera beside them."""
        self.prepare()
        assert self._renderer is not None
        camera = fidelity.camera(self.proxy.camera, cameras, self.proxy.volume)
        scale = camera.width / self.proxy.camera.width
        claimed = max(self.noise.position_m, self.claimed_m)
        sidecars = Sidecars(poses=True, accuracy_m=claimed, camera=True)
        with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
            folder = Path(temporary) / "capture"
            with progress.stage("Rendering"):
                simulate_capture(
                    folder,
                    self._renderer,
                    cameras.poses(),
                    camera,
                    noise=self.noise,
                    seed=seed,
                    effects=_reduced(self.effects, scale),
                    outdoors=self.outdoors,
                    sidecars=sidecars,
                    economy=True,
                )
            with progress.stage("Reading photographs"):
                capture = by_station(read_capture(folder))
            with steady_capture(capture, Context(self.cache, progress)) as steady:
                yield PhotoSet(steady, steady.names, fidelity.features)

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _reduced(effects: CameraEffects | None, scale: float) -> CameraEffects | None:
    """The effects in an image ``scale`` times as large; lengths in pixels are scaled."""
    if effects is None:
        return None
    return replace(effects, defocus_px=effects.defocus_px * scale, grain_px=max(1.0, effects.grain_px * scale))


_SEEDS_APART = 1_000_003
"""Distance between the seeds of two given plots, so that their draws differ."""


@dataclass(frozen=True)
class Kind:
    """Plots by number: first the given ones, then others drawn of each of them in turn.

    For a simulated plot they come from `plots_of_kind`. One made from a reference stays as it is. Plot k does not
    depend on the number of plots.

    A plot's scene takes 17 CPU s to build. The first process that needs it shares it with the machine's other processes
    in a temporary folder, which is removed with this object.
    """

    descriptions: tuple[SceneDescription, ...]
    """Of the given plots, all simulated or all recorded. The first one's camera effects apply to all."""
    seed: int
    noise: CaptureNoise | None = None
    """Of photographs; None takes the first plot's."""
    outdoors: Outdoors | None = None
    """While they are taken; None is still air."""
    camera: Intrinsics | None = None
    """Of them; None takes the first plot's."""

    def plot(self, number: int) -> tuple[Plot, Volume]:
        """The plot as known without a photograph. Raises SceneError."""
        return Plot.of(self._description(number))

    def prepare(self) -> None:
        """Raises RenderingError: this machine cannot render."""
        Renderer(Scene(())).close()

    def source(self, number: int) -> SimulatedSource:
        """The source of a plot's photographs. Raises SceneError, StorageError."""
        proxy = self._shared_proxy(number)
        return SimulatedSource.from_description(self.descriptions[0], self.noise, outdoors=self.outdoors, proxy=proxy)

    def proxy(self, number: int) -> Proxy:
        """The proxy to photograph, built anew. Raises SceneError, StorageError."""
        return Proxy.from_description(self._description(number), self.camera or self.descriptions[0].camera)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_shared": self._shared}  # there before workers need it

    @cached_property
    def _shared(self) -> Path:
        folder = Path(tempfile.mkdtemp(prefix="fieldkit-plots-"))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        return folder

    def _shared_proxy(self, number: int) -> Proxy:
        if not self._shared.is_dir():  # on another machine
            return self.proxy(number)
        file = self._shared / f"{number}.pickle"
        with (self._shared / f"{number}.lock").open("wb") as held:
            with suppress(OSError):  # without locks it is built twice
                lock(held.fileno(), wait=True)  # the second process waits for the first one's scene
            if not file.is_file():
                write_atomic(file, pickle.dumps(self.proxy(number), pickle.HIGHEST_PROTOCOL))
            proxy: Proxy = pickle.loads(file.read_bytes())
        return proxy

    def _description(self, number: int) -> SceneDescription:
        drawn, given = divmod(number, len(self.descriptions))
        description = self.descriptions[given]
        if not drawn or description.recorded is not None:
            return description
        generator, seed = simulated_field("generator"), self.seed + _SEEDS_APART * given
        plots: tuple[SceneDescription, ...] = generator.plots_of_kind(description, drawn, seed)
        return plots[-1]
