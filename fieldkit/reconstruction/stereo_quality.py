"""What dense stereo can be expected to make of views and pairs of views, by angles, incidence and resolution.

The terms and constants that the planner's geometric score (`fieldkit.planning.score.geometric`) and the evidence for a
reconstruction (`fieldkit.reconstruction.evidence`) have in common.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StereoQuality:
    """Constants of what views and pairs are worth.

    What is from elsewhere says where. How incidence, resolution and the angle's far side enter was chosen among a dozen
    ways by 25 evaluations of rings, arcs, chains and clumps about tuning-1 and tuning-2: all milder than in the
    prototype, whose stereo was simpler.
    """

    best_angle_deg: float = 12.0
    """Θ₀ between two rays at which a pair is worth most: 12° in the prototype and for dense stereo's choice of
    sources (`dense.settings.Settings`)."""
    tail_deg: float = 20.0
    """Over which a pair's worth falls to 1/e on the far side, as guided matches fall on real plants (219, 153, 73
    and 56 above chance at 18, 27, 36 and 46° on basil_rig)."""
    facing: tuple[float, float] = (0.1, 0.5)
    """|n·v| up to which a surface is too steep, and from which it is as good as seen squarely."""
    pixel_m: float = 0.008
    """Footprint of a pixel at which resolution has halved what a pair is worth."""
    width: int = 750
    """Of dense stereo's views in pixels, which footprints are counted in (`standard`)."""
    error_px: float = 0.5
    """Of a match, for the noise of depths."""
    cap_m: float = 0.10
    """Of every distance, as in the objective's rule (`Rule`)."""

    def of_views(self, seen: NDArray[np.bool_], facing: Array, footprint_m: Array) -> Array:
        """Quality in [0, 1] of views at points: seen · incidence / (1 + (footprint / `pixel_m`)²).

        Args:
            seen: whether a view has a point in its picture, unhidden.
            facing: |n·v| of the surface's normal and the ray, 1 where there are no normals.
            footprint_m: of a pixel at the point, metres.
        """
        steep, square = self.facing
        incidence = np.clip((facing - steep) / (square - steep), 0.0, 1.0)
        quality: Array = seen * incidence / (1.0 + (footprint_m / self.pixel_m) ** 2)
        return quality

    def of_angles(self, degrees: Array) -> Array:
        """What pairs are worth by the angle θ between their rays: (θ/θ₀ · e^(1 − θ/θ₀)) to the power of θ₀ / tail."""
        ratio = degrees / self.best_angle_deg
        worth: Array = (ratio * np.exp(1.0 - ratio)) ** (self.best_angle_deg / self.tail_deg)
        return worth
