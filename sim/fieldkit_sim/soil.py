"""Soil as real geometry: clods and crumbs that hide and shade themselves, stones and straw on top."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.plot_description import SCATTER_M, SoilDescription
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.bumps import bumps
from fieldkit_sim.faces import grid_faces, vertex_normals

_SHAPES = 24
"""Number of different clods and of different stones."""


def places(seed: int, count: int, purpose: int) -> tuple[np.random.Generator, FloatArray]:
    """A generator and (count, 2) places in the square ±`SCATTER_M`, drawn from it."""
    rng = np.random.default_rng([seed, purpose])
    return rng, rng.uniform(-SCATTER_M, SCATTER_M, (count, 2))


def printed_height(soil: SoilDescription, x: FloatArray, y: FloatArray) -> FloatArray:
    """Height of the ground in metres at ``x``, ``y`` (any equal shape); its mean is about 0.

    Lumps of four sizes (65 to 8 mm), each piled on a gently rolling base, as sieve curves of a seedbed have them.
    """
    height = 0.012 * fractal_noise(x / 0.45, y / 0.45, soil.seed, octaves=3).astype(np.float64)
    for i, (cell_m, share, density) in enumerate(
        ((0.065, 1.0, 0.30), (0.030, 0.45, 0.55), (0.015, 0.24, 0.75), (0.008, 0.10, 0.85))
    ):
        # Warped coordinates make the lumps angular instead of egg-shaped.
        wx = 0.35 * fractal_noise(x / cell_m * 1.7, y / cell_m * 1.7, soil.seed + 31 + i, octaves=2)
        wy = 0.35 * fractal_noise(x / cell_m * 1.7, y / cell_m * 1.7, soil.seed + 57 + i, octaves=2)
        lumps = bumps(x / cell_m + wx, y / cell_m + wy, soil.seed + 11 * i, density=density)
        height += share * soil.clod_height_m * lumps
    return height - 0.35 * soil.clod_height_m


def _axis(soil: SoilDescription) -> FloatArray:
    """Grid coordinates along one axis: even in the core, then ever wider to about 45 m."""
    n = round(soil.core_m / soil.spacing_m / 2)
    # 2.2 m in cells that grow by 1.8 % each, which a camera still sees well, then 24 by 20 %.
    near = int(np.ceil(np.log1p(2.2 * 0.018 / soil.spacing_m) / np.log(1.018)))
    growth = np.concatenate([np.full(near, 1.018), np.full(24, 1.2)])
    core = np.arange(n + 1) * soil.spacing_m
    half = np.concatenate([core, core[-1] + np.cumsum(soil.spacing_m * np.cumprod(growth))])
    return np.concatenate([-half[:0:-1], half])


def printed_ground(soil: SoilDescription) -> Mesh:
    """The height field to some 45 m from the origin with its texture."""
    axis = _axis(soil)
    n = len(axis)
    x, y = np.meshgrid(axis, axis)
    # Far out the cells are larger than the clods: flatten what they cannot show.
    spacing = np.gradient(axis)
    flatten = np.clip(0.06 / np.maximum(*np.meshgrid(spacing, spacing)), 0.0, 1.0)
    vertices = np.stack([x, y, flatten * printed_height(soil, x, y)], axis=-1).reshape(-1, 3).astype(np.float32)
    faces = grid_faces(n, n)
    step = np.linspace(0.0, 1.0, n, dtype=np.float32)
    u, v = np.meshgrid(step, step)
    return Mesh(
        "soil",
        vertices,
        faces,
        vertex_normals(vertices, faces),
        np.stack([u, v], -1).reshape(-1, 2),
        _soil_texture(soil, axis),
    )


def _soil_texture(soil: SoilDescription, axis: FloatArray) -> ByteArray:
    """Colour of the ground in the grid's own (stretched) coordinates, so that detail is fine where it is needed."""
    size = soil.texture_px
    place = np.interp((np.arange(size) + 0.5) / size, np.linspace(0, 1, len(axis)), axis)
    pitch = np.gradient(place)
    texture = np.empty((size, size, 3), np.uint8)
    for start in range(0, size, 256):  # in bands, to keep the memory small
        rows = slice(start, min(start + 256, size))
        x, y = np.meshgrid(place, place[::-1][rows])  # row 0 at the top: largest y
        # Far out texels are long and narrow; detail finer than their length would be drawn as streaks.
        coarse = np.maximum(*np.meshgrid(pitch, pitch[::-1][rows]))
        fine, medium = (np.clip(scale / (3.0 * coarse), 0.0, 1.0) ** 2 for scale in (0.010, 0.080))
        tone = 0.16 * medium * fractal_noise(x / 0.25, y / 0.25, soil.seed + 201, octaves=3)
        tone += 0.15 * fine * fractal_noise(x / 0.012, y / 0.012, soil.seed + 202, octaves=4, gain=0.7)
        grains = bumps(x / 0.0035, y / 0.0035, soil.seed + 203, density=0.8)
        tone += 0.23 * fine * (grains - 0.45)
        damp = np.clip(1.5 * fractal_noise(x / 0.12, y / 0.12, soil.seed + 204, octaves=3), 0.0, 0.6)
        tone = soil.contrast * (tone - 0.30 * medium * damp)
        warmth = 0.02 * fractal_noise(x / 0.02, y / 0.02, soil.seed + 205, octaves=3)
        color = np.stack([0.55 + warmth, 0.48 + 0 * warmth, 0.41 - warmth], axis=-1) * (1.0 + tone)[..., None]
        texture[rows] = np.clip(255.0 * color + 0.5, 0, 255).astype(np.uint8)
    return texture


