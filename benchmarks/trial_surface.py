"""The surface of a block's plants that a flight's photographs see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from benchmarks.trial_flights import Flight
from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.description import build
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.scene_file import read_scene
from fieldkit_sim.trial.files import SCENE_FILE
from fieldkit_sim.trial.layout import plots_of

_POINTS = 4000
"""On the plants of a plot, uniform by area."""
_COARSER = 4
"""Width of a depth map's pixel in the photograph's pixels."""
_BIAS_M = 0.03
"""Distance behind a depth map's surface up to which a point is on it, metres: pixels are about 1 cm wide."""


def seen_by_two(flight: Flight, names: Sequence[str]) -> dict[str, FloatArray]:
    """By plot, (n, 3) points of its plants, uniform by area, that at least two photographs see; frame of the scene."""
    description = read_scene(flight.folder / SCENE_FILE)
    assert description.plot.trial is not None
    scene = build(description)
    camera = _coarser(flight.survey.camera)
    surfaces = {
        plot.id: _surface(scene, plot.id, np.array([plot.lower_m, plot.upper_m]))
        for plot in plots_of(description.plot.trial)
        if plot.id in names
    }
    points = np.concatenate(list(surfaces.values()))
    views = np.zeros(len(points), dtype=np.int64)
    with Renderer(scene) as renderer:
        for pose in flight.true_poses().values():
            views += _seen(points, pose, camera, renderer)
    seen = np.split(views >= 2, np.cumsum([len(surface) for surface in surfaces.values()])[:-1])
    return {name: surface[mask] for (name, surface), mask in zip(surfaces.items(), seen, strict=True)}


def _surface(scene: Scene, plot: str, outline: FloatArray) -> FloatArray:
    """Points on a plot's own plants above its outline."""
    (mesh,) = (mesh for mesh in scene.plants if mesh.name == f"plot-{plot}")
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    points = np.asarray(trimesh.sample.sample_surface(solid, _POINTS, seed=0)[0])
    inside: FloatArray = points[((points[:, :2] > outline[0]) & (points[:, :2] < outline[1])).all(axis=1)]
    return inside


def _coarser(camera: Intrinsics) -> Intrinsics:
    width, height = camera.width // _COARSER, camera.height // _COARSER
    return Intrinsics.pinhole(width, height, camera.fx / _COARSER)


def _seen(points: FloatArray, pose: Pose, camera: Intrinsics, renderer: Renderer) -> BoolArray:
    local = (points - pose.center) @ pose.rotation.T
    pixels = camera.fx * local[:, :2] / local[:, 2:] + (camera.cx, camera.cy)
    inside = (local[:, 2] > 0.0) & (pixels >= 0.0).all(axis=1) & (pixels < (camera.width, camera.height)).all(axis=1)
    seen = np.zeros(len(points), dtype=bool)
    if inside.any():
        depth = renderer.depth(pose, camera)
        x, y = pixels[inside].astype(np.int64).T
        seen[inside] = local[inside, 2] < depth[y, x] + _BIAS_M
    return seen
