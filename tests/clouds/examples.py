"""Clouds the tests of this folder share."""

import numpy as np
from hypothesis import strategies as st

from fieldkit.clouds import Cloud


def leaves(count: int, *, noise_m: float = 0.0, seed: int = 0) -> np.ndarray:
    """(count, 3) points on twelve bent sheets within about 1 m; the sheets are the same for every seed."""
    shape = np.random.default_rng(99)
    axes, centers = shape.normal(size=(12, 3, 2)) * 0.1, shape.uniform(-0.4, 0.4, (12, 3))
    bend = shape.normal(size=(12, 3)) * 0.05
    rng = np.random.default_rng(seed)
    sheet, uv = rng.integers(0, 12, count), rng.uniform(-1, 1, (count, 2))
    points = np.einsum("nij,nj->ni", axes[sheet], uv) + centers[sheet] + bend[sheet] * uv[:, :1] * uv[:, 1:]
    return points + rng.normal(size=points.shape) * noise_m


@st.composite
def clouds(draw: st.DrawFn, *, min_size: int = 0, max_size: int = 40, extent_m: float = 5.0) -> Cloud:
    """Clouds with or without colours and normals; some points coincide."""
    count = draw(st.integers(min_size, max_size))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    center = rng.normal(size=3) * draw(st.sampled_from([0.0, 1.0, 1e3, 1e6]))
    points = center + rng.uniform(-extent_m, extent_m, (count, 3))
    if count and draw(st.booleans()):
        points = points[rng.integers(0, max(count // 2, 1), count)]
    colors = rng.integers(0, 256, (count, 3)).astype(np.uint8) if draw(st.booleans()) else None
    normals = None
    if draw(st.booleans()):
        raw = rng.normal(size=(count, 3))
        normals = (raw / np.linalg.norm(raw, axis=1, keepdims=True)).astype(np.float32)
    return Cloud(points, colors, normals)


def cone(radius: float, height: float, count: int = 30_000, seed: int = 0) -> np.ndarray:
    """Points on the side of an upright cone, even by area."""
    rng = np.random.default_rng(seed)
    t, turn = np.sqrt(rng.uniform(size=count)), rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([radius * t * np.cos(turn), radius * t * np.sin(turn), height * (1 - t)])
