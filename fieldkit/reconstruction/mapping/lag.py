"""How far recorded positions lag behind the photographs that they belong to: cameras write those of some moment before.

A lag moves each photograph another way wherever a flight turns, so that no similarity takes it out of the positions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.geometry.similarity import fit_similarity

_LAGS = np.linspace(-3.0, 3.0, 61)
"""That are tried, in photographs; what is below 0 runs ahead."""
_LEAST = 6
"""Photographs that a lag is told from: a similarity takes up seven of their numbers."""
_FITS = 0.33
"""Largest share of the residuals that a lag may leave: positions that are right, or wrong otherwise, leave more."""
_ROUNDS = 4
"""Number of fits, each to those photographs whose residual was small in the last."""
_OUTLIERS = 2.5
"""Largest residual of a photograph that is kept for the next fit, times the median."""


class Lag(NamedTuple):
    """How far positions lag along the flight, and how well they fit without and with that."""

    photographs: float
    metres: float
    before_m: float
    after_m: float


def find_lag(centers: FloatArray, positions: FloatArray) -> Lag | None:
    """The lag with which positions (n, 3), metres, fit the camera centres (n, 3) of a model of any scale.

    Both are in the order of the flight. Gives None where no lag fits far better than none: for positions that are
    right or wrong otherwise, and for flights along a line or a circle, which a lag moves into themselves.
    """
    number = np.arange(len(positions))
    fits = []
    for lag in _LAGS:
        at = number + lag
        inside = (at >= 0) & (at <= len(number) - 1)
        if inside.sum() >= _LEAST:
            moved = np.stack([np.interp(at[inside], number, column) for column in positions.T], axis=1)
            metres = float(np.median(np.linalg.norm(moved - positions[inside], axis=1)))
            fits.append((_residual(centers[inside], moved), lag, metres))
    if not fits:
        return None
    before = min(residual for residual, lag, _ in fits if abs(lag) < 0.5 * (_LAGS[1] - _LAGS[0]))
    after, lag, metres = min(fits)
    return Lag(float(lag), metres, before, after) if after < _FITS * before else None


def _residual(source: FloatArray, target: FloatArray) -> float:
    """Median distance of points (n, 3) from others after the similarity that fits most of them."""
    kept = np.ones(len(source), np.bool_)
    residuals = np.full(len(source), np.inf)
    for _ in range(_ROUNDS):
        try:
            residuals = np.linalg.norm(fit_similarity(source[kept], target[kept]).apply(source) - target, axis=1)
        except ValueError:  # on one line
            break
        kept = residuals <= _OUTLIERS * np.median(residuals)
    return float(np.median(residuals))
