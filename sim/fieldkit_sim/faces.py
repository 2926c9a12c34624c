"""Triangles of grids, and the normals of meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import Float32Array


def grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """Two triangles per cell of a grid whose points are numbered row by row."""
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])


def vertex_normals(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> Float32Array:
    """(n, 3) unit normals, each the area-weighted mean of the adjacent triangles' normals."""
    points = np.asarray(vertices, dtype=np.float64)
    a, b, c = (points[faces[:, i]] for i in range(3))
    face_normals = np.cross(b - a, c - a)
    normals = np.zeros_like(points)
    for corner in range(3):
        for axis in range(3):
            normals[:, axis] += np.bincount(faces[:, corner], face_normals[:, axis], minlength=len(points))
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.maximum(lengths, 1e-30), dtype=np.float32)
