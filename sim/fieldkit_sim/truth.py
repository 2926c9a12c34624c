"""Traits of a simulated plot's own plants, from their meshes: the truth for reconstructed plants."""

# mypy: disable-error-code="no-untyped-def"
# (Numba infers the kernel's types.)

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.clouds.volume import Volume
from fieldkit.runtime.kernels import kernel
from fieldkit.scenes.scene import Mesh

PIXEL_M = 0.001
"""Edge of a height map's pixels, metres: a fiftieth of a leaf's width."""


@dataclass(frozen=True)
class TrueTraits:
    """Traits of a scene's plants within the footprint of its volume of interest, from their meshes."""

    height_m: float
    """Of the highest vertex above the soil's median height."""
    covered_area_m2: float
    """Below plants."""
    canopy_volume_m3: float
    """Between the soil's median height and the plants' upper surface."""
    plot_area_m2: float
    """Of the footprint."""

    @property
    def cover_percent(self) -> float:
        """Of the footprint."""
        return 100.0 * self.covered_area_m2 / self.plot_area_m2


def true_traits(meshes: Sequence[Mesh], volume: Volume) -> TrueTraits:
    """The true traits of a scene's own plants."""
    plants = height_map([mesh for mesh in meshes if mesh.plant], volume)
    soil = float(np.nanmedian(height_map([mesh for mesh in meshes if mesh.name.startswith("soil")], volume)))
    vertices = np.concatenate([mesh.vertices for mesh in meshes if mesh.plant]).astype(np.float64)
    inside = ((vertices[:, :2] >= volume.lower[:2]) & (vertices[:, :2] <= volume.upper[:2])).all(axis=1)
    return TrueTraits(
        height_m=float(vertices[inside, 2].max()) - soil,
        covered_area_m2=float(np.isfinite(plants).sum()) * PIXEL_M**2,
        canopy_volume_m3=float(np.nansum(plants - soil)) * PIXEL_M**2,
        plot_area_m2=float(volume.size[0] * volume.size[1]),
    )


def height_map(meshes: Any, volume: Volume, pixel_m: float = PIXEL_M) -> FloatArray:
    """Greatest z of meshes at the middle of each pixel of a volume's footprint; NaN where there is none.

    Row 0 is the lowest y. Nothing is widened: a pixel counts where a triangle covers its middle.
    """
    low = np.array(volume.lower[:2])
    columns, rows = np.ceil((np.array(volume.upper[:2]) - low) / pixel_m).astype(int)
    found = np.full((rows, columns), -np.inf)
    for mesh in meshes:
        triangles = mesh.vertices[mesh.faces].astype(np.float64)
        triangles[:, :, :2] = (triangles[:, :, :2] - low) / pixel_m - 0.5
        _draw(triangles, found)
    return np.where(np.isfinite(found), found, np.nan)


@kernel
def _draw(triangles, found):
    rows, columns = found.shape
    for k in range(triangles.shape[0]):
        a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if area == 0.0:
            continue
        left = max(0, int(np.ceil(min(a[0], b[0], c[0]))))
        right = min(columns - 1, int(np.floor(max(a[0], b[0], c[0]))))
        low = max(0, int(np.ceil(min(a[1], b[1], c[1]))))
        high = min(rows - 1, int(np.floor(max(a[1], b[1], c[1]))))
        for row in range(low, high + 1):
            for column in range(left, right + 1):
                u = ((column - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (row - a[1])) / area
                v = ((b[0] - a[0]) * (row - a[1]) - (column - a[0]) * (b[1] - a[1])) / area
                if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
                    z = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2])
                    if z > found[row, column]:
                        found[row, column] = z
