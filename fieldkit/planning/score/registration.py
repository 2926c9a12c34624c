"""The probability that blind mapping registers all photographs of a set, by the set's connectivity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray

THRESHOLD = 23.0
"""Connectivity at which half of the sets register whole."""
_DOUBT = 0.5
"""Standard deviation of the threshold's logarithm before anything was registered."""
_THRESHOLDS = np.linspace(-4.0, 4.0, 81)
_WIDTHS = np.array([0.2, 0.3, 0.45])
_LEAST = 1e-6
"""Least connectivity, which keeps its logarithm finite."""


@dataclass(frozen=True, eq=False)
class Registration:
    """The connectivity c that mapping needs: P(whole | c) = 1 / (1 + (c₀ / c)^(1/w)).

    Both constants are unknown. Their posterior is kept on a grid; the prior has c₀ of 23 matches times or divided by
    e^½, and w from 0.2 to 0.45 (65 sets about tuning-1 and tuning-2, docs/decisions.md). While
    every set fails, c₀ rises above what was tried.
    """

    thresholds: FloatArray
    """(g,) ln c₀ of the grid."""
    widths: FloatArray
    """(g,) w."""
    weights: FloatArray
    """(g,) probabilities; they sum to 1."""

    @classmethod
    def learn(cls, connectivities: ArrayLike, whole: Sequence[bool]) -> Registration:
        """The posterior after sets of connectivities (t,) that did or did not register whole (t,); t may be 0."""
        standard, widths = (grid.ravel() for grid in np.meshgrid(_THRESHOLDS, _WIDTHS, indexing="ij"))
        thresholds = np.log(THRESHOLD) + _DOUBT * standard
        places = _logarithms(connectivities)
        sign = np.where(np.asarray(whole, dtype=bool), 1.0, -1.0)
        margins = sign[:, None] * (places[:, None] - thresholds) / widths
        log_weights = -0.5 * standard**2 - np.logaddexp(0.0, -margins).sum(axis=0)
        weights = np.exp(log_weights - log_weights.max())
        return cls(thresholds, widths, weights / weights.sum())

    def probability(self, connectivities: ArrayLike) -> FloatArray:
        """Probability that sets of these connectivities register whole, of their shape; above 0."""
        places = _logarithms(connectivities)
        odds = np.exp(np.minimum((self.thresholds - places[..., None]) / self.widths, 500.0))
        found: FloatArray = (self.weights / (1.0 + odds)).sum(axis=-1)
        return found


def _logarithms(connectivities: ArrayLike) -> FloatArray:
    found: FloatArray = np.log(np.maximum(np.asarray(connectivities, dtype=np.float64), _LEAST))
    return found