def printed_stones(soil: SoilDescription) -> Mesh:
    """Stones and loose clods of 4 to 45 mm, half sunk into the ground, with overhangs a height field lacks."""
    import trimesh

    spheres = [trimesh.creation.icosphere(subdivisions=n) for n in (1, 2, 3)]
    rng, xy = places(soil.seed, soil.stones, 1)
    spots = np.column_stack([xy, printed_height(soil, xy[:, 0].copy(), xy[:, 1].copy())])
    vertices, faces, colors = [], [], []
    for place in spots:
        radius = float(np.clip(0.004 * np.exp(rng.exponential(0.75)), 0.004, 0.045)) / 2
        seed = int(rng.integers(1 << 30))
        sphere = spheres[0 if radius < 0.005 else 1 if radius < 0.014 else 2]
        base, base_faces = np.asarray(sphere.vertices), np.asarray(sphere.faces, dtype=np.int32)
        bumpiness = fractal_noise(base[:, 0] * 1.3 + base[:, 2], base[:, 1] * 1.3 - 0.7 * base[:, 2], seed, octaves=4)
        shape = base * (1.0 + 0.32 * bumpiness)[:, None] * rng.uniform((0.8, 0.6, 0.45), (1.3, 1.0, 0.9))
        spin = rotation_about_z(rng.uniform(0, 2 * np.pi))
        vertices.append(radius * shape @ spin.T + place + (0, 0, 0.25 * radius))
        faces.append(base_faces + sum(map(len, vertices[:-1])))
        grey = rng.uniform(0.42, 0.66) if rng.random() < 0.2 else rng.uniform(0.36, 0.50)
        tint = np.array([1.10, 0.98, 0.84]) if grey < 0.5 else np.array([1.02, 1.0, 0.94])
        speckle = 0.22 * fractal_noise(base[:, 0] * 4, base[:, 1] * 4 + 3 * base[:, 2], seed + 1, octaves=3)
        colors.append(np.clip(grey * tint * (1 + speckle)[:, None], 0, 1))
    return _pile("stones", vertices, faces, colors)


Height = Callable[[FloatArray, FloatArray], FloatArray]


