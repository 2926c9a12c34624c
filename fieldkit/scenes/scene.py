"""What a simulated scene is made of: triangle meshes and light. Values only, no I/O."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, Float32Array, FloatArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in the plot frame.

    The colour of a surface point is texture × vertex colour (each white where absent), lit by the scene's light
    where ``shading`` is given and drawn as it is where not.
    """

    name: str
    """Unique within a scene."""
    vertices: Float32Array
    """(n, 3) float32, metres."""
    faces: NDArray[np.int32]
    """(m, 3) int32 indices into ``vertices``."""
    normals: Float32Array | None = None
    """(n, 3) float32 unit vertex normals; needed for lit meshes."""
    uv: Float32Array | None = None
    """(n, 2) float32 texture coordinates, (0, 0) at the texture's lower left corner."""
    texture: ByteArray | None = None
    """(h, w, 3) uint8 sRGB, row 0 at the top."""
    colors: Float32Array | None = None
    """(n, 3) float32 in [0, 1], sRGB."""
    shading: Float32Array | None = None
    """(n, 4) float32 in [0, 1]: share of the sun's disc that is seen, share of the sky that is seen, share of sunlight
    on the far side that shines through, strength of the gloss."""
    plant: bool = False
    """Whether the mesh belongs to the reference (plants) or not (soil, stones, sky)."""
    two_sided: bool = True
    """Whether triangles are also drawn from behind, where their corners run clockwise."""
    flex_m: Float32Array | None = None
    """(n,) float32 distance along a leaf from where it is fixed, metres: how far wind can move a vertex; None where it
    is not known."""


@dataclass(frozen=True)
class Light:
    """Sun and sky. Radiances are linear and relative: white paper in full sun is about 1."""

    sun: tuple[float, float, float] = (0.45, -0.35, 0.8216)
    """Unit vector towards the sun, in the plot frame."""
    sun_color: tuple[float, float, float] = (1.00, 0.95, 0.86)
    """Linear RGB of direct sunlight on a surface that faces it."""
    sky_color: tuple[float, float, float] = (0.42, 0.46, 0.53)
    """Linear RGB of skylight from the zenith side."""
    ground_color: tuple[float, float, float] = (0.18, 0.15, 0.12)
    """Linear RGB of light that comes back from the ground."""


HAZE = Light(sun_color=(0.585, 0.572, 0.533), sky_color=(0.884, 0.936, 1.014))
"""A hazy day, as one chooses to photograph plants: the sun through thin cloud, its shadows softened by the sky."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Meshes under one light, in the plot frame (x east, y north, z up, metres, z = 0 on the ground)."""

    meshes: tuple[Mesh, ...]
    light: Light = field(default_factory=Light)
    background: tuple[float, float, float] = (0.78, 0.84, 0.90)

    @property
    def plants(self) -> Iterator[Mesh]:
        """The meshes that belong to the reference."""
        return (mesh for mesh in self.meshes if mesh.plant)

    @property
    def triangles(self) -> int:
        return sum(len(mesh.faces) for mesh in self.meshes)

    def bounds(self, *, plants_only: bool = False) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (3,) of the axis-aligned box about the meshes, metres."""
        chosen = [m for m in self.meshes if (m.plant or not plants_only) and len(m.vertices)]
        if not chosen:
            raise ValueError("the scene has no such mesh")
        lower = np.min([m.vertices.min(0) for m in chosen], axis=0)
        upper = np.max([m.vertices.max(0) for m in chosen], axis=0)
        return lower.astype(np.float64), upper.astype(np.float64)
