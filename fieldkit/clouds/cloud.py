"""The point cloud every other module passes around."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from fieldkit.geometry import Similarity


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points with what is known about each of them. The arrays are read-only."""

    points: FloatArray
    """(n, 3) float64, metres, finite."""
    colors: ByteArray | None = None
    """(n, 3) uint8 sRGB, or None."""
    normals: Float32Array | None = None
    """(n, 3) float32 in the points' frame, unit length or zero where unknown, or None."""
    filled: BoolArray | None = None
    """(n,) whether a point fills a hole that dense stereo left (`fieldkit.reconstruction.dense.fusion`), or None."""

    def __post_init__(self) -> None:
        points = _rows("points", self.points, np.float64)
        if not np.isfinite(points).all():
            raise ValueError("points must be finite")
        object.__setattr__(self, "points", points)
        if self.colors is not None:
            if np.asarray(self.colors).dtype != np.uint8:
                raise ValueError("colors must be uint8")
            object.__setattr__(self, "colors", _rows("colors", self.colors, np.uint8, len(points)))
        if self.normals is not None:
            object.__setattr__(self, "normals", _rows("normals", self.normals, np.float32, len(points)))
        if self.filled is not None and (self.filled.shape != (len(points),) or self.filled.dtype != np.bool_):
            raise ValueError(f"filled must be bool of shape {(len(points),)}")

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def empty(cls) -> Cloud:
        """A cloud without points, colours or normals."""
        return cls(np.zeros((0, 3)))

    def select(self, index: ArrayLike) -> Cloud:
        """The points that a boolean mask (n,) or an array of indices picks, in that order."""
        chosen = np.asarray(index)
        if chosen.size == 0 and chosen.dtype != np.bool_:
            chosen = chosen.astype(np.int64)
        return Cloud(
            self.points[chosen],
            None if self.colors is None else self.colors[chosen],
            None if self.normals is None else self.normals[chosen],
            None if self.filled is None else self.filled[chosen],
        )

    def measured(self) -> Cloud:
        """The points that fill no holes."""
        return self if self.filled is None else self.select(~self.filled)

    def transformed(self, transform: Similarity) -> Cloud:
        """The same cloud in the target frame of ``transform``; normals are turned with it."""
        normals = None
        if self.normals is not None:
            normals = (self.normals @ transform.rotation.T).astype(np.float32)
        return Cloud(transform.apply(self.points), self.colors, normals, self.filled)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner (3,), (3,) of the points."""
        return self.points.min(axis=0), self.points.max(axis=0)


def concatenate(clouds: Sequence[Cloud]) -> Cloud:
    """One cloud of all points in order; what else is known is kept where every non-empty cloud has it."""
    parts = [cloud for cloud in clouds if len(cloud)]
    if not parts:
        return Cloud.empty()

    def joined(arrays: list[NDArray[Any] | None]) -> Any:
        known = [array for array in arrays if array is not None]
        return np.concatenate(known) if len(known) == len(parts) else None

    return Cloud(
        np.concatenate([cloud.points for cloud in parts]),
        joined([cloud.colors for cloud in parts]),
        joined([cloud.normals for cloud in parts]),
        joined([cloud.filled for cloud in parts]),
    )


def _rows(name: str, values: ArrayLike, dtype: type, count: int | None = None) -> NDArray[Any]:
    array: NDArray[Any] = np.ascontiguousarray(values, dtype=dtype)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name} must have the shape (n, 3), not {array.shape}")
    if count is not None and len(array) != count:
        raise ValueError(f"{len(array)} {name} for {count} points")
    view = array.view()
    view.setflags(write=False)
    return view
