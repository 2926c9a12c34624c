"""What a maize plant is asked to look like."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

Stage = Literal[
    "V4", "V5", "V6", "V7", "V8", "V9", "V10", "V11", "V12", "V13", "V14", "V15", "V16", "V17", "V18", "VT", "R1"
]
"""Growth stages by the leaf-collar method (Abendroth et al. 2011): Vn has n visible collars, VT a tassel, R1 silks."""

STAGES: tuple[Stage, ...] = get_args(Stage)


@dataclass(frozen=True)
class MaizeDescription:
    """One maize plant.

    Attributes:
        seed: of its individual form and colour; no two leaves of a plant are alike.
        x_m, y_m: where it stands, plot frame.
        yaw_deg: direction of the plane its leaves stand in, clockwise from north.
        scale: of all lengths.
        leaves: draws the plain plant of the engine's benchmark with so many blades (5 to 12) instead of a plant at a
            ``stage``; kept so that those scenes stay as they were measured.
        stage: growth stage.
        markings: how strong blotches, flecks, lesions, dust and grain are on its leaves and stem; 0 for none.
        kind: tells plants of different kinds apart in scene files.
    """

    seed: int
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_deg: float = 0.0
    scale: float = 1.0
    leaves: int | None = None
    stage: Stage = "V8"
    markings: float = 0.5
    kind: Literal["maize"] = "maize"

    def __post_init__(self) -> None:
        if self.leaves is not None and not 5 <= self.leaves <= 12:
            raise ValueError(f"a maize plant here has 5 to 12 leaves, not {self.leaves}")
        if self.stage not in STAGES:
            raise ValueError(f"{self.stage!r} is no growth stage: it is one of {', '.join(STAGES)}")
        if not (math.isfinite(self.scale) and 0.2 <= self.scale <= 3.0):
            raise ValueError(f"a plant's scale is 0.2 to 3, not {self.scale}")
        if not (math.isfinite(self.markings) and 0.0 <= self.markings <= 1.5):
            raise ValueError(f"a plant's markings are 0 to 1.5, not {self.markings}")
        if not all(map(math.isfinite, (self.x_m, self.y_m, self.yaw_deg))):
            raise ValueError("a plant's place and heading must be finite")
