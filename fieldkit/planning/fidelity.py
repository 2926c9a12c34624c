"""What an evaluation may cost: how large it is rendered, and how finely it is matched and densified."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.dense.settings import Fidelity as DenseFidelity
from fieldkit.reconstruction.features import FeatureSettings

FidelityName = Literal["draft", "standard", "fine"]


@dataclass(frozen=True)
class Fidelity:
    """One way to evaluate.

    Attributes:
        name: ``"draft"``, ``"standard"`` or ``"fine"``.
        render_scale: of the camera's image size; recorded photographs keep theirs.
        economy: render as `simulate_capture`'s ``economy`` says: half the cost.
        features: detection.
        dense: working size of dense stereo.
    """

    name: FidelityName
    render_scale: float = 1.0
    economy: bool = True
    features: FeatureSettings = field(default_factory=FeatureSettings)
    dense: DenseFidelity = "standard"

    def camera(self, camera: Intrinsics) -> Intrinsics:
        """The camera that photographs are rendered with."""
        if self.render_scale == 1.0:
            return camera
        return camera.scaled(round(camera.width * self.render_scale), round(camera.height * self.render_scale))


FIDELITIES: dict[FidelityName, Fidelity] = {
    "draft": Fidelity("draft", 0.8, features=FeatureSettings(working_side=1400), dense="draft"),
    "standard": Fidelity("standard"),
    "fine": Fidelity("fine", dense="fine"),
}
"""Draft renders two thirds of the pixels; standard and fine differ in dense stereo only."""
