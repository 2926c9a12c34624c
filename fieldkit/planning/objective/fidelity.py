"""The cost of an evaluation: the size of its renderings, and how finely they are matched and densified."""

from __future__ import annotations

from dataclasses import dataclass, field

from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.features import FeatureSettings
from fieldkit.vocabulary import Fidelity as DenseFidelity
from fieldkit.vocabulary import SearchFidelity


@dataclass(frozen=True)
class Fidelity:
    """A level of detail of evaluations."""

    name: SearchFidelity
    """``"draft"``, ``"standard"`` or ``"fine"``."""
    drawn_side: int = 2000
    """Longer side of rendered photographs, pixels, at most the camera's; recorded ones keep their size."""
    economy: bool = True
    """Passed to `simulate_capture`; halves the cost of rendering."""
    features: FeatureSettings = field(default_factory=FeatureSettings)
    """Detection in rendered photographs; recorded ones always use the defaults of `FeatureSettings`."""
    dense: DenseFidelity = "standard"
    """Fidelity of dense stereo."""

    def camera(self, camera: Intrinsics) -> Intrinsics:
        """The camera that photographs are rendered with."""
        scale = self.drawn_side / max(camera.width, camera.height)
        return camera if scale >= 1.0 else camera.scaled(round(camera.width * scale), round(camera.height * scale))


FIDELITIES: dict[SearchFidelity, Fidelity] = {
    "draft": Fidelity("draft", 1200, features=FeatureSettings(working_side=900, max_features=3000), dense="draft"),
    "standard": Fidelity("standard", 1600, features=FeatureSettings(working_side=1400)),
    "fine": Fidelity("fine", dense="fine"),
}
"""Draft and standard render, match and densify fewer pixels than fine."""
