"""Rows of maize around the plot. They hide and confuse; they are no part of the reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.maize import STAGES, MaizeDescription, Stage, build_maize
from fieldkit.scenes.scene import Mesh, Scene

Array = NDArray[np.float64]
Height = Callable[[Array, Array], Array]
_NAME = "neighbour-"


@dataclass(frozen=True)
class NeighboursDescription:
    """Plants that stand around the plot in its rows and beside them.

    Attributes:
        seed: of everything random about them.
        rows: on each side of the plot's rows; 0 for none.
        row_spacing_m: between rows, and from the plot's bounds to the nearest one.
        plant_spacing_m: within a row.
        length_m: of a row.
        heading_deg: direction of the rows, clockwise from north.
        stage: growth stage of all of them.
    """

    seed: int = 0
    rows: int = 0
    row_spacing_m: float = 0.75
    plant_spacing_m: float = 0.18
    length_m: float = 3.0
    heading_deg: float = 90.0
    stage: Stage = "V8"

    def __post_init__(self) -> None:
        if not 0 <= self.rows <= 5:
            raise ValueError(f"0 to 5 neighbouring rows on each side, not {self.rows}")
        if not (0.2 <= self.row_spacing_m <= 3.0 and 0.05 <= self.plant_spacing_m <= 1.0 and 0 < self.length_m <= 20):
            raise ValueError("row_spacing_m is 0.2 to 3, plant_spacing_m 0.05 to 1, length_m above 0 and at most 20")
        if self.stage not in STAGES:
            raise ValueError(f"{self.stage!r} is no growth stage: it is one of {', '.join(STAGES)}")


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
        meshes.append(
            replace(build_maize(plant, ground, coarse=True, textured=textured), name=f"{_NAME}{i + 1}", plant=False)
        )
    return meshes


def neighbour_meshes(scene: Scene) -> list[Mesh]:
    """A scene's neighbour plants."""
    return [mesh for mesh in scene.meshes if mesh.name.startswith(_NAME)]


def neighbour_points(scene: Scene) -> Array:
    """(n, 3) vertices of a scene's neighbour plants: what a drone has to keep clear of beside the plot's own."""
    points = [mesh.vertices for mesh in neighbour_meshes(scene)]
    return np.concatenate(points).astype(np.float64) if points else np.zeros((0, 3))
