"""Which photographs of a closed canopy tie each other.

Soil between rows, in gaps and in alleys ties them, for leaves repeat and sway; the taller plants are, the less of it
shows, and least where views differ. Fitted to 220 pairs of five flights over rendered blocks at V6, V10 and R1, in
10 mm of wind, straight down and 60° down from 5, 8 and 12 m, by their true poses and by nothing but what lies within
the block: amid a trial photographs show no bare field around it. Blocks of one stage differ: from 20° on, two at V10
have half to two thirds of a third one's matches. At R1 six of six pairs 10 to 20° apart tied, more than this says.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray

_MATCHES = 3370.0
"""Of two photographs that see all alike from the same place, by height and angle; from 0.6 m of height on."""
_DECAY_DEG = 30.0
"""Angle between views at which 1/e of these is left, degrees."""
_DECAY_M = 0.82
"""Height of plants at which 1/e of these is left, metres."""
_CHANCE = 40.0
"""Matches of two photographs that show the same, but by a wrong relative pose, at wide angles."""
_CHANCE_DEG = 10.0
"""Angle between views at which all but 1/e of these are there, degrees."""


def canopy_matches(angle_deg: ArrayLike, overlap: ArrayLike, height_m: ArrayLike) -> FloatArray:
    """Expected matches of pairs of photographs, those by chance among them.

    Arguments broadcast.

    Args:
        angle_deg: between the two lines of sight to the middle of the ground that both show.
        overlap: share of the picture that both show, from 0 to 1.
        height_m: of the plants' highest leaves above the ground.
    """
    angle_deg, overlap = np.asarray(angle_deg), np.asarray(overlap)
    by_chance = -_CHANCE * np.expm1(-angle_deg / _CHANCE_DEG)
    decay = angle_deg / _DECAY_DEG + np.asarray(height_m) / _DECAY_M
    return np.asarray((_MATCHES * np.exp(-decay) + by_chance) * overlap)
