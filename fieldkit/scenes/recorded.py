"""A scene made of what was reconstructed: surfels of a reference's clouds, in the colours they were photographed in.

A surfel (Pfister et al. 2000) is a small square at a point, across its normal. Squares a little wider than the points
are apart close the surface. They are not lit again: the photographs' light is in their colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds import Cloud, read_cloud
from fieldkit.errors import CloudError, SceneError
from fieldkit.scenes.scene import Mesh, Scene

MAX_SURFELS = 5_000_000
_GROUND_REACH_M = 30.0
_BELOW_M = 0.004
"""The fitted ground lies this far below its surfels, which rise and fall by some millimetres."""


@dataclass(frozen=True)
class RecordedSurface:
    """Clouds of a reference and how they are drawn.

    Attributes:
        plants: PLY with colours and normals: the plants, plot frame.
        ground: PLY with colours and normals: everything else.
        plant_surfel_m: side of a plant's surfels.
        ground_surfel_m: side of the others'.
        ground_color: sRGB in [0, 1] of the plane z = 0 beyond and below them.
        background: sRGB in [0, 1] above the horizon.
    """

    plants: Path
    ground: Path
    plant_surfel_m: float
    ground_surfel_m: float
    ground_color: tuple[float, float, float] = (0.5, 0.45, 0.4)
    background: tuple[float, float, float] = (0.78, 0.84, 0.90)

    def __post_init__(self) -> None:
        for name in ("plant_surfel_m", "ground_surfel_m"):
            if not 1e-5 <= getattr(self, name) <= 0.1:
                raise ValueError(f"{name} is 0.00001 to 0.1, not {getattr(self, name)}")


def build_recorded(surface: RecordedSurface) -> Scene:
    """The scene: plants (the reference), everything else, and the ground's plane.

    Raises:
        SceneError: a cloud cannot be read, is empty, has no colours, or has more than `MAX_SURFELS` points.
    """
    plants = surfels("plants", _read(surface.plants), surface.plant_surfel_m, plant=True)
    rest = surfels("ground-surfels", _read(surface.ground), surface.ground_surfel_m)
    return Scene((plants, rest, _plane(surface.ground_color)), background=surface.background)


def recorded_plants(surface: RecordedSurface) -> Cloud:
    """The plants' points, which are the truth of such a scene.

    Raises:
        SceneError: as `build_recorded`.
    """
    return _read(surface.plants)


def surfels(name: str, cloud: Cloud, side_m: float, *, plant: bool = False) -> Mesh:
    """Squares of ``side_m`` across the points' normals (upwards where unknown), each turned by an angle of its own.

    They are seen from the side their normal points to only: a thin leaf has points of both its sides, in two colours
    and less apart than they are exact.
    """
    n = len(cloud)
    normals = np.zeros((n, 3)) if cloud.normals is None else cloud.normals.astype(np.float64)
    normals[np.linalg.norm(normals, axis=1) < 0.5] = (0.0, 0.0, 1.0)
    u, v = _tangents(normals)
    turn = np.arange(n) * (np.pi * (3.0 - np.sqrt(5.0)))  # spread, without a pattern and without a seed
    a = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
    b = np.cos(turn)[:, None] * v - np.sin(turn)[:, None] * u
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * side_m
    vertices = cloud.points[:, None] + corners[None, :, :1] * a[:, None] + corners[None, :, 1:] * b[:, None]
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    faces = (4 * np.arange(n, dtype=np.int32)[:, None, None] + quad).reshape(-1, 3)
    assert cloud.colors is not None
    colors = np.repeat(cloud.colors.astype(np.float32) / np.float32(255.0), 4, axis=0)
    return Mesh(
        name, vertices.reshape(-1, 3).astype(np.float32), faces, np.repeat(normals, 4, axis=0).astype(np.float32),
        colors=colors, plant=plant, two_sided=cloud.normals is None,
    )  # fmt: skip


def _tangents(normals: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two unit vectors (n, 3) across each normal (Duff et al. 2017)."""
    x, y, z = normals.T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1),
        np.stack([b, sign + y * y * a, -y], axis=1),
    )


def _plane(color: tuple[float, float, float]) -> Mesh:
    r = _GROUND_REACH_M
    corners = np.array([(-r, -r), (r, -r), (r, r), (-r, r)], np.float32)
    vertices = np.column_stack([corners, np.full(4, -_BELOW_M, np.float32)])
    colors = np.tile(np.asarray(color, np.float32), (4, 1))
    return Mesh("ground-plane", vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), colors=colors)


def _read(path: Path) -> Cloud:
    remedy = "Make the scene again with `fieldkit scene from-reference`."
    try:
        cloud = read_cloud(Path(path))
    except CloudError as error:
        raise SceneError(error.message, path=error.path or path, remedy=remedy) from error
    if not len(cloud) or cloud.colors is None:
        raise SceneError("has no coloured points to make surfels of", path=path, remedy=remedy)
    if len(cloud) > MAX_SURFELS:
        raise SceneError(
            f"has {len(cloud):,} points; up to {MAX_SURFELS:,} are drawn as surfels", path=path, remedy=remedy
        )
    return cloud
