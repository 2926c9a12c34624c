"""One small plot and one row of plants for all scene tests, and a renderer of the plot, kept."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldkit.clouds import Cloud, concatenate
from fieldkit.scenes.plot_description import MaizeDescription, PlotDescription, SoilDescription
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.sampling import sample_visible
from fieldkit.scenes.scene import Scene
from fieldkit_sim.maize.plant import build_maize
from fieldkit_sim.plot import build_scene

SMALL_SOIL = SoilDescription(seed=4, core_m=0.5, spacing_m=0.02, texture_px=256, stones=30, residues=10)
SMALL_PLOT = PlotDescription((MaizeDescription(seed=7, leaves=6), MaizeDescription(seed=8, x_m=0.3)), SMALL_SOIL)


@pytest.fixture(scope="session")
def small_plot() -> PlotDescription:
    """Two plants on coarse soil."""
    return SMALL_PLOT


@cache
def made_scene() -> Scene:
    """The scene of `SMALL_PLOT`, made once in a process."""
    return build_scene(SMALL_PLOT)


@pytest.fixture(scope="session")
def small_scene() -> Scene:
    """The scene of `small_plot`."""
    return made_scene()


@pytest.fixture(scope="session")
def renderer(small_scene: Scene) -> Iterator[Renderer]:
    """A renderer of `small_scene`."""
    with Renderer(small_scene) as kept:
        yield kept


@dataclass(frozen=True, eq=False)
class Row:
    """Points of a simulated row and the plant, from 1, that each of them is of."""

    cloud: Cloud
    plants: NDArray[np.int32]


@pytest.fixture(scope="session")
def row() -> Row:
    """Three plants 25 cm apart along x, whose leaves cross."""
    return make_row()


@cache
def make_row() -> Row:
    """`row`, for tests of other folders."""
    clouds = []
    for number in range(3):
        plant = MaizeDescription(seed=number + 1, x_m=0.25 * (number - 1), yaw_deg=40.0 * number, leaves=7)
        clouds.append(sample_visible(Scene((build_maize(plant, 0.0),)), (12_000,), seed=number)[0])
    plants = np.repeat(np.arange(1, 4, dtype=np.int32), [len(cloud) for cloud in clouds])
    return Row(concatenate(clouds), plants)
