"""Angles on a circle."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Degrees = TypeVar("Degrees", float, NDArray[np.float64])


def wrapped_deg(degrees: Degrees) -> Degrees:
    """The same direction, or the turn the short way about, in [−180, 180)."""
    return (degrees + 180.0) % 360.0 - 180.0
