"""Plants from mesh files (OBJ, PLY, GLB, glTF, STL), with the file's colours or a leaf's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.arrays import ByteArray, Float32Array, FloatArray, IntArray
from fieldkit.errors import SceneError
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.plot_description import Axis, MeshPlantDescription
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.faces import vertex_normals

MAX_TRIANGLES = 2_000_000
"""Most triangles that are drawn."""
_SUFFIXES = (".obj", ".ply", ".glb", ".gltf", ".stl")
_CONVERT = "Open it in MeshLab or Blender and export it as binary PLY or GLB."
_FINE_EDGE_M = 0.003
"""Median edge to which coarse triangles are divided, metres."""
_FINE_TRIANGLES = 200_000
"""Most triangles that dividing leads to."""


def build_mesh_plant(plant: MeshPlantDescription, ground_m: float = 0.0) -> Mesh:
    """The plant as one mesh with normals, unlit, its lowest point at height ``ground_m``.

    The texture or the vertex colours of the file are kept. Where it has none the triangles are divided to
    3 mm (up to 200,000 of them) and coloured as leaves: green, paler and yellower in flecks, browner at the foot.
    """
    path = Path(plant.file)
    loaded = _load(path)
    vertices, faces = np.asarray(loaded.vertices, np.float64), np.asarray(loaded.faces, np.int64)
    uv, texture, colors = _appearance(loaded.visual) if plant.color == "file" else (None, None, None)
    if not np.isfinite(vertices).all():
        raise SceneError("a vertex is not finite", path=path, remedy=_CONVERT)
    vertices = plant.unit_m * plant.scale * vertices @ _upright(plant.up).T
    height = float(np.ptp(vertices[:, 2]))
    if not 0.005 <= max(height, float(np.ptp(vertices, axis=0).max())) <= 10.0:
        raise SceneError(
            f"the plant would be {height:.4g} m high",
            path=path,
            remedy="Set unit_m to metres per unit of the file (0.001 for millimetres), and up to its upward axis.",
        )
    if colors is None and texture is None:
        vertices, faces = _divided(vertices, faces)
        colors = _leaf_colors(vertices, plant.seed)
    placed = _placed(vertices, plant, ground_m).astype(np.float32)
    triangles = faces.astype(np.int32)
    return Mesh(
        f"mesh-{path.stem}",
        placed,
        triangles,
        vertex_normals(placed, triangles),
        uv,
        texture,
        colors,
        plant=True,
    )


def _load(path: Path) -> Any:
    if path.suffix.lower() not in _SUFFIXES:
        raise SceneError(f"is not one of {', '.join(_SUFFIXES)}", path=path, remedy=_CONVERT)
    if not path.is_file():
        raise SceneError("there is no such mesh file", path=path, remedy="Check 'file' in the scene file.")
    import trimesh

    try:
        loaded = trimesh.load_scene(path)
        counts = [len(g.faces) for g in loaded.geometry.values() if isinstance(g, trimesh.Trimesh)]
        mesh = loaded.to_mesh() if sum(counts) else None
    except Exception as error:  # trimesh's loaders raise anything, from KeyError to struct.error, on broken files
        raise SceneError(f"cannot be read as a mesh ({error})", path=path, remedy=_CONVERT) from error
    if mesh is None or not len(mesh.faces):
        raise SceneError("has no triangles", path=path, remedy="Make a surface of its points in MeshLab, say.")
    if len(mesh.faces) > MAX_TRIANGLES:
        message = f"has {len(mesh.faces):,} triangles; up to {MAX_TRIANGLES:,} are drawn"
        raise SceneError(message, path=path, remedy="Simplify it in MeshLab to 200,000 triangles.")
    return mesh


def _appearance(visual: Any) -> tuple[Float32Array | None, ByteArray | None, Float32Array | None]:
    """(uv, texture, vertex colours); all None where the file has neither a texture nor colours of vertices."""
    if visual.kind == "vertex":
        return None, None, (np.asarray(visual.vertex_colors)[:, :3] / 255.0).astype(np.float32)
    if visual.kind == "texture" and visual.uv is not None:
        image = getattr(visual.material, "baseColorTexture", None) or getattr(visual.material, "image", None)
        if image is not None:
            texture = np.ascontiguousarray(np.asarray(image.convert("RGB"), np.uint8))
            return np.asarray(visual.uv, np.float32)[:, :2].copy(), texture, None
    return None, None, None


def _upright(up: Axis) -> FloatArray:
    """(3, 3) rotation that takes the file's upward axis to z."""
    sign, axis = (-1.0 if up.startswith("-") else 1.0), "xyz".index(up[-1])
    z = np.zeros(3)
    z[axis] = sign
    x = np.zeros(3)
    x[(axis + 1) % 3] = 1.0
    return np.stack([x, np.cross(z, x), z])


def _placed(vertices: FloatArray, plant: MeshPlantDescription, ground_m: float) -> FloatArray:
    lowest = vertices[:, 2].min()
    foot = vertices[vertices[:, 2] <= lowest + 0.01 * np.ptp(vertices[:, 2])].mean(axis=0)
    foot[2] = lowest
    spin = rotation_about_z(np.radians(-plant.yaw_deg))
    return np.asarray((vertices - foot) @ spin.T + (plant.x_m, plant.y_m, ground_m))


def _divided(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """The same surface in triangles fine enough to carry colour per vertex."""
    import trimesh

    while len(faces) * 4 <= _FINE_TRIANGLES:
        edges = vertices[faces[:, [1, 2, 0]]] - vertices[faces]
        if np.median(np.linalg.norm(edges, axis=-1)) <= _FINE_EDGE_M:
            break
        divided = trimesh.remesh.subdivide(vertices, faces)  # type: ignore[no-untyped-call]
        vertices, faces = np.asarray(divided[0], np.float64), np.asarray(divided[1], np.int64)
    return vertices, faces


def _leaf_colors(vertices: FloatArray, seed: int) -> Float32Array:
    """(n, 3) leaf colours in [0, 1] that vary with the place on the plant."""
    x, y, z = vertices.T - vertices.min(axis=0)[:, None]
    tone = sum(
        weight
        * (
            fractal_noise(x / cell + 0.7 * z / cell, y / cell - 0.4 * z / cell, seed + k, octaves=3)
            + fractal_noise(z / cell, (x - y) / cell, seed + 10 + k, octaves=3)
        )
        for k, (cell, weight) in enumerate(((0.04, 0.10), (0.010, 0.12), (0.004, 0.14)))
    )
    fleck = fractal_noise(x / 0.012 + z / 0.02, y / 0.012, seed + 20, octaves=3)
    color = np.array([0.40, 0.55, 0.25]) * (1.0 + np.asarray(tone))[:, None]
    pale = 0.6 * np.clip((fleck - 0.35) * 4.0, 0.0, 1.0)[:, None]
    color += (np.array([0.66, 0.68, 0.40]) - color) * pale
    foot = 0.5 * np.clip(1.0 - z / 0.05, 0.0, 1.0)[:, None]
    color += (np.array([0.45, 0.34, 0.26]) - color) * foot
    return np.clip(color, 0.0, 1.0).astype(np.float32)
