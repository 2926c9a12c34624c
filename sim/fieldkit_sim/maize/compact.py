"""The plain plant of the engine's benchmark: stem, sheaths, arching and twisting blades, textured leaf by leaf.

Kept as it was measured; plants at a growth stage are built by `fieldkit_sim.maize.plant`.

The forms follow published descriptions, the constants are ours, chosen by eye for vegetative plants of 0.4–0.9 m:
leaf size along the stem is the skewed bell of Dwyer and Stewart (1986), the midrib an arc whose inclination falls
along the blade as in Prévot, Aries and Monestiez (1991), leaves stand in two ranks.
"""

from __future__ import annotations

import numpy as np

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.plot_description import MaizeDescription
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.faces import grid_faces
from fieldkit_sim.maize.colour import mix, to_bytes
from fieldkit_sim.maize.organs import Leaf, Part, Strip, assembled, blade

_STRIP = 96  # texture rows per leaf
_STEM_STRIP = 160
"""Texture rows of the stem."""
_TEXTURE_WIDTH = 2048
"""Texture columns along a leaf or stem."""


def build_compact_maize(plant: MaizeDescription, leaves_count: int, ground_m: float = 0.0) -> Mesh:
    """A plant of ``leaves_count`` blades as one textured mesh with normals, unlit, standing at ``ground_m``."""
    rng = np.random.default_rng([plant.seed, 77])
    stem_points, stem_radii, leaves = _architecture(leaves_count, rng)
    rows = _STRIP * len(leaves) + _STEM_STRIP
    parts = [_stem(stem_points, stem_radii, rows)]
    parts += [
        blade(leaf, Strip(_STEM_STRIP + i * _STRIP, _STRIP, rows, _TEXTURE_WIDTH)) for i, leaf in enumerate(leaves)
    ]
    pictures = [_stem_texture(plant.seed, stem_points), *map(_blade_texture, leaves)]
    return assembled(plant, ground_m, parts, pictures)


def _architecture(n: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray, list[Leaf]]:
    """Centre line (n, 3) and radii (n,) of the stem with its sheaths, and the leaves, lowest first."""
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
            Leaf(
                rank=k / (n - 1),
                age=age,
                collar=collar,
                azimuth=np.pi * (k % 2) + rng.normal(0, np.radians(16)),
                length=vigour * (0.20 + 0.56 * size) * rng.uniform(0.92, 1.08) * (0.082 * n + 0.25),
                width=vigour * (0.022 + 0.050 * size) * rng.uniform(0.92, 1.08),
                elevation=np.radians(rng.normal(52, 6) + 26 * whorl),
                droop=np.radians(rng.normal(105, 22) * (1 - 0.75 * whorl) + 18 * age),
                bend=float(rng.uniform(1.0, 1.9)),
                sweep=rng.normal(0, 0.22),
                twist=rng.normal(0, 0.55),
                fold=np.radians(rng.uniform(18, 34) + 26 * whorl),
                ruffle=float(rng.uniform(0.4, 1.2) * (1 - 0.6 * whorl)),
                seed=int(rng.integers(1 << 30)),
            )
        )
    return line, radii, leaves


def _stem(line: FloatArray, radii: FloatArray, rows: int) -> Part:
    sides = 25  # the last repeats the first, for the texture's seam
    angle = np.linspace(0, 2 * np.pi, sides)
    ring = np.column_stack([1.12 * np.cos(angle), 0.90 * np.sin(angle), 0 * angle])  # a maize stem is oval
    vertices = line[:, None] + radii[:, None, None] * ring[None]
    v = (0.5 + (_STEM_STRIP - 1) * np.linspace(0, 1, sides)) / rows
    u = (line[:, 2] - line[0, 2]) / 1.2  # the same scale on every plant: 1.2 m to the texture's width
    uv = np.stack(np.broadcast_arrays(u[:, None], v[None]), axis=-1)
    return vertices.reshape(-1, 3), grid_faces(len(line), sides), uv.reshape(-1, 2)


def _blade_texture(leaf: Leaf) -> ByteArray:
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
    color = mix(color, np.array([0.66, 0.72, 0.46]) * (1 + 0.06 * veins)[..., None], 0.75 * midrib)
    color = mix(color, np.array([0.52, 0.60, 0.34]), 0.35 * np.clip((np.abs(q) - 0.94) / 0.06, 0, 1) + 0 * t)
    # Chlorotic flecks, drawn out along the veins, and a few brown lesions.
    fleck = fractal_noise(s / 0.0075, w / 0.0022, seed + 7, octaves=3)
    color = mix(color, np.array([0.68, 0.70, 0.40]), 0.6 * np.clip((fleck - 0.42 + 0.25 * leaf.age) * 4, 0, 1))
    lesion = fractal_noise(s / 0.022, w / 0.007, seed + 8, octaves=4)
    color = mix(color, np.array([0.46, 0.36, 0.20]), 0.85 * np.clip((lesion - 0.62 + 0.35 * leaf.age) * 6, 0, 1))
    # Old leaves dry from the tip and the margins; fresh ones only at the very tip.
    reach = 1.02 - 0.55 * leaf.age**1.5
    dry = np.clip((t + 0.10 * np.abs(q) ** 3 + 0.05 * blotch - reach) * 9, 0, 1)
    straw = np.array([0.70, 0.60, 0.40]) * (1 + 0.15 * veins + 0.12 * grain)[..., None]
    color = mix(color, straw, dry)
    # Soil splashed onto the lower leaves.
    dust = fractal_noise(s / 0.010, w / 0.010, seed + 10, octaves=4, gain=0.7)
    color = mix(color, np.array([0.48, 0.41, 0.33]), 0.7 * np.clip((dust - 0.35 - 0.6 * leaf.rank) * 3, 0, 1))
    return to_bytes(color)


def _stem_texture(seed: int, line: FloatArray) -> ByteArray:
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
    color = mix(color, np.array([0.45, 0.30, 0.28]), 0.7 * base * np.clip(0.6 + 0.6 * streaks, 0, 1))
    dust = np.clip((grain - 0.2 - s / 0.10) * 2, 0, 1)
    color = mix(color, np.array([0.48, 0.41, 0.33]), 0.8 * dust)
    return to_bytes(color[::-1])