def build_residue(soil: SoilDescription, height: Height) -> Mesh:
    """Straw: flat bent strips of 15 to 120 mm, leaning on the ground."""
    rng, spots = places(soil.seed, soil.residues, 2)
    along, across = 16, 3
    t = np.linspace(-0.5, 0.5, along)
    s = np.linspace(-0.5, 0.5, across)
    strip = grid_faces(along, across)
    vertices, faces, colors = [], [], []
    for i, place in enumerate(spots):
        length, width = rng.uniform(0.015, 0.12) * rng.uniform(0.4, 1.0), rng.uniform(0.0012, 0.005)
        heading, tilt, bend = rng.uniform(0, 2 * np.pi), rng.normal(0, 0.12), rng.normal(0, 0.5)
        direction = heading + bend * t
        step = length / along
        x, y = np.cumsum(np.cos(direction)) * step, np.cumsum(np.sin(direction)) * step
        x, y = x - x.mean(), y - y.mean()
        lift = np.tan(tilt) * length * t + rng.uniform(0, 0.15) * length * (2 * t) ** 2
        roll = rng.normal(0, 0.4)
        side = np.stack([-np.sin(direction) * np.cos(roll), np.cos(direction) * np.cos(roll), np.sin(roll) + 0 * t], -1)
        ground = height(place[0] + x, place[1] + y)
        # It rests on the highest lumps below it.
        z = np.maximum(lift + np.quantile(ground, 0.8), ground + 0.001)
        line = np.stack([place[0] + x, place[1] + y, z], -1)
        fold = 0.3 * width * (2 * s[None, :, None]) ** 2 * np.array([0.0, 0.0, 1.0])
        vertices.append((line[:, None] + width * s[None, :, None] * side[:, None] + fold).reshape(-1, 3))
        faces.append(strip + i * along * across)
        tone = rng.uniform(0.55, 0.85) * (1 + 0.18 * fractal_noise(t * 40 * length / 0.1, t * 0 + i, 9, octaves=3))
        color = tone[:, None] * np.array([1.0, 0.90, 0.68])
        colors.append(np.clip(np.repeat(color, across, axis=0), 0, 1))
    return _pile("residue", vertices, faces, colors)


@dataclass(frozen=True)
class _Relief:
    """Lumps of a kind of soil: (cell in metres, height as a share of the clods', share of cells occupied)."""

    lumps: tuple[tuple[float, float, float], ...]
    crumbs: float  # loose crumbs and clods, as shares of a tilled soil's
    clods: float
    crack_m: float = 0.0


_RELIEF = {
    "tilled": _Relief(((0.070, 1.0, 0.35), (0.033, 0.50, 0.60), (0.016, 0.30, 0.80), (0.009, 0.17, 0.90)), 1.0, 1.0),
    "crumb": _Relief(((0.030, 0.25, 0.50), (0.016, 0.30, 0.80), (0.009, 0.22, 0.95)), 1.5, 0.25),
    "crusted": _Relief(((0.060, 0.18, 0.40), (0.012, 0.05, 0.60)), 0.15, 0.10, crack_m=0.009),
}


def build_soil(soil: SoilDescription) -> list[Mesh]:
    """The ground to some 45 m from the origin, what lies loose on it and its residue; unlit meshes with normals."""
    residue = build_residue(soil, lambda x, y: soil_height(soil, x, y))
    if soil.kind == "printed":
        return [printed_ground(soil), printed_stones(soil), residue]
    return [*_ground(soil), *_loose(soil), residue]


def soil_height(soil: SoilDescription, x: FloatArray, y: FloatArray) -> FloatArray:
    """Height of the ground in metres at ``x``, ``y`` (any equal shape); its mean is about 0."""
    if soil.kind == "printed":
        return printed_height(soil, x, y)
    return grid_height(soil, x, y, np.zeros(np.shape(x)))


def grid_height(soil: SoilDescription, x: FloatArray, y: FloatArray, cell: FloatArray) -> FloatArray:
    """`soil_height` on a grid of spacing ``cell`` in metres, level where the grid cannot show the lumps."""
    relief = _RELIEF[soil.kind]
    grid = np.maximum(cell, 1e-6)
    roll = np.clip(0.45 / grid - 0.5, 0.0, 1.0)
    height = 0.012 * roll * fractal_noise(x / 0.45, y / 0.45, soil.seed, octaves=3).astype(np.float64)
    for i, (cell_m, share, density) in enumerate(relief.lumps):
        # Warped coordinates make the lumps angular instead of egg-shaped.
        wx = 0.35 * fractal_noise(x / cell_m * 1.7, y / cell_m * 1.7, soil.seed + 31 + i, octaves=2)
        wy = 0.35 * fractal_noise(x / cell_m * 1.7, y / cell_m * 1.7, soil.seed + 57 + i, octaves=2)
        lumps = bumps(x / cell_m + wx, y / cell_m + wy, soil.seed + 11 * i, density=density) - 0.27 * density
        height += share * soil.clod_height_m * np.clip(1.2 * cell_m / grid - 0.4, 0.0, 1.0) * lumps
    if relief.crack_m:
        net = np.abs(fractal_noise(x / 0.09, y / 0.09, soil.seed + 91, octaves=3))
        height -= relief.crack_m * np.clip(0.03 / grid - 0.5, 0.0, 1.0) * np.exp(-((net / 0.035) ** 2))
    return height


