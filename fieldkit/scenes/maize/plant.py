"""A maize plant's mesh from its description."""

from __future__ import annotations

from fieldkit.scenes.maize.compact import build_compact_maize
from fieldkit.scenes.maize.description import MaizeDescription
from fieldkit.scenes.scene import Mesh


def build_maize(plant: MaizeDescription, ground_m: float = 0.0) -> Mesh:
    """The plant as one textured mesh with normals, unlit, standing at height ``ground_m``."""
    return build_compact_maize(plant, 9 if plant.leaves is None else plant.leaves, ground_m)
