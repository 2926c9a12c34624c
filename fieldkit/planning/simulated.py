"""The simulated back end: photographs of a scene, rendered as a drone would take them."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.metrics import ReferenceIndex
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Similarity
from fieldkit.planning.cameras import Cameras
from fieldkit.planning.fidelity import Fidelity
from fieldkit.planning.source import Shot
from fieldkit.progress import Progress
from fieldkit.reconstruction.known_poses import SourceFrame
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.description import SceneDescription, build
from fieldkit.scenes.plot import sample_plants
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, simulate_capture
from fieldkit.scenes.simulation import wind_sway

FIELD_NOISE = CaptureNoise(position_m=0.010, angle_deg=1.0)
"""What a copter with RTK leaves of a command, and an ordinary sensor."""
_CLAIMED_M = 0.010
_REFERENCE_POINTS = 200_000
_LOWEST_M = 0.03
_MARGIN_M = 0.03


@dataclass(frozen=True, eq=False)
class Proxy:
    """A scene with its truth.

    Attributes:
        scene: to render.
        reference: PC_env, points on the plants, plot frame.
        volume: of interest, plot frame; its floor lies above the soil's bumps.
        camera: without distortion, at full size.
        effects: of the camera; none where not given.
        wind_m: how far leaves sway between photographs.
    """

    scene: Scene
    reference: Cloud
    volume: Volume
    camera: Intrinsics
    effects: CameraEffects = field(default_factory=CameraEffects)
    wind_m: float = 0.0

    @classmethod
    def described(cls, description: SceneDescription, scene: Scene | None = None) -> Proxy:
        """A proxy of a scene file, photographed with its own camera, effects and wind.

        Args:
            description: of the scene.
            scene: what `fieldkit.scenes.description.build` made of it, where it is at hand.
        """
        built = cls.of(build(description) if scene is None else scene, description.camera)
        return replace(built, effects=description.camera_effects, wind_m=description.wind_m)

    @classmethod
    def of(
        cls, scene: Scene, camera: Intrinsics, *, points: int = _REFERENCE_POINTS, lowest_m: float = _LOWEST_M,
        seed: int = 0,
    ) -> Proxy:  # fmt: skip
        """A proxy of a scene: its plants' visible surfaces, sampled uniformly by area.

        Args:
            scene: with plants.
            camera: of the photographs.
            points: sampled, before hidden and low ones are left out.
            lowest_m: what lies lower is counted on neither side, for the soil is bumpy.
            seed: of the sampling.
        """
        visible = sample_plants(scene, points, seed)
        reference = visible.select(visible.points[:, 2] > lowest_m)
        around = Volume.around(reference.points, margin_m=_MARGIN_M)
        return cls(scene, reference, Volume((around.lower[0], around.lower[1], lowest_m), around.upper), camera)


class SimulatedSource:
    """Renders what the cameras command, with noise; see `PhotoSource`.

    The scene is uploaded once and the renderer kept; pickling leaves it behind. The noise of photograph k depends on
    the seed and k only, so two sets of cameras at one seed meet the same noise.

    Args:
        proxy: the scene and its truth.
        noise: of poses and images; by default the sensor's only, as in the paper.
        claimed_m: the accuracy that the commanded positions are said to have, where the noise is not larger. Mapping
            then knows no more than in the field, also where the poses are in truth exact.
    """

    def __init__(self, proxy: Proxy, noise: CaptureNoise | None = None, *, claimed_m: float = _CLAIMED_M) -> None:
        self.proxy, self.noise, self.claimed_m = proxy, noise or CaptureNoise(), claimed_m
        self._renderer: Renderer | None = None
        self._reference: ReferenceIndex | None = None
        self._cache = StageCache(None)  # no two renderings are the same

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_renderer": None, "_reference": None}

    @property
    def plot(self) -> KnownPlot:
        return KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), self.proxy.volume, None)

    @property
    def reference(self) -> ReferenceIndex:
        if self._reference is None:
            self._reference = ReferenceIndex(self.proxy.reference)
        return self._reference

    @property
    def cache(self) -> StageCache:
        return self._cache

    def prepare(self) -> None:
        """Upload the scene and index the reference.

        Raises:
            RenderingError: this machine cannot render.
        """
        assert self.reference is not None
        if self._renderer is None:
            self._renderer = Renderer(self.proxy.scene)

    @contextmanager
    def photograph(self, cameras: Cameras, fidelity: Fidelity, seed: int, progress: Progress) -> Iterator[Shot]:
        """JPEGs in a temporary folder, with the commanded poses and the camera beside them."""
        self.prepare()
        assert self._renderer is not None
        claimed = max(self.noise.position_m, self.claimed_m)
        sidecars = Sidecars(poses=True, accuracy_m=claimed, camera=True)
        # The lens blurs by an angle: a draft's larger pixels see less of it.
        effects = replace(self.proxy.effects, defocus_px=self.proxy.effects.defocus_px * fidelity.render_scale)
        with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
            folder = Path(temporary) / "capture"
            with progress.stage("Rendering"):
                simulate_capture(
                    folder, self._renderer, cameras.poses(), fidelity.camera(self.proxy.camera), noise=self.noise,
                    seed=seed, effects=effects, sway=wind_sway(self.proxy.wind_m, seed), sidecars=sidecars,
                )  # fmt: skip
            with progress.stage("Reading photographs"):
                capture = read_capture(folder)
            yield Shot(capture, capture.names)

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
