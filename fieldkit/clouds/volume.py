"""The volume of interest: an axis-aligned box in the plot frame."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.clouds.cloud import Cloud


@dataclass(frozen=True)
class Volume:
    """An axis-aligned box."""

    lower: tuple[float, float, float]
    """X, y and z of the lowest corner, metres in the plot frame."""
    upper: tuple[float, float, float]
    """The highest corner."""

    def __post_init__(self) -> None:
        lower, upper = (tuple(float(v) for v in np.asarray(c).reshape(-1)) for c in (self.lower, self.upper))
        if len(lower) != 3 or len(upper) != 3 or not np.isfinite([*lower, *upper]).all():
            raise ValueError("a volume needs two corners of three finite numbers")
        if any(low >= high for low, high in zip(lower, upper, strict=True)):
            raise ValueError(f"the lower corner {lower} is not below the upper corner {upper}")
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)

    @classmethod
    def around(cls, points: ArrayLike, *, margin_m: float = 0.0, trim: float = 0.0) -> Volume:
        """The smallest box around points (n, 3), grown by ``margin_m``.

        Args:
            points: (n, 3) metres.
            margin_m: added on every side; a flat cloud needs one.
            trim: share of the points to leave out at each end of each axis (0.01 ignores 1 % outliers per side).
        """
        p = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        if not len(p):
            raise ValueError("no points to put a box around")
        lower, upper = np.quantile(p, [trim, 1.0 - trim], axis=0) if trim else (p.min(axis=0), p.max(axis=0))
        return cls(tuple(lower - margin_m), tuple(upper + margin_m))

    @property
    def center(self) -> FloatArray:
        """(3,) metres."""
        center: FloatArray = 0.5 * (np.array(self.lower) + np.array(self.upper))
        return center

    @property
    def size(self) -> FloatArray:
        """(3,) lengths of the edges, metres."""
        size: FloatArray = np.array(self.upper) - np.array(self.lower)
        return size

    @property
    def diagonal(self) -> float:
        """Metres."""
        return float(np.linalg.norm(self.size))

    def grown(self, margin_m: float) -> Volume:
        """The box with ``margin_m`` more on every side."""
        lower, upper = np.array(self.lower) - margin_m, np.array(self.upper) + margin_m
        return Volume(tuple(lower), tuple(upper))

    def contains(self, points: ArrayLike) -> BoolArray:
        """Mask (n,) of the points (n, 3) inside; the faces belong to the box."""
        p = np.asarray(points, dtype=np.float64)
        inside = np.ones(len(p), dtype=np.bool_)
        for axis in range(3):
            inside &= (p[:, axis] >= self.lower[axis]) & (p[:, axis] <= self.upper[axis])
        return inside

    def corners(self) -> FloatArray:
        """(8, 3) corners; z changes fastest."""
        return np.array(list(itertools.product(*zip(self.lower, self.upper, strict=True))))


def crop(cloud: Cloud, volume: Volume) -> Cloud:
    """The part of a cloud inside a volume, in the same order."""
    return cloud.select(volume.contains(cloud.points))
