"""Rows of maize around the plot. They hide and confuse; they are no part of the reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.plot_description import MaizeDescription, NeighboursDescription
from fieldkit.scenes.sampling import NEIGHBOUR_NAME
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.maize import build_maize

Array = NDArray[np.float64]
Height = Callable[[Array, Array], Array]


def neighbour_plants(
    neighbours: NeighboursDescription, lower: tuple[float, float], upper: tuple[float, float]
) -> tuple[MaizeDescription, ...]:
    """Where the neighbours stand, around the bounds of the plot's own plants (in x and y, metres)."""
    rng = np.random.default_rng([neighbours.seed, 51])
    turn = np.radians(90.0 - neighbours.heading_deg)
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    corners = np.array([[x, y] for x in (lower[0], upper[0]) for y in (lower[1], upper[1])])
    middle = float((corners @ along).mean())
    plants = []
    for side in (-1.0, 1.0):
        edge = float((side * corners @ across).max())
        for row in range(neighbours.rows):
            offset = side * (edge + (row + 1) * neighbours.row_spacing_m)
            count = int(neighbours.length_m / neighbours.plant_spacing_m) + 1
            for i in range(count):
                place = middle + (i - (count - 1) / 2) * neighbours.plant_spacing_m
                x, y = place * along + offset * across + rng.normal(0, 0.02, 2)
                plants.append(
                    MaizeDescription(
                        seed=int(rng.integers(1 << 30)), x_m=float(x), y_m=float(y),
                        yaw_deg=float(rng.uniform(0, 360)), scale=float(rng.uniform(0.9, 1.1)), stage=neighbours.stage,
                    )
                )  # fmt: skip
    return tuple(plants)


def build_neighbours(
    neighbours: NeighboursDescription, lower: tuple[float, float], upper: tuple[float, float], height: Height, *,
    textured: bool = True,
) -> list[Mesh]:  # fmt: skip
    """The neighbours as coarse, unlit meshes that are no part of the reference."""
    meshes = []
    for i, plant in enumerate(neighbour_plants(neighbours, lower, upper)):
        ground = float(height(np.array([plant.x_m]), np.array([plant.y_m]))[0])
        mesh = build_maize(plant, ground, coarse=True, textured=textured)
        meshes.append(replace(mesh, name=f"{NEIGHBOUR_NAME}{i + 1}", plant=False))
    return meshes
