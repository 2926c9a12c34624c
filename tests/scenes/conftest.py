"""One small plot for all scene tests, and a renderer of it, kept."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from fieldkit.scenes.maize import MaizeDescription
from fieldkit.scenes.plot import PlotDescription, build_scene
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.soil import SoilDescription

SMALL_SOIL = SoilDescription(seed=4, core_m=0.5, spacing_m=0.02, texture_px=256, stones=30, residues=10)
SMALL_PLOT = PlotDescription((MaizeDescription(seed=7, leaves=6), MaizeDescription(seed=8, x_m=0.3)), SMALL_SOIL)


@pytest.fixture(scope="session")
def small_plot() -> PlotDescription:
    """Two plants on coarse soil."""
    return SMALL_PLOT


@pytest.fixture(scope="session")
def small_scene() -> Scene:
    """The scene of `small_plot`."""
    return build_scene(SMALL_PLOT)


@pytest.fixture(scope="session")
def renderer(small_scene: Scene) -> Iterator[Renderer]:
    """A renderer of `small_scene`."""
    with Renderer(small_scene) as kept:
        yield kept