def _color(soil: SoilDescription, x: FloatArray, y: FloatArray, cell: FloatArray | float = 0.0) -> FloatArray:
    """(…, 3) sRGB of the ground: moist loam, dark and slightly patchy. All other contrast comes from relief.

    ``cell`` is the grid's spacing in metres: what it cannot show is left out.
    """
    medium = np.clip(0.04 / np.maximum(cell, 1e-6), 0.0, 1.0) ** 2
    tone = 0.10 * medium * fractal_noise(x / 0.25, y / 0.25, soil.seed + 201, octaves=3)
    tone += 0.05 * medium * fractal_noise(x / 0.012, y / 0.012, soil.seed + 202, octaves=2)
    damp = np.clip(1.5 * fractal_noise(x / 0.12, y / 0.12, soil.seed + 204, octaves=3), 0.0, 0.6)
    tone = 1.0 + soil.contrast * (tone - 0.25 * medium * damp)
    warmth = 0.012 * medium * fractal_noise(x / 0.05, y / 0.05, soil.seed + 205, octaves=3)
    rgb = np.stack([0.22 + warmth, 0.193 + 0 * warmth, 0.163 - warmth], axis=-1) * tone[..., None]
    return np.asarray(np.clip(rgb, 0.0, 1.0), dtype=np.float64)


def _ground(soil: SoilDescription) -> list[Mesh]:
    """The height field: a square grid in the core in tiles, and square rings about it that widen to 45 m."""
    n = max(2, round(soil.core_m / soil.spacing_m))
    axis = (np.arange(n + 1) / n - 0.5) * soil.core_m
    tiles = 4
    cuts = [round(i * n / tiles) for i in range(tiles + 1)]
    meshes = []
    for i in range(tiles):
        for j in range(tiles):
            x, y = np.meshgrid(axis[cuts[j] : cuts[j + 1] + 1], axis[cuts[i] : cuts[i + 1] + 1])
            meshes.append(_sheet(f"soil-{i}-{j}", soil, x, y, np.zeros(x.shape)))
    # The rings, a side at a time: from the core's edge outwards the cells keep their angle and so grow with distance.
    growth = 1.0 + 4.0 / n
    near = int(np.ceil(np.log(max(3.0 / (soil.core_m / 2), 1.1)) / np.log(growth)))
    radii = np.concatenate([np.full(near, growth), np.full(16, 1.2)]).cumprod()
    scale = np.concatenate([[1.0], radii])[:, None]
    cell = scale * soil.spacing_m * 2.0
    for side in range(4):
        turn = np.array([[0, 1], [-1, 0]]) if side % 2 else np.eye(2)
        sign = 1.0 if side < 2 else -1.0
        edge = np.stack([axis, np.full(n + 1, soil.core_m / 2)], axis=-1) * sign @ turn
        half = (n + 1) // 2
        for part, columns in enumerate((slice(0, half + 1), slice(half, n + 1))):
            for band, (start, end) in enumerate(
                pairwise([0, *np.searchsorted(scale[:, 0], (1.8, 5.0)), len(scale) - 1])
            ):
                rows = slice(int(start), int(end) + 1)
                ring = scale[rows, :, None] * edge[None, columns]
                width = np.broadcast_to(cell[rows], ring.shape[:2])
                meshes.append(_sheet(f"soil-{'nesw'[side]}{part}{band}", soil, ring[..., 0], ring[..., 1], width))
    return meshes


def _sheet(name: str, soil: SoilDescription, x: FloatArray, y: FloatArray, cell: FloatArray) -> Mesh:
    rows, columns = x.shape
    vertices = np.stack([x, y, grid_height(soil, x, y, cell)], axis=-1).reshape(-1, 3).astype(np.float32)
    faces = grid_faces(rows, columns)
    normals = vertex_normals(vertices, faces)
    normals[normals[:, 2] < 0] *= -1.0
    return Mesh(name, vertices, faces, normals, colors=_color(soil, x, y, cell).reshape(-1, 3).astype(np.float32))


