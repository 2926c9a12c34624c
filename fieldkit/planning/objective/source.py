"""The source of an evaluation's photographs, simulated or recorded, and how finely it is evaluated."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

from fieldkit.cache import StageCache
from fieldkit.captures.model import Capture
from fieldkit.clouds.metrics import ReferenceIndex
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics
from fieldkit.planning.space.cameras import Cameras
from fieldkit.reconstruction.dense import resolution
from fieldkit.reconstruction.features import FeatureSettings
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.runtime.progress import Progress
from fieldkit.vocabulary import Fidelity as DenseFidelity
from fieldkit.vocabulary import SearchFidelity


@dataclass(frozen=True)
class Fidelity:
    """A level of detail of evaluations."""

    name: SearchFidelity
    """``"draft"``, ``"standard"`` or ``"fine"``."""
    drawn_side: int = 2000
    """Least longer side of rendered photographs, pixels, at most the camera's; recorded ones keep their size."""
    economy: bool = True
    """Passed to `simulate_capture`; halves the cost of rendering."""
    features: FeatureSettings = field(default_factory=FeatureSettings)
    """Detection in rendered photographs; recorded ones always use the defaults of `FeatureSettings`."""
    dense: DenseFidelity = "standard"
    """Fidelity of dense stereo."""

    def camera(self, camera: Intrinsics, cameras: Cameras, volume: Volume) -> Intrinsics:
        """The camera that photographs are rendered with: large enough for dense stereo from the farthest one."""
        size = (camera.width, camera.height)
        sides = [max(resolution(size, camera, p, volume, self.dense).size) for p in cameras.poses()]
        scale = max(self.drawn_side, *sides) / max(size)
        return camera if scale >= 1.0 else camera.scaled(round(camera.width * scale), round(camera.height * scale))


FIDELITIES: dict[SearchFidelity, Fidelity] = {
    "draft": Fidelity("draft", 1200, features=FeatureSettings(working_side=900, max_features=3000), dense="draft"),
    "standard": Fidelity("standard", 1600, features=FeatureSettings(working_side=1400)),
    "fine": Fidelity("fine", dense="fine"),
}
"""Draft and standard render and match fewer pixels than fine, and densify coarser ones."""


@dataclass(frozen=True)
class PhotoSet:
    """The photographs of a set of cameras."""

    capture: Capture
    """With the commanded poses as its priors, in the plot frame."""
    views: tuple[str, ...]
    """The photographs' names in the cameras' order."""
    features: FeatureSettings = field(default_factory=FeatureSettings)
    """Settings of their detection."""


class PhotoSource(Protocol):
    """Takes the commanded photographs, and knows the truth they are scored against.

    A source can be pickled: worker processes get a copy and prepare it once.
    """

    @property
    def plot(self) -> KnownPlot:
        """Frame, volume of interest and ground. The metric source's frame is the plot frame."""
        ...

    @property
    def reference(self) -> ReferenceIndex:
        """PC_env, indexed."""
        ...

    @property
    def cache(self) -> StageCache:
        """The cache that evaluations share."""
        ...

    def prepare(self) -> None:
        """Make what every evaluation needs (a renderer, an index). Further calls do nothing."""
        ...

    def photograph(
        self, cameras: Cameras, fidelity: Fidelity, seed: int, progress: Progress
    ) -> AbstractContextManager[PhotoSet]:
        """The photographs, which exist while the context is open."""
        ...

    def close(self) -> None:
        """Free what `prepare` made."""
        ...
