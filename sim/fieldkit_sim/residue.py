"""Crop residue: straw on the ground."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.plot_description import SoilDescription
from fieldkit.scenes.scene import Mesh, grid_faces
from fieldkit_sim.scatter import pile, places

Height = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


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
    return pile("residue", vertices, faces, colors)
