"""A scene made of what was reconstructed: surfels of a reference's clouds, in the colours they were photographed in.

A surfel (Pfister et al. 2000) is a small square at a point, across its normal. Squares a little wider than the points
are apart close the surface. They are not lit again: the photographs' light is in their colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from fieldkit.arrays import ByteArray, Float32Array, FloatArray
from fieldkit.clouds import Cloud, read_cloud
from fieldkit.errors import CloudError, SceneError
from fieldkit.scenes.scene import Mesh, Scene

_REMEDY = "Make the scene again with `fieldkit scene from-reference`."
_GROUND_REACH_M = 30.0
"""Half the side of the fitted ground, metres."""
_BELOW_M = 0.004
"""The fitted ground lies this far below its surfels, which rise and fall by some millimetres."""


@dataclass(frozen=True)
class RecordedSurface:
    """Clouds of a reference and how they are drawn."""

    plants: Path
    """PLY with colours and normals: the plants, plot frame."""
    ground: Path
    """PLY with colours and normals: everything else."""
    plant_surfel_m: Annotated[float, Field(ge=1e-5, le=0.1)]
    """Side of a plant's surfels."""
    ground_surfel_m: Annotated[float, Field(ge=1e-5, le=0.1)]
    """Side of the others'."""
    plant_atlas: Path | None = None
    """Picture with ``texels`` × ``texels`` pixels for each of the plants' surfels, in the points' order, in rows of
    equal length; without it a surfel has its point's one colour."""
    ground_atlas: Path | None = None
    """The same of the others'."""
    texels: Annotated[int, Field(ge=2, le=32)] = 4
    """Along a surfel's side."""
    ground_color: tuple[float, float, float] = (0.5, 0.45, 0.4)
    """SRGB in [0, 1] of the plane z = 0 beyond and below them."""
    background: tuple[float, float, float] = (0.78, 0.84, 0.90)
    """SRGB in [0, 1] above the horizon."""

    @property
    def files(self) -> dict[str, Path]:
        """The files it names, by key."""
        keys = ("plants", "ground", "plant_atlas", "ground_atlas")
        return {key: Path(getattr(self, key)) for key in keys if getattr(self, key) is not None}


def build_recorded(surface: RecordedSurface) -> Scene:
    """The scene: plants (the reference), everything else, and the ground's plane."""
    parts = []
    for name, cloud_file, atlas_file, side_m in (
        ("plants", surface.plants, surface.plant_atlas, surface.plant_surfel_m),
        ("ground-surfels", surface.ground, surface.ground_atlas, surface.ground_surfel_m),
    ):
        cloud = _read(cloud_file)
        atlas = None if atlas_file is None else read_atlas(atlas_file, len(cloud), surface.texels)
        parts.append(surfels(name, cloud, side_m, plant=name == "plants", atlas=atlas, texels=surface.texels))
    plants, rest = parts
    return Scene((plants, rest, _plane(surface.ground_color)), background=surface.background)


def recorded_plants(surface: RecordedSurface) -> Cloud:
    """The plants' points, which are the truth of such a scene."""
    return _read(surface.plants)


def surfels(
    name: str,
    cloud: Cloud,
    side_m: float,
    *,
    plant: bool = False,
    atlas: ByteArray | None = None,
    texels: int = 4,
) -> Mesh:
    """Squares of ``side_m`` across the points' normals (upwards where unknown), each turned by an angle of its own.

    They are seen from the side their normal points to only: a thin leaf has points of both its sides, in two colours
    and less apart than they are exact.
    """
    n = len(cloud)
    normals, a, b = surfel_axes(cloud)
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    vertices = cloud.points[:, None] + side_m * (corners[None, :, :1] * a[:, None] + corners[None, :, 1:] * b[:, None])
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    faces = (4 * np.arange(n, dtype=np.int32)[:, None, None] + quad).reshape(-1, 3)
    uv = colors = None
    if atlas is not None:
        uv = _atlas_uv(n, texels, atlas.shape, corners)
    else:
        assert cloud.colors is not None
        colors = np.repeat(cloud.colors.astype(np.float32) / np.float32(255.0), 4, axis=0)
    return Mesh(
        name,
        vertices.reshape(-1, 3).astype(np.float32),
        faces,
        np.repeat(normals, 4, axis=0).astype(np.float32),
        uv=uv,
        texture=atlas,
        colors=colors,
        plant=plant,
        two_sided=cloud.normals is None,
    )


def surfel_axes(cloud: Cloud) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normals and the directions of two sides of the surfels, each (n, 3)."""
    n = len(cloud)
    normals = np.zeros((n, 3)) if cloud.normals is None else cloud.normals.astype(np.float64)
    normals[np.linalg.norm(normals, axis=1) < 0.5] = (0.0, 0.0, 1.0)
    u, v = _tangents(normals)
    turn = surfel_turns(n)
    a = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
    b = np.cos(turn)[:, None] * v - np.sin(turn)[:, None] * u
    return normals, a, b


def surfel_turns(count: int) -> FloatArray:
    """(count,) radians: how each surfel is turned in its plane, by its place in the cloud.

    Multiples of the golden angle: spread evenly, without a pattern and without a seed.
    """
    return np.asarray(np.arange(count) * (np.pi * (3.0 - np.sqrt(5.0))))


def pack_atlas(patches: ByteArray) -> ByteArray:
    """The atlas (rows · k, columns · k, 3) of patches (n, k, k, 3), as square as it gets."""
    n, k = patches.shape[:2]
    columns = _columns(n)
    rows = -(-n // columns)
    cells = np.zeros((rows * columns, k, k, 3), np.uint8)
    cells[:n] = patches
    return np.ascontiguousarray(cells.reshape(rows, columns, k, k, 3).swapaxes(1, 2).reshape(rows * k, columns * k, 3))


def read_atlas(path: Path, count: int, texels: int) -> ByteArray:
    """The atlas of ``count`` patches of ``texels`` × ``texels`` pixels in a file."""
    from PIL import Image

    columns = _columns(count)
    width, height = columns * texels, -(-count // columns) * texels
    try:
        with Image.open(path) as image:
            if image.size != (width, height):
                raise SceneError(f"is {image.size}, not {(width, height)} pixels", path=path, remedy=_REMEDY)
            return np.asarray(image.convert("RGB"), np.uint8)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise SceneError(f"cannot be read as a picture ({error})", path=path, remedy=_REMEDY) from error


def _columns(count: int) -> int:
    return int(np.ceil(np.sqrt(count)))


def _atlas_uv(count: int, texels: int, shape: tuple[int, ...], corners: FloatArray) -> Float32Array:
    """(4 · count, 2): the corners of a surfel lie on the middles of its patch's outermost texels."""
    columns, i = _columns(count), np.arange(count)
    inside = (corners + 0.5) * (texels - 1) + 0.5
    x = (i % columns)[:, None] * texels + inside[None, :, 0]
    y = (i // columns)[:, None] * texels + inside[None, :, 1]
    return np.stack([x / shape[1], 1.0 - y / shape[0]], axis=-1).reshape(-1, 2).astype(np.float32)


def _tangents(normals: FloatArray) -> tuple[FloatArray, FloatArray]:
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
    try:
        cloud = read_cloud(Path(path))
    except CloudError as error:
        raise SceneError(error.message, path=error.path or path, remedy=_REMEDY) from error
    if not len(cloud) or cloud.colors is None:
        raise SceneError("has no coloured points to make surfels of", path=path, remedy=_REMEDY)
    return cloud