def _loose(soil: SoilDescription) -> list[Mesh]:
    relief = _RELIEF[soil.kind]
    stones = soil.stones / (2 * SCATTER_M) ** 2
    size = min(1.0, 0.005 / soil.spacing_m)  # a coarse soil, as tests use it, has fewer crumbs as well
    near, far = soil.core_m / 2 + 0.15, soil.core_m / 2 + 1.0
    classes = (
        _Crumbs("crumbs", 0.0, near, 4500 * relief.crumbs * size, 0.0050, 0.014, 0),
        _Crumbs("crumbs-around", near, far, 700 * relief.crumbs * size, 0.010, 0.022, 0),
        _Crumbs("clods", 0.0, near, 260 * relief.clods * size, 0.014, 0.050, 1),
        _Crumbs("clods-around", near, far, 140 * relief.clods * size, 0.020, 0.060, 1),
        _Crumbs("clods-far", far, far + 2.0, 18 * relief.clods * size, 0.035, 0.080, 0),
        _Crumbs("stones", 0.0, SCATTER_M, stones, 0.005, 0.045, 1, stone=1.0),
    )
    meshes = []
    for i, crumbs in enumerate(classes):
        seed = 10 * (soil.seed + 1) + i
        xy, sizes = _scatter_crumbs(crumbs, seed)
        x, y = xy[:, 0].copy(), xy[:, 1].copy()
        mesh = _build_crumbs(crumbs, xy, sizes, soil_height(soil, x, y), _color(soil, x, y), seed)
        meshes += _quarters(mesh)
    return meshes


def _quarters(mesh: Mesh) -> list[Mesh]:
    """The mesh in four by quadrant, so that a renderer can leave out what a camera does not see."""
    middle = mesh.vertices[mesh.faces[:, 0]] if len(mesh.faces) else np.zeros((0, 3))
    quadrant = (middle[:, 0] > 0) * 1 + (middle[:, 1] > 0) * 2
    parts = []
    for q in range(4):
        used, inverse = np.unique(mesh.faces[quadrant == q], return_inverse=True)
        if len(used):
            parts.append(
                replace(
                    mesh,
                    name=f"{mesh.name}-{q}",
                    vertices=mesh.vertices[used],
                    faces=inverse.reshape(-1, 3).astype(np.int32),
                    normals=None if mesh.normals is None else mesh.normals[used],
                    colors=None if mesh.colors is None else mesh.colors[used],
                )
            )
    return parts


# Loose crumbs, clods and stones, whose overhangs a height field lacks. Sizes follow a power law, as the aggregates of a
# seedbed do: many small ones near the plot, larger ones everywhere.


@dataclass(frozen=True)
class _Crumbs:
    """A class of bodies."""

    name: str
    """Of their mesh."""
    inner_m: float
    outer_m: float
    """They lie between the squares of these half sides about the origin."""
    per_m2: float
    """How many."""
    smallest_m: float
    largest_m: float
    """Diameters, distributed as diameter to the power −2.5."""
    detail: int
    """Subdivisions of the icosahedron each is made from."""
    stone: float = 0.0
    """Share of stones among them: rounder, greyer, more varied than clods."""


def _scatter_crumbs(crumbs: _Crumbs, seed: int) -> tuple[FloatArray, FloatArray]:
    """Places (n, 2) and diameters (n,) of a class of bodies."""
    rng = np.random.default_rng([seed, 41])
    area = 4.0 * crumbs.outer_m**2
    xy = rng.uniform(-crumbs.outer_m, crumbs.outer_m, (round(crumbs.per_m2 * area), 2))
    u = rng.random(len(xy))
    low, high = crumbs.smallest_m**-1.5, crumbs.largest_m**-1.5
    size = (low + u * (high - low)) ** (-1 / 1.5)
    keep = np.abs(xy).max(axis=1) >= crumbs.inner_m
    return xy[keep], size[keep]


