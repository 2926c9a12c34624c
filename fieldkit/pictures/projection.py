"""Orthographic pictures of point clouds: NumPy only, no plotting.

Points are drawn as discs, nearest last, and shaded by eye-dome lighting (Boucheny 2009): pixels with nearer neighbours
are darkened, so that leaves stand out without normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import ByteArray, FloatArray, IntArray

_POINTS_AT_A_TIME = 100_000
"""Number of points that are drawn at a time, which bounds memory."""
_SHADING = 0.5
"""Strength of the shade behind steps in depth."""
_FULL_SHADE_SHARE = 0.04  # of the depth range; deeper steps are fully shaded


@dataclass(frozen=True)
class Direction:
    """A direction to look at a cloud from, by axes (0, 1, 2)."""

    name: str
    right: int
    up: int
    toward: int
    """The axis that runs towards the viewer."""
    sign: float
    """+1 or −1, of that axis."""

    def flat(self, point: FloatArray) -> tuple[float, float]:
        """Coordinates (to the right, upwards) of a point (3,) in the picture."""
        return float(point[self.right]), float(point[self.up])


FRONT = Direction("from the front (looking along +y)", 0, 2, 1, -1.0)
SIDE = Direction("from the side (looking along −x)", 1, 2, 0, 1.0)
TOP = Direction("from above", 0, 1, 2, 1.0)


@dataclass(frozen=True)
class Window:
    """The part of the plane that a picture shows, in metres, and its size in pixels."""

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


def draw_points(points: FloatArray, colors: ByteArray, direction: Direction, window: Window) -> ByteArray:
    """A picture (height, width, 4) RGBA of points (n, 3) with colours (n, 3); transparent where there is none."""
    picture = np.zeros((window.height, window.width, 4), dtype=np.uint8)
    shown = _nearest_points(points, direction, window)
    covered = shown >= 0
    if not covered.any():
        return picture
    depth = np.full(len(shown), -np.inf)
    depth[covered] = direction.sign * points[shown[covered], direction.toward]
    shade = eye_dome_shade(depth.reshape(window.height, window.width)).ravel()[covered]
    flat = picture.reshape(-1, 4)
    flat[covered, :3] = np.clip(colors[shown[covered]] * shade[:, None], 0, 255).astype(np.uint8)
    flat[covered, 3] = 255
    return picture


def _nearest_points(points: FloatArray, direction: Direction, window: Window) -> IntArray:
    """(pixels,) the point that each pixel shows, −1 where there is none; of equally near ones that of the later offset
    in its disc, then the later point. Points are taken some at a time, so that millions of them take no memory.
    """
    starts = range(0, len(points), _POINTS_AT_A_TIME)
    offsets = _disc(_radius(points, starts, direction, window))
    size = window.width * window.height
    best, best_offset, shown = np.full(size, -np.inf), np.full(size, -1), np.full(size, -1, dtype=np.int64)
    for start in starts:
        some, row_of, column_of = _seen(points, start, direction, window)
        near = direction.sign * points[some, direction.toward]
        rows = (row_of[None, :] + offsets[:, :1]).ravel()
        columns = (column_of[None, :] + offsets[:, 1:]).ravel()
        place = np.flatnonzero((rows >= 0) & (rows < window.height) & (columns >= 0) & (columns < window.width))
        pixel = rows[place] * window.width + columns[place]
        order = np.argsort(near[place % len(near)], kind="stable")
        # The nearest point is written last: NumPy assigns repeated indices in order.
        winner = np.full(size, -1, dtype=np.int64)
        winner[pixel[order]] = place[order]
        hit = np.flatnonzero(winner >= 0)
        offset, source = np.divmod(winner[hit], len(near))
        wins = (near[source] > best[hit]) | ((near[source] == best[hit]) & (offset >= best_offset[hit]))
        hit, offset, source = hit[wins], offset[wins], source[wins]
        best[hit], best_offset[hit], shown[hit] = near[source], offset, some[source]
    return shown


def _seen(points: FloatArray, start: int, direction: Direction, window: Window) -> tuple[IntArray, IntArray, IntArray]:
    """Of the points from ``start`` on, as many as are taken at a time: those in the window, their rows and columns."""
    some = points[start : start + _POINTS_AT_A_TIME]
    column = (some[:, direction.right] - window.left) * window.pixels_per_metre
    row = (window.top - some[:, direction.up]) * window.pixels_per_metre
    inside = (column >= 0) & (column < window.width) & (row >= 0) & (row < window.height)
    return start + np.flatnonzero(inside), row[inside].astype(np.int64), column[inside].astype(np.int64)


def eye_dome_shade(nearness: FloatArray) -> FloatArray:
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


def _radius(points: FloatArray, starts: range, direction: Direction, window: Window) -> int:
    """Disc radius in pixels: 1 if points are so dense that they share pixels, else 2."""
    hit, count = np.zeros(window.width * window.height, dtype=np.bool_), 0
    for start in starts:
        _, rows, columns = _seen(points, start, direction, window)
        hit[rows * window.width + columns] = True
        count += len(rows)
    return 1 if count > 1.5 * np.count_nonzero(hit) else 2


def _disc(radius: int) -> IntArray:
    steps = np.arange(-radius, radius + 1)
    dy, dx = np.meshgrid(steps, steps, indexing="ij")
    inside = dy**2 + dx**2 <= radius**2 + 0.5
    disc: IntArray = np.stack([dy[inside], dx[inside]], axis=1)
    return disc
