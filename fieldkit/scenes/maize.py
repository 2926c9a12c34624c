"""Procedural maize plants: stem, sheaths, arching and twisting blades, each leaf with its own texture.

The forms follow published descriptions, the constants are ours, chosen by eye for vegetative plants of 0.4–0.9 m:
leaf size along the stem is the skewed bell of Dwyer and Stewart (1986), the midrib an arc whose inclination falls
along the blade as in Prévot, Aries and Monestiez (1991), leaves stand in two ranks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.scene import Mesh, vertex_normals

Array = NDArray[np.float64]

_STRIP = 96  # texture rows per leaf
_STEM_STRIP = 160
_TEXTURE_WIDTH = 2048


@dataclass(frozen=True)
class MaizeDescription:
    """One plant.

    Attributes:
        seed: of its individual form and colour.
        x_m, y_m: where it stands, plot frame.
        yaw_deg: direction of the plane its leaves stand in, clockwise from north.
        scale: of all lengths.
        leaves: number of leaves with a blade, 5 to 12.
        kind: tells plants of different kinds apart in scene files.
    """

    seed: int
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_deg: float = 0.0
    scale: float = 1.0
    leaves: int = 9
    kind: Literal["maize"] = "maize"

    def __post_init__(self) -> None:
        if not 5 <= self.leaves <= 12:
            raise ValueError(f"a maize plant here has 5 to 12 leaves, not {self.leaves}")


@dataclass(frozen=True)
class _Leaf:
    """Form of one blade, metres and radians before scaling."""

    rank: float  # 0 the lowest, 1 the highest
    age: float  # 0 fresh, 1 dying
    collar: Array  # (3,)
    azimuth: float
    length: float
    width: float
    elevation: float  # of the midrib at the collar
    droop: float  # by how much the elevation falls to the tip
    bend: float  # where it falls: small early, large late
    sweep: float  # sideways turn of the midrib to the tip
    twist: float
    fold: float  # of the two halves at the collar
    ruffle: float
    seed: int


def build_maize(plant: MaizeDescription, ground_m: float = 0.0) -> Mesh:
    """The plant as one textured mesh with normals, unlit, standing at height ``ground_m``."""
    rng = np.random.default_rng([plant.seed, 77])
    stem_points, stem_radii, leaves = _architecture(plant, rng)
    rows = _STRIP * len(leaves) + _STEM_STRIP
    parts = [_stem(stem_points, stem_radii, rows)]
    parts += [_blade(leaf, _STEM_STRIP + i * _STRIP, rows) for i, leaf in enumerate(leaves)]
    vertices = np.concatenate([part[0] for part in parts])
    offsets = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    faces = np.concatenate([part[1] + offset for part, offset in zip(parts, offsets, strict=True)]).astype(np.int32)
    uv = np.concatenate([part[2] for part in parts]).astype(np.float32)
    turn = np.radians(-plant.yaw_deg)
    spin = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    placed = (plant.scale * vertices @ spin.T + (plant.x_m, plant.y_m, ground_m)).astype(np.float32)
    strips = [_stem_texture(plant.seed, stem_points)] + [_blade_texture(leaf) for leaf in leaves]
    texture = np.concatenate(strips[::-1])  # texture row 0 is at the top, uv's v = 0 at the bottom
    return Mesh(f"maize-{plant.seed}", placed, faces, vertex_normals(placed, faces), uv, texture, plant=True)


def _architecture(plant: MaizeDescription, rng: np.random.Generator) -> tuple[Array, Array, list[_Leaf]]:
    """Centre line (n, 3) and radii (n,) of the stem with its sheaths, and the leaves, lowest first."""
    n = plant.leaves
    vigour = rng.uniform(0.88, 1.12)
    height = vigour * 0.050 * n**0.97
    lean = rng.normal(0, 0.05, 2)
    heights = np.sort(height * (np.arange(1, n + 1) / n) ** 1.25 * rng.uniform(0.95, 1.05, n))
    z = np.linspace(-0.03, heights[-1] + 0.03, 70)
    t = np.clip(z / heights[-1], 0, 1.2)
    line = np.column_stack([lean[0] * z * t, lean[1] * z * t, z])
    radii = vigour * (0.0125 - 0.0065 * np.clip(t, 0, 1) ** 1.3)
    for collar in heights:  # a sheath widens to its collar and ends there
        radii += vigour * 0.0016 * np.exp(-((np.maximum(collar - z, 0) / 0.02) ** 2)) * (z <= collar)
    radii *= np.clip((z[-1] - z) / 0.02, 0.15, 1.0)
    leaves = []
    largest = 0.68
    for k in range(n):
        x = (k + 1) / n / largest
        size = np.exp(-4.2 * (x - 1) ** 2 + 1.0 * (x - 1) ** 3)
        whorl = float(np.clip((k - (n - 3.5)) / 3.0, 0.0, 1.0))  # the top leaves still stand upright
        age = float(np.clip(1.15 - 3.2 * k / n + rng.normal(0, 0.08), 0, 1))
        collar = np.array([np.interp(heights[k], z, line[:, i]) for i in range(3)])
        leaves.append(
            _Leaf(
                rank=k / (n - 1), age=age, collar=collar,
                azimuth=np.pi * (k % 2) + rng.normal(0, np.radians(16)),
                length=vigour * (0.20 + 0.56 * size) * rng.uniform(0.92, 1.08) * (0.082 * n + 0.25),
                width=vigour * (0.022 + 0.050 * size) * rng.uniform(0.92, 1.08),
                elevation=np.radians(rng.normal(52, 6) + 26 * whorl),
                droop=np.radians(rng.normal(105, 22) * (1 - 0.75 * whorl) + 18 * age),
                bend=float(rng.uniform(1.0, 1.9)), sweep=rng.normal(0, 0.22), twist=rng.normal(0, 0.55),
                fold=np.radians(rng.uniform(18, 34) + 26 * whorl),
                ruffle=float(rng.uniform(0.4, 1.2) * (1 - 0.6 * whorl)),
                seed=int(rng.integers(1 << 30)),
            )
        )  # fmt: skip
    return line, radii, leaves


def _grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])


def _stem(line: Array, radii: Array, rows: int) -> tuple[Array, NDArray[np.int32], Array]:
    sides = 25  # the last repeats the first, for the texture's seam
    angle = np.linspace(0, 2 * np.pi, sides)
    ring = np.column_stack([1.12 * np.cos(angle), 0.90 * np.sin(angle), 0 * angle])  # a maize stem is oval
    vertices = line[:, None] + radii[:, None, None] * ring[None]
    v = (0.5 + (_STEM_STRIP - 1) * np.linspace(0, 1, sides)) / rows
    u = (line[:, 2] - line[0, 2]) / 1.2  # the same scale on every plant: 1.2 m to the texture's width
    uv = np.stack(np.broadcast_arrays(u[:, None], v[None]), axis=-1)
    return vertices.reshape(-1, 3), _grid_faces(len(line), sides), uv.reshape(-1, 2)


def _blade(leaf: _Leaf, first_row: int, rows: int) -> tuple[Array, NDArray[np.int32], Array]:
    """A blade as a grid: 96 sections along, 17 points across, closer together at the midrib."""
    along, across = 96, 17
    t = np.linspace(0, 1, along)
    q = np.linspace(-1, 1, across)
    q = np.sign(q) * np.abs(q) ** 1.25
    # Midrib: its inclination falls from the collar to the tip.
    elevation = leaf.elevation - leaf.droop * t**leaf.bend
    elevation += 0.10 * fractal_noise(3 * t, 0 * t + 0.5, leaf.seed, octaves=2)
    elevation = np.maximum(elevation, np.radians(-82))
    azimuth = leaf.azimuth + leaf.sweep * t**1.5 + 0.08 * fractal_noise(3 * t, 0 * t + 7.5, leaf.seed, octaves=2)
    tangent = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    )
    spine = np.cumsum(tangent, axis=0) * leaf.length / along
    spine += leaf.collar + 0.004 * np.array([np.cos(leaf.azimuth), np.sin(leaf.azimuth), 0]) - spine[0]
    side = np.stack([-np.sin(azimuth), np.cos(azimuth), 0 * t], axis=-1)
    up = np.cross(tangent, side)
    turn = leaf.twist * t**1.6
    side, up = (
        np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up,
        np.cos(turn)[:, None] * up - np.sin(turn)[:, None] * side,
    )
    profile = (0.50 + 0.50 * np.clip(t / 0.30, 0, 1) ** 0.8) * np.clip(1 - t**2.4, 0, 1) ** 0.85
    half = 0.5 * leaf.width * np.maximum(profile, 0.012)
    # Cross-section: a V that opens towards the tip, wrapped about the stem at the collar.
    fold = leaf.fold * (0.25 + 0.75 * (1 - t) ** 1.5)
    wrap = np.radians(62) * np.exp(-t * leaf.length / 0.025)
    angle = (fold + wrap)[:, None] * np.minimum(1.0, np.abs(q) * 2.2 + 0.15)[None]
    lateral = half[:, None] * q[None] * np.cos(angle)
    lift = half[:, None] * np.abs(q)[None] * np.sin(angle)
    s = t * leaf.length
    wave = 5.0 * s  # about five waves per metre, of uneven length
    for sign in (-1, 1):
        margin = fractal_noise(wave * 1.6, 0 * t + 3.1 * sign, leaf.seed + 5, octaves=3)
        margin *= np.sin(np.pi * np.clip(t * 1.1, 0, 1)).astype(np.float32)
        lift += leaf.ruffle * 0.020 * margin[:, None] * np.clip(sign * q, 0, 1)[None] ** 1.6
    channel = 0.0022 * (1 - t) * np.clip(half / 0.02, 0, 1)
    lift -= channel[:, None] * np.exp(-((half[:, None] * q[None] / 0.0025) ** 2))
    crinkle = fractal_noise(s[:, None] / 0.03, (half[:, None] * q[None]) / 0.02, leaf.seed + 9, octaves=2)
    lift += 0.0010 * crinkle * np.clip(half / 0.01, 0, 1)[:, None]
    vertices = spine[:, None] + lateral[..., None] * side[:, None] + lift[..., None] * up[:, None]
    v = (first_row + 1.5 + (_STRIP - 3) * (0.5 + 0.5 * q)) / rows
    u = (0.5 + (_TEXTURE_WIDTH - 1) * t) / _TEXTURE_WIDTH
    uv = np.stack(np.broadcast_arrays(u[:, None], v[None]), axis=-1)
    return vertices.reshape(-1, 3), _grid_faces(along, across), uv.reshape(-1, 2)


def _blade_texture(leaf: _Leaf) -> NDArray[np.uint8]:
    """(_STRIP, _TEXTURE_WIDTH, 3): along the blade to the right, row 0 its left margin."""
    t = ((np.arange(_TEXTURE_WIDTH) + 0.5) / _TEXTURE_WIDTH)[None, :]
    q = 1 - 2 * ((np.arange(_STRIP) + 0.5) / _STRIP)[:, None]
    s = t * leaf.length + 0 * q  # metres
    w = q * 0.5 * leaf.width + 0 * t  # metres at the widest place
    seed = leaf.seed
    blotch = fractal_noise(s / 0.06, w / 0.03, seed + 1, octaves=4)
    # Parallel veins: noise drawn out along the blade.
    veins = fractal_noise(s / 0.20, w / 0.0028, seed + 2, octaves=2)
    veins += 0.7 * fractal_noise(s / 0.07, w / 0.0012, seed + 3, octaves=2)
    grain = fractal_noise(s / 0.0030, w / 0.0016, seed + 4, octaves=3, gain=0.7)
    bands = fractal_noise(s / 0.05, 0 * w + 2.2, seed + 6, octaves=2) * (1 - leaf.rank * 0.4)
    green = np.array([0.40, 0.55, 0.25]) * (1 - leaf.age) + np.array([0.50, 0.56, 0.24]) * leaf.age
    tone = 1 + 0.15 * blotch + 0.24 * veins + 0.30 * grain + 0.10 * bands
    color = green * tone[..., None]
    color += 0.05 * np.clip(blotch, 0, 1)[..., None] * np.array([1.0, 0.8, -0.2])
    # Midrib and margin are paler.
    midrib = np.exp(-((w / (0.0013 + 0.0016 * (1 - t))) ** 2)) * (1 - 0.75 * t)
    color = _mix(color, np.array([0.66, 0.72, 0.46]) * (1 + 0.06 * veins)[..., None], 0.75 * midrib)
    color = _mix(color, np.array([0.52, 0.60, 0.34]), 0.35 * np.clip((np.abs(q) - 0.94) / 0.06, 0, 1) + 0 * t)
    # Chlorotic flecks, drawn out along the veins, and a few brown lesions.
    fleck = fractal_noise(s / 0.0075, w / 0.0022, seed + 7, octaves=3)
    color = _mix(color, np.array([0.68, 0.70, 0.40]), 0.6 * np.clip((fleck - 0.42 + 0.25 * leaf.age) * 4, 0, 1))
    lesion = fractal_noise(s / 0.022, w / 0.007, seed + 8, octaves=4)
    color = _mix(color, np.array([0.46, 0.36, 0.20]), 0.85 * np.clip((lesion - 0.62 + 0.35 * leaf.age) * 6, 0, 1))
    # Old leaves dry from the tip and the margins; fresh ones only at the very tip.
    reach = 1.02 - 0.55 * leaf.age**1.5
    dry = np.clip((t + 0.10 * np.abs(q) ** 3 + 0.05 * blotch - reach) * 9, 0, 1)
    straw = np.array([0.70, 0.60, 0.40]) * (1 + 0.15 * veins + 0.12 * grain)[..., None]
    color = _mix(color, straw, dry)
    # Soil splashed onto the lower leaves.
    dust = fractal_noise(s / 0.010, w / 0.010, seed + 10, octaves=4, gain=0.7)
    color = _mix(color, np.array([0.48, 0.41, 0.33]), 0.7 * np.clip((dust - 0.35 - 0.6 * leaf.rank) * 3, 0, 1))
    return _to_bytes(color)


def _stem_texture(seed: int, line: Array) -> NDArray[np.uint8]:
    """(_STEM_STRIP, _TEXTURE_WIDTH, 3): up the stem to the right, around it downwards."""
    s = (1.2 * (np.arange(_TEXTURE_WIDTH) + 0.5) / _TEXTURE_WIDTH + line[0, 2])[None, :]
    turn = (2 * np.pi * (np.arange(_STEM_STRIP) + 0.5) / _STEM_STRIP)[:, None]
    x, y = 3.0 * np.cos(turn) + 0 * s, 3.0 * np.sin(turn) + 0 * s
    # Noise on a cylinder: the sum of two planes' noise has no seam.
    streaks = fractal_noise(s / 0.15, 2 * x, seed + 21, octaves=3)
    streaks += fractal_noise(s / 0.15, 2 * y, seed + 22, octaves=3)
    grain = fractal_noise(s / 0.003, 4 * x, seed + 23, octaves=3)
    grain += fractal_noise(s / 0.003, 4 * y, seed + 24, octaves=3)
    base = np.clip(1 - s / 0.09, 0, 1) + 0 * turn  # anthocyanin: purple at the foot
    color = np.array([0.52, 0.63, 0.35]) * (1 + 0.12 * streaks + 0.12 * grain)[..., None]
    color = _mix(color, np.array([0.45, 0.30, 0.28]), 0.7 * base * np.clip(0.6 + 0.6 * streaks, 0, 1))
    dust = np.clip((grain - 0.2 - s / 0.10) * 2, 0, 1)
    color = _mix(color, np.array([0.48, 0.41, 0.33]), 0.8 * dust)
    return _to_bytes(color[::-1])


def _mix(a: NDArray[np.floating], b: NDArray[np.floating], share: NDArray[np.floating]) -> NDArray[np.floating]:
    mixed: NDArray[np.floating] = a + (b - a) * np.asarray(share)[..., None]
    return mixed


def _to_bytes(color: NDArray[np.floating]) -> NDArray[np.uint8]:
    return np.asarray(np.clip(255 * color + 0.5, 0, 255), dtype=np.uint8)
