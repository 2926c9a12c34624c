"""The source of an evaluation's photographs: one interface for simulated plots and recorded sets."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

from fieldkit.cache import StageCache
from fieldkit.captures.model import Capture
from fieldkit.clouds.metrics import ReferenceIndex
from fieldkit.planning.objective.fidelity import Fidelity
from fieldkit.planning.space.cameras import Cameras
from fieldkit.reconstruction.features import FeatureSettings
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.runtime.progress import Progress


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
