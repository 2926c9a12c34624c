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
from scipy.special import ndtr

from fieldkit.arrays import FloatArray
from fieldkit.reconstruction.mapping.view_graph import EDGE_FACTOR, EDGE_MATCHES

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
_SPREAD = 0.65
"""Standard deviation of the logarithm of a pair's matches, and of what a block has more or less than others."""


def canopy_matches(angle_deg: ArrayLike, overlap: ArrayLike, height_m: ArrayLike) -> FloatArray:
    """Expected matches of pairs of photographs, those by chance among them; arguments as for `ties`."""
    decay = np.asarray(angle_deg) / _DECAY_DEG + np.asarray(height_m) / _DECAY_M
    matches: FloatArray = _MATCHES * np.exp(-decay) * np.asarray(overlap) + _by_chance(angle_deg, overlap)
    return matches


def ties(angle_deg: ArrayLike, overlap: ArrayLike, height_m: ArrayLike) -> FloatArray:
    """Probability that pairs of photographs tie each other, as mapping judges it (`is_edge`).

    Arguments broadcast.

    Args:
        angle_deg: between the two lines of sight to the middle of the ground that both show.
        overlap: share of the picture that both show, from 0 to 1.
        height_m: of the plants' highest leaves above the ground.
    """
    least = np.maximum(EDGE_MATCHES, EDGE_FACTOR * _by_chance(angle_deg, overlap))
    matches = np.maximum(canopy_matches(angle_deg, overlap, height_m), 1e-9)
    probability: FloatArray = ndtr(np.log(matches / least) / _SPREAD)
    return probability


def _by_chance(angle_deg: ArrayLike, overlap: ArrayLike) -> FloatArray:
    matches: FloatArray = -_CHANCE * np.expm1(-np.asarray(angle_deg) / _CHANCE_DEG) * np.asarray(overlap)
    return matches
