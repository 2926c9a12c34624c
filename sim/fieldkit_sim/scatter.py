"""Bodies scattered over the ground: where they lie and how they become one mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.plot_description import SCATTER_M
from fieldkit.scenes.scene import Mesh, vertex_normals


def places(seed: int, count: int, purpose: int) -> tuple[np.random.Generator, NDArray[np.float64]]:
    """A generator and (count, 2) places in the square ±`SCATTER_M`, drawn from it."""
    rng = np.random.default_rng([seed, purpose])
    return rng, rng.uniform(-SCATTER_M, SCATTER_M, (count, 2))


def pile(name: str, vertices: list[NDArray[np.float64]], faces: list[NDArray[np.int32]],
          colors: list[NDArray[np.float64]]) -> Mesh:  # fmt: skip
    """One mesh of many bodies whose faces already count their vertices in order."""
    if not vertices:
        empty = np.zeros((0, 3), np.float32)
        return Mesh(name, empty, np.zeros((0, 3), np.int32), empty, colors=empty)
    points, triangles = np.concatenate(vertices).astype(np.float32), np.concatenate(faces).astype(np.int32)
    return Mesh(
        name, points, triangles, vertex_normals(points, triangles), colors=np.concatenate(colors).astype(np.float32)
    )
