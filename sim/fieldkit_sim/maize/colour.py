"""Colours of blades and stems."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.scenes.noise import fractal_noise
from fieldkit_sim.maize.organs import Leaf


def mix(a: NDArray[np.floating], b: NDArray[np.floating], share: NDArray[np.floating]) -> NDArray[np.floating]:
    """From colour ``a`` to ``b`` (…, 3) by the share (…)."""
    mixed: NDArray[np.floating] = a + (b - a) * np.asarray(share)[..., None]
    return mixed


def to_bytes(color: NDArray[np.floating]) -> ByteArray:
    """Bytes of a colour whose values lie in [0, 1]."""
    return np.asarray(np.clip(255 * color + 0.5, 0, 255), dtype=np.uint8)


def blade_texture(leaf: Leaf, height: int, width: int, markings: float) -> ByteArray:
    """(height, width, 3): along the blade to the right, row 0 its left margin.

    Veins, blotches, flecks, lesions, dry tips and dust, with an age gradient along the plant and along the blade;
    ``markings`` says how strong all but the gradients and the tips are.
    """
    t = ((np.arange(width) + 0.5) / width)[None, :]
    q = 1 - 2 * ((np.arange(height) + 0.5) / height)[:, None]
    s = t * leaf.length + 0 * q  # metres
    w = q * 0.5 * leaf.width + 0 * t  # metres at the widest place
    seed = leaf.seed
    blotch = fractal_noise(s / 0.055, w / 0.012, seed + 1, octaves=4, gain=0.6)
    # Parallel veins: noise drawn out along the blade.
    veins = fractal_noise(s / 0.20, w / 0.0034, seed + 2, octaves=2)
    veins += 0.6 * fractal_noise(s / 0.05, w / 0.0014, seed + 3, octaves=2)
    grain = fractal_noise(s / 0.0060, w / 0.0034, seed + 4, octaves=3, gain=0.7)
    bands = fractal_noise(s / 0.05, 0 * w + 2.2, seed + 6, octaves=2) * (1 - leaf.rank * 0.4)
    green = np.array([0.40, 0.58, 0.22]) * (1 - leaf.age) + np.array([0.52, 0.56, 0.22]) * leaf.age
    # The tip of a blade is older than its base.
    green = green * (1.06 - 0.10 * t[..., None]) + 0.05 * t[..., None] * np.array([0.6, 0.3, -0.1])
    tone = 1 + markings * (0.38 * blotch + 0.24 * veins + 0.34 * grain + 0.15 * bands)
    color = green * tone[..., None]
    color += 0.06 * markings * np.clip(blotch, 0, 1)[..., None] * np.array([1.0, 0.8, -0.2])
    midrib = np.exp(-((w / (0.0013 + 0.0020 * (1 - t))) ** 2)) * (1 - 0.75 * t)
    color = mix(color, np.array([0.68, 0.74, 0.50]) * (1 + 0.06 * veins)[..., None], 0.8 * midrib)
    color = mix(color, np.array([0.52, 0.60, 0.34]), 0.35 * np.clip((np.abs(q) - 0.94) / 0.06, 0, 1) + 0 * t)
    # Chlorotic flecks, drawn out along the veins, and brown lesions.
    fleck = fractal_noise(s / 0.016, w / 0.0065, seed + 7, octaves=3)
    color = mix(
        color, np.array([0.70, 0.72, 0.42]), 0.75 * markings * np.clip((fleck - 0.30 + 0.25 * leaf.age) * 4, 0, 1)
    )
    lesion = fractal_noise(s / 0.030, w / 0.011, seed + 8, octaves=4)
    color = mix(
        color, np.array([0.42, 0.31, 0.17]), 0.9 * markings * np.clip((lesion - 0.44 + 0.30 * leaf.age) * 6, 0, 1)
    )
    # Old leaves dry from the tip and the margins; fresh ones only at the very tip.
    reach = 1.02 - 0.55 * leaf.age**1.5
    dry = np.clip((t + 0.10 * np.abs(q) ** 3 + 0.05 * blotch - reach) * 9, 0, 1)
    straw = np.array([0.70, 0.60, 0.40]) * (1 + 0.15 * veins + 0.16 * grain)[..., None]
    color = mix(color, straw, dry)
    # Soil splashed onto the lower leaves, pollen and dust on all.
    dust = fractal_noise(s / 0.012, w / 0.012, seed + 10, octaves=4, gain=0.7)
    color = mix(
        color, np.array([0.50, 0.43, 0.34]), 0.75 * markings * np.clip((dust - 0.28 - 0.8 * leaf.rank) * 3, 0, 1)
    )
    return to_bytes(color)


def stem_texture(
    seed: int, foot_m: float, length_m: float, nodes: FloatArray, height: int, width: int, markings: float
) -> ByteArray:
    """(height, width, 3): up the stem to the right, around it downwards, from ``foot_m`` over ``length_m``."""
    s = (length_m * (np.arange(width) + 0.5) / width + foot_m)[None, :]
    turn = (2 * np.pi * (np.arange(height) + 0.5) / height)[:, None]
    x, y = 3.0 * np.cos(turn) + 0 * s, 3.0 * np.sin(turn) + 0 * s
    # Noise on a cylinder: the sum of two planes' noise has no seam.
    streaks = fractal_noise(s / 0.15, 2 * x, seed + 21, octaves=3) + fractal_noise(
        s / 0.15, 2 * y, seed + 22, octaves=3
    )
    grain = fractal_noise(s / 0.006, 2 * x, seed + 23, octaves=3) + fractal_noise(
        s / 0.006, 2 * y, seed + 24, octaves=3
    )
    base = np.clip(1 - s / 0.09, 0, 1) + 0 * turn  # anthocyanin: purple at the foot
    color: NDArray[np.floating] = (
        np.array([0.50, 0.62, 0.33]) * (1 + markings * (0.14 * streaks + 0.15 * grain))[..., None]
    )
    color = mix(color, np.array([0.45, 0.30, 0.28]), 0.7 * base * np.clip(0.6 + 0.6 * streaks, 0, 1))
    node = np.zeros_like(s)
    for at in nodes:
        node = np.maximum(node, np.exp(-(((s - at) / 0.005) ** 2)))
    color = mix(color, np.array([0.62, 0.66, 0.42]), 0.5 * node + 0 * turn)
    dust = np.clip((grain - 0.2 - s / 0.10) * 2, 0, 1)
    color = mix(color, np.array([0.48, 0.41, 0.33]), 0.8 * markings * dust)
    return to_bytes(color[::-1])


def plain_texture(seed: int, base: tuple[float, float, float], height: int, width: int) -> ByteArray:
    """(height, width, 3) of one colour with streaks and grain, for tassels and husks."""
    u, v = np.meshgrid(np.arange(width) / width, np.arange(height) / height)
    streaks = fractal_noise(u * 12, v * 9, seed + 31, octaves=3)
    grain = fractal_noise(u * 90, v * 9, seed + 32, octaves=3)
    return to_bytes(np.array(base) * (1 + 0.18 * streaks + 0.25 * grain)[..., None])
