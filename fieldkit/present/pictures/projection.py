"""Orthographic pictures of point clouds: NumPy only, no plotting.

Points are drawn as discs, nearest last, and shaded by eye-dome lighting (Boucheny 2009): pixels with nearer neighbours
are darkened, so that leaves stand out without normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_SHADING = 0.5
_FULL_SHADE_SHARE = 0.04  # of the depth range; deeper steps are fully shaded


@dataclass(frozen=True)
class Direction:
    """A direction to look at a cloud from.

    Attributes:
        name: for people.
        right, up: axes (0, 1, 2) that run to the right and upwards.
        toward: axis that runs towards the viewer, and its sign.
        sign: +1 or −1.
    """

    name: str
    right: int
    up: int
    toward: int
    sign: float

    def flat(self, point: NDArray[np.float64]) -> tuple[float, float]:
        """Coordinates (to the right, upwards) of a point (3,) in the picture."""
        return float(point[self.right]), float(point[self.up])


FRONT = Direction("from the front (looking along +y)", 0, 2, 1, -1.0)
SIDE = Direction("from the side (looking along −x)", 1, 2, 0, 1.0)
TOP = Direction("from above", 0, 1, 2, 1.0)


@dataclass(frozen=True)
class Window:
    """The part of the plane that a picture shows, and its resolution.

    Attributes:
        left, right, bottom, top: metres.
        width, height: pixels.
    """

    left: float
    right: float
    bottom: float
    top: float
    width: int
    height: int

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """As Matplotlib's imshow takes it."""
        return self.left, self.right, self.bottom, self.top

    @property
    def pixels_per_metre(self) -> float:
        return self.width / (self.right - self.left)


def draw_points(
    points: NDArray[np.float64], colors: NDArray[np.uint8], direction: Direction, window: Window
) -> NDArray[np.uint8]:
    """A picture (height, width, 4) RGBA of points (n, 3) with colours (n, 3); transparent where there is none."""
    picture = np.zeros((window.height, window.width, 4), dtype=np.uint8)
    scale = window.pixels_per_metre
    column = (points[:, direction.right] - window.left) * scale
    row = (window.top - points[:, direction.up]) * scale
    inside = (column >= 0) & (column < window.width) & (row >= 0) & (row < window.height)
    if not inside.any():
        return picture
    column_of, row_of = column[inside].astype(np.int64), row[inside].astype(np.int64)
    near = direction.sign * points[inside, direction.toward]
    shades = colors[inside]
    offsets = _disc(_radius(row_of * window.width + column_of))
    rows = (row_of[None, :] + offsets[:, :1]).ravel()
    columns = (column_of[None, :] + offsets[:, 1:]).ravel()
    fits = (rows >= 0) & (rows < window.height) & (columns >= 0) & (columns < window.width)
    pixel = (rows * window.width + columns)[fits]
    source = np.tile(np.arange(len(near)), len(offsets))[fits]
    order = np.argsort(near[source], kind="stable")
    # The nearest point is written last: NumPy assigns repeated indices in order.
    winner = np.full(window.width * window.height, -1, dtype=np.int64)
    winner[pixel[order]] = source[order]
    covered = winner >= 0
    depth = np.full(len(winner), -np.inf)
    depth[covered] = near[winner[covered]]
    shade = eye_dome_shade(depth.reshape(window.height, window.width)).ravel()[covered]
    flat = picture.reshape(-1, 4)
    flat[covered, :3] = np.clip(shades[winner[covered]] * shade[:, None], 0, 255).astype(np.uint8)
    flat[covered, 3] = 255
    return picture


def eye_dome_shade(nearness: NDArray[np.float64]) -> NDArray[np.float64]:
    """Brightness (h, w) in (0, 1] from nearness to the viewer (h, w), −inf where there is nothing."""
    covered = np.isfinite(nearness)
    if not covered.any():
        return np.ones_like(nearness)
    low, high = np.quantile(nearness[covered], [0.01, 0.99])
    unit = max(_FULL_SHADE_SHARE * (high - low), 1e-12)
    padded = np.pad(nearness, 2, constant_values=-np.inf)
    height, width = nearness.shape
    obscurance = np.zeros_like(nearness)
    own = np.where(covered, nearness, 0.0)
    for dy, dx in ((-2, 0), (2, 0), (0, -2), (0, 2), (-1, -1), (-1, 1), (1, -1), (1, 1)):
        beside = padded[2 + dy : 2 + dy + height, 2 + dx : 2 + dx + width]
        step = np.where(np.isfinite(beside), beside - own, 0.0)
        obscurance += np.clip(step / unit, 0.0, 1.0)
    return np.where(covered, np.exp(-_SHADING * obscurance / 4.0), 1.0)


def _radius(pixel: NDArray[np.int64]) -> int:
    """Disc radius in pixels: 1 if points are so dense that they share pixels, else 2."""
    return 1 if len(pixel) > 1.5 * len(np.unique(pixel)) else 2


def _disc(radius: int) -> NDArray[np.int64]:
    steps = np.arange(-radius, radius + 1)
    dy, dx = np.meshgrid(steps, steps, indexing="ij")
    inside = dy**2 + dx**2 <= radius**2 + 0.5
    disc: NDArray[np.int64] = np.stack([dy[inside], dx[inside]], axis=1)
    return disc
