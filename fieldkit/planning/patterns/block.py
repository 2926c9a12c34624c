"""A block of a trial, one plot of which patterns are judged by. It needs the simulated field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.clouds.canopy import Outline, inside_outline, rectangle
from fieldkit.clouds.cloud import Cloud
from fieldkit.planning.space.plots import LOWEST_M
from fieldkit.scenes.description import SceneDescription, build
from fieldkit.scenes.plot_description import TrialDescription
from fieldkit.scenes.sampling import sample_visible
from fieldkit.scenes.scene import Mesh, Scene
from fieldkit.scenes.simulated_field import simulated_field

ROWS_DEG = 90.0
"""Direction of a block's rows, clockwise from y: they run along x."""
LAYOUT = TrialDescription(ranges=3, columns=7)
"""Of a block whose middle plot has plants about it as far as photographs see from 8 m."""
_AROUND_M = 1.2
"""Width about a plot within which plants hide it, metres."""
_POINTS = 600_000
"""Points drawn on the surfaces of a plot and of what is about it: 10 mm apart on a canopy of 4 m² of leaves a square
metre, so that a perfect cloud is 5 mm off."""
_PIXELS = 2400
"""Side of the depth maps that tell what of them can be seen, pixels."""


@dataclass(frozen=True, eq=False)
class Block:
    """A plot of a block, in the block's frame: rows run along x, z is above the ground."""

    outline: Outline
    """Of the plot."""
    reference: Cloud
    """PC_env: what can be seen of plants above the plot, with normals."""
    triangles: FloatArray
    """(m, 3, 3) corners of the plants that may hide it."""
    description: SceneDescription
    scene: Scene
    """As it is described; rendered, it is what photographs see."""
    truth: Mapping[str, float]
    """Of the plot's traits, by their names in `TraitsEntry`."""

    @property
    def height_m(self) -> float:
        """Of the plot's highest plant."""
        return float(self.reference.points[:, 2].max())

    @classmethod
    def of(cls, trial: TrialDescription) -> Block:
        """A trial's plot in the middle."""
        plot = f"r{trial.ranges // 2 + 1}c{trial.columns // 2 + 1}"
        (own,) = (p for p in simulated_field("trial.layout").plots_of(trial) if p.id == plot)
        description = simulated_field("trial.files").new_trial(trial)
        scene = build(description)
        truth = simulated_field("trial.truth").plot_truth(description.plot, own, scene.plants).of_traits
        outline = rectangle(own.lower_m, own.upper_m)
        near = _near(scene, np.array(own.lower_m) - _AROUND_M, np.array(own.upper_m) + _AROUND_M)
        (seen,) = sample_visible(near, (_POINTS,), trial.seed, pixels=_PIXELS)
        reference = seen.select(inside_outline(seen.points, outline) & (seen.points[:, 2] > LOWEST_M))
        triangles = np.concatenate([mesh.vertices[mesh.faces] for mesh in near.meshes]).astype(np.float64)
        return cls(outline, reference, triangles, description, scene, truth)


def _near(scene: Scene, low: FloatArray, high: FloatArray) -> Scene:
    """The plants of a scene, as far as they reach between two corners (x, y)."""
    meshes = []
    for mesh in scene.plants:
        inside = np.all((mesh.vertices[:, :2] > low) & (mesh.vertices[:, :2] < high), axis=1)
        used, index = np.unique(mesh.faces[np.any(inside[mesh.faces], axis=1)], return_inverse=True)
        if len(used) and mesh.normals is not None:
            faces = index.reshape(-1, 3).astype(np.int32)
            meshes.append(Mesh(mesh.name, mesh.vertices[used], faces, mesh.normals[used], plant=True))
    return Scene(tuple(meshes), scene.light)
