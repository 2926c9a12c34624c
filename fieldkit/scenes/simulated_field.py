"""The one place that loads the simulated field (`fieldkit_sim`), when a scene is built or made and not before."""

from __future__ import annotations

from importlib import import_module
from typing import Any, cast

from fieldkit.runtime.progress import Advance, ignore
from fieldkit.scenes.plot_description import PlotDescription
from fieldkit.scenes.scene import Scene


def build_scene(plot: PlotDescription, advance: Advance = ignore) -> Scene:
    """The plot's meshes with baked light, and the sky; ``advance`` is told of plants, of a trial's plots."""
    module = simulated_field("plot" if plot.trial is None else "trial.block")
    return cast(Scene, module.build_scene(plot, advance))


def build_plants(plot: PlotDescription) -> Scene:
    """The plot's plants and its neighbours in coarse forms: no textures, no light, no soil."""
    return cast(Scene, simulated_field("plot").build_plants(plot))


def simulated_field(module: str) -> Any:
    """A module of `fieldkit_sim`."""
    return import_module(f"fieldkit_sim.{module}")
