"""What a trial's plots truly are, from their meshes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import BoolArray
from fieldkit.clouds.volume import Volume
from fieldkit.scenes.plot_description import PlotDescription
from fieldkit.scenes.sampling import WEED_NAMES
from fieldkit.scenes.scene import Mesh, Scene
from fieldkit_sim.trial.ground import ground_height
from fieldkit_sim.trial.layout import TrialPlot, plots_of
from fieldkit_sim.truth import height_map

_PIXEL_M = 0.004
"""Edge of the height map's pixels, metres: a tenth of a leaf's width."""
_COVERED_M = 0.02
"""Height above the ground from which a pixel is covered by plants, metres."""


@dataclass(frozen=True)
class PlotTruth:
    """A plot's true traits. Cover, volume and quantiles count all leaves within the outline, neighbours', too.

    Weeds count for cover and volume, where they stand `_COVERED_M` high, and for no other trait.
    """

    plot: str
    plants: int
    height_m: float
    """Of the highest leaf of its own plants above the ground's median height within the outline."""
    top_m: float
    """The same of any organ, such as a tassel."""
    height_p95_m: float
    height_p99_m: float
    """Quantiles of the canopy's height above the ground where there are plants."""
    cover_percent: float
    volume_m3: float
    """Between ground and the canopy's surface."""
    leaf_area_m2: float
    """One side of its own plants' blades."""
    area_m2: float
    """Of the outline."""
    weeds_percent: float
    """What of ``cover_percent`` weeds alone cover."""

    @property
    def lai(self) -> float:
        """Leaf area index: leaf area for each area of ground."""
        return self.leaf_area_m2 / self.area_m2

    @property
    def of_traits(self) -> dict[str, float]:
        """Those that an evaluation measures, by their names there."""
        return {
            "height_p95_m": self.height_p95_m,
            "height_p99_m": self.height_p99_m,
            "cover_percent": self.cover_percent,
            "canopy_volume_m3": self.volume_m3,
        }


def trial_truth(plot: PlotDescription, scene: Scene) -> tuple[PlotTruth, ...]:
    """The truth of every plot of a block; ``scene`` is what was built of it."""
    assert plot.trial is not None
    return tuple(plot_truth(plot, own, scene.meshes) for own in plots_of(plot.trial))


def plot_truth(plot: PlotDescription, own: TrialPlot, meshes: Iterable[Mesh]) -> PlotTruth:
    """The truth of one plot of a block; of its scene's ``meshes`` plants and weeds count."""
    near = {mesh.name: mesh for mesh in meshes if _touches(mesh, own)}
    outline = Volume((*own.lower_m, -1.0), (*own.upper_m, 10.0))
    above = height_map([mesh for mesh in near.values() if mesh.plant], outline, _PIXEL_M)
    weeds = height_map([mesh for name, mesh in near.items() if name.startswith(WEED_NAMES)], outline, _PIXEL_M)
    rows, columns = above.shape
    x = own.lower_m[0] + (np.arange(columns) + 0.5) * _PIXEL_M
    y = own.lower_m[1] + (np.arange(rows) + 0.5) * _PIXEL_M
    ground = ground_height(plot.soil, *np.meshgrid(x, y))
    heights = above - ground
    covered = heights > _COVERED_M  # False where there is none
    green = np.fmax(heights, weeds - ground)
    hidden = green > _COVERED_M
    level = float(np.median(ground))
    mesh = near[f"plot-{own.id}"]
    assert mesh.flex_m is not None
    blades = mesh.flex_m > 0.0
    p95, p99 = np.quantile(heights[covered], [0.95, 0.99]) if covered.any() else (0.0, 0.0)
    return PlotTruth(
        own.id,
        len(own.plants),
        float(mesh.vertices[blades, 2].max()) - level,
        float(mesh.vertices[:, 2].max()) - level,
        float(p95),
        float(p99),
        100.0 * float(hidden.mean()),
        float(green[hidden].sum()) * _PIXEL_M**2,
        _area(mesh, blades),
        float(np.prod(np.subtract(own.upper_m, own.lower_m))),
        100.0 * float((hidden & ~covered).mean()),
    )


def _touches(mesh: Mesh, own: TrialPlot) -> bool:
    low, high = mesh.vertices[:, :2].min(axis=0), mesh.vertices[:, :2].max(axis=0)
    return bool((low < own.upper_m).all() and (high > own.lower_m).all())


def _area(mesh: Mesh, blades: BoolArray) -> float:
    """Of the triangles with a corner on a blade, square metres."""
    faces = mesh.faces[blades[mesh.faces].any(axis=1)]
    a, b, c = (mesh.vertices[faces[:, k]].astype(np.float64) for k in range(3))
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
