"""A trial as a scene."""

from __future__ import annotations

from functools import partial

import numpy as np

from fieldkit.runtime.progress import Advance, ignore
from fieldkit.scenes.plot_description import PlotDescription
from fieldkit.scenes.scene import Mesh, Scene
from fieldkit_sim.plot import LEAF, SOIL, WEED, Shadows, bake_light, sky
from fieldkit_sim.trial.canopy import Sheets, plot_mesh
from fieldkit_sim.trial.ground import build_ground, ground_height
from fieldkit_sim.trial.layout import TrialPlot, plots_of
from fieldkit_sim.weeds import block_weeds

_SUN_PX = 4096
"""Side of the map of what the sun sees, pixels."""
_SKY_PX = 1280
"""Side of the maps of what the sky sees, pixels."""
_BIAS_PX = 1.5
"""How far in front something must be to hide a point, pixels of those maps."""
_DIRECTIONS = 12
"""Number of directions of the sky."""
_BESIDE_M = 1.5
"""Width about the block within which shadows are worked out, metres."""


def build_scene(plot: PlotDescription, advance: Advance = ignore) -> Scene:
    """The meshes of a plot's trial with baked light, and the sky; ``advance`` is told of the trial's plots."""
    trial = plot.trial
    assert trial is not None
    sheets = {fine: Sheets.of(trial.seed, fine) for fine in ((1, 2) if trial.detailed else (1,))}
    canopies = []
    for own in plots_of(trial):
        canopies.append(canopy_of(plot, own, sheets[2 if own.id in trial.detailed else 1]))
        advance(1)
    ground = build_ground(plot.soil, trial.size_m, plot.light.sun)
    weeds = block_weeds(plot.weeds, partial(ground_height, plot.soil), trial.size_m)
    radius_m = 0.5 * max(trial.size_m) + _BESIDE_M
    sun_m, sky_m = (_BIAS_PX * 2.0 * radius_m / px for px in (_SUN_PX, _SKY_PX))
    lit = bake_light(
        [*((mesh, LEAF) for mesh in canopies), *((mesh, SOIL) for mesh in ground), *((mesh, WEED) for mesh in weeds)],
        plot.light,
        radius_m=radius_m,
        shadows=Shadows(_SUN_PX, sun_m, 1, _SKY_PX, sky_m, _DIRECTIONS),
    )
    return Scene((*lit, sky()), plot.light)


def canopy_of(plot: PlotDescription, own: TrialPlot, sheets: Sheets) -> Mesh:
    """A plot's plants, unlit."""
    places = np.array([(p.x_m, p.y_m) for p in own.plants]).reshape(-1, 2)
    heights = ground_height(plot.soil, places[:, 0].copy(), places[:, 1].copy())
    return plot_mesh(own, heights, sheets)