def _build_crumbs(
    crumbs: _Crumbs,
    places: FloatArray,
    sizes: FloatArray,
    ground: FloatArray,
    color: FloatArray,
    seed: int,
) -> Mesh:
    """All bodies of a class as one mesh.

    Args:
        places: (n, 2), metres.
        sizes: (n,) diameters, metres.
        ground: (n,) height of the ground under each.
        color: (n, 3) of the ground there, sRGB in [0, 1].
        seed: of form and tone.
    """
    n = len(places)
    rng = np.random.default_rng([seed, 43])
    clods = [_shape(seed * 100 + i, crumbs.detail, 0.38) for i in range(_SHAPES)]
    stones = [_shape(seed * 100 + 50 + i, crumbs.detail, 0.16) for i in range(_SHAPES)]
    is_stone = rng.random(n) < crumbs.stone
    which = rng.integers(_SHAPES, size=n)
    turn, sink = rng.uniform(0, 2 * np.pi, n), rng.uniform(-0.05, 0.55, n)
    stretch = rng.uniform((0.8, 0.65, 0.55), (1.25, 1.0, 0.95), (n, 3))
    tone = np.clip(rng.normal(1.0, 0.04, n), 0.75, 1.3)
    grey = np.where(rng.random(n) < 0.3, rng.uniform(0.26, 0.40, n), rng.uniform(0.18, 0.27, n))
    vertices, faces, colors, start = [], [], [], 0
    for stone, shapes in ((False, clods), (True, stones)):
        for i, (points, triangles) in enumerate(shapes):
            chosen = np.flatnonzero((which == i) & (is_stone == stone))
            if not len(chosen):
                continue
            radius = sizes[chosen] / 2
            body = points[None] * stretch[chosen, None] * radius[:, None, None]
            c, s = np.cos(turn[chosen])[:, None], np.sin(turn[chosen])[:, None]
            x, y = c * body[..., 0] - s * body[..., 1], s * body[..., 0] + c * body[..., 1]
            base = ground[chosen] + radius * sink[chosen]
            placed = np.stack(
                [x + places[chosen, 0, None], y + places[chosen, 1, None], body[..., 2] + base[:, None]], axis=-1
            )
            own = color[chosen] * tone[chosen, None]
            if stone:
                own = grey[chosen, None] * np.array([1.03, 1.0, 0.95])
            speckle = 1.0 + rng.normal(0, 0.02, placed.shape[:2])
            vertices.append(placed.reshape(-1, 3))
            colors.append(np.clip(own[:, None] * speckle[..., None], 0, 1).reshape(-1, 3))
            offset = start + len(points) * np.arange(len(chosen))
            faces.append((triangles[None] + offset[:, None, None]).reshape(-1, 3))
            start += len(points) * len(chosen)
    # Seen from outside only, for what lies in the ground is open.
    return _pile(crumbs.name, vertices, faces, colors, two_sided=False)


def _pile(
    name: str,
    vertices: Sequence[FloatArray],
    faces: Sequence[NDArray[np.integer]],
    colors: Sequence[FloatArray],
    *,
    two_sided: bool = True,
) -> Mesh:
    """One mesh of many bodies whose faces already count their vertices in order."""
    points = np.concatenate([np.zeros((0, 3)), *vertices]).astype(np.float32)
    triangles = np.concatenate([np.zeros((0, 3), np.int32), *faces]).astype(np.int32)
    tones = np.concatenate([np.zeros((0, 3)), *colors]).astype(np.float32)
    return Mesh(name, points, triangles, vertex_normals(points, triangles), colors=tones, two_sided=two_sided)


def _shape(seed: int, detail: int, roughness: float) -> tuple[FloatArray, NDArray[np.int32]]:
    """An irregular body of radius about 1, turned at random, without the faces that would lie in the ground."""
    import trimesh

    rng = np.random.default_rng([seed, 44])
    ball = trimesh.creation.icosphere(subdivisions=detail)
    points = np.asarray(ball.vertices, dtype=np.float64)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = points @ (q * np.sign(np.linalg.det(q))).T
    bumps = fractal_noise(
        1.4 * points[:, 0] + 0.6 * points[:, 2], 1.4 * points[:, 1] - 0.7 * points[:, 2], seed, octaves=3, gain=0.6
    )
    points = points * (1.0 + roughness * (bumps + rng.normal(0, 0.35, len(points))))[:, None]
    faces = np.asarray(ball.faces, dtype=np.int32)
    faces = faces[points[faces, 2].max(axis=1) > -0.30]
    used, inverse = np.unique(faces, return_inverse=True)
    return points[used], inverse.reshape(faces.shape).astype(np.int32)
