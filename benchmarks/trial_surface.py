"""The surface of a block's plants that a flight's photographs see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from benchmarks.trial_flights import Flight
from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.description import build
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene_file import read_scene
from fieldkit_sim.trial.files import SCENE_FILE
from fieldkit_sim.trial.layout import plots_of

_POINTS = 4000
"""On the plants of a plot, uniform by area."""
_VERTICES = 2000
"""Highest ones of a plot's plants that are looked for."""
_COARSER = 4
"""Width of a depth map's pixel in the photograph's pixels."""
_BIAS_M = 0.03
"""Distance behind a depth map's surface up to which a point is on it, metres: pixels are about 1 cm wide."""


@dataclass(frozen=True)
class Seen:
    """What at least two photographs see of a plot's plants."""

    surface: FloatArray
    """(n, 3) points, uniform by area, frame of the scene."""
    top_m: float
    """Height of the highest of the vertices."""


def seen_by_two(flight: Flight, names: Sequence[str]) -> dict[str, Seen]:
    """What a flight sees of plots, by plot."""
    description = read_scene(flight.folder / SCENE_FILE)
    assert description.plot.trial is not None
    scene = build(description)
    camera = _coarser(flight.survey.camera)
    points, outlines = {}, {}
    for plot in (plot for plot in plots_of(description.plot.trial) if plot.id in names):
        (mesh,) = (mesh for mesh in scene.plants if mesh.name == f"plot-{plot.id}")
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        surface = trimesh.sample.sample_surface(solid, _POINTS, seed=0)[0]
        highest = mesh.vertices[np.argsort(mesh.vertices[:, 2])[-_VERTICES:]]
        points[plot.id] = np.concatenate([surface, highest])
        outlines[plot.id] = np.array([plot.lower_m, plot.upper_m])
    together = np.concatenate(list(points.values()))
    views = np.zeros(len(together), dtype=np.int64)
    with Renderer(scene) as renderer:
        for pose in flight.true_poses().values():
            views += _seen(together, pose, camera, renderer)
    found = {}
    for (name, places), seen in zip(points.items(), np.split(views >= 2, len(points)), strict=True):
        (low, high), surface = outlines[name], places[:_POINTS]
        inside = ((surface[:, :2] > low) & (surface[:, :2] < high)).all(axis=1)
        found[name] = Seen(
            surface[seen[:_POINTS] & inside], float(places[_POINTS:][seen[_POINTS:], 2].max(initial=0.0))
        )
    return found


def _coarser(camera: Intrinsics) -> Intrinsics:
    width, height = camera.width // _COARSER, camera.height // _COARSER
    return Intrinsics.pinhole(width, height, camera.fx / _COARSER)


def _seen(points: FloatArray, pose: Pose, camera: Intrinsics, renderer: Renderer) -> BoolArray:
    local = pose.to_camera(points)
    seen = camera.sees(local)
    if seen.any():
        depth = renderer.depth(pose, camera)
        x, y = camera.project(local[seen]).astype(np.int64).T
        seen[seen] = local[seen, 2] < depth[y, x] + _BIAS_M
    return seen
