"""Simulated plots on slopes, and ways of putting cameras on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Pose
from fieldkit.planning.objective.simulated import Proxy, SimulatedSource
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.fields import vector
from fieldkit.results.frame import Plane
from fieldkit.scenes.description import SceneDescription, build, sample_reference
from fieldkit.scenes.scene import Mesh, Scene
from fieldkit.sites.terrain import LEVEL, Gradient

_LOWEST_M = 0.03  # as `Proxy` has it
_ROUGHNESS_M = _LOWEST_M / 3.0  # reconstruction leaves out three times this
_MARGIN_M = 0.03
_NEIGHBOUR, _FOOT_M = "neighbour-", 0.03


class SlopedSource(SimulatedSource):
    """Photographs of a plot whose ground is a plane; points less than 3 cm above it do not count as plants.

    Args:
        proxy: made by `sloped_proxy`.
        description: of its scene, for noise and camera effects.
        slope: of the ground.
    """

    def __init__(self, proxy: Proxy, description: SceneDescription, slope: Gradient) -> None:
        super().__init__(proxy, description.noise, effects=description.camera_effects)
        normal = np.array([-slope[0], -slope[1], 1.0])
        ground = Plane(vector(normal / np.linalg.norm(normal)), 0.0, _ROUGHNESS_M, 1.0, _LOWEST_M)
        self.plot = replace(self.plot, ground=ground)


def sloped_proxy(description: SceneDescription, slope: Gradient, level: Scene | None = None) -> Proxy:
    """A scene on a slope with its truth: each plant is moved upright as one piece, the ground is sheared."""
    scene = sloped(build(description) if level is None else level, slope)
    visible = sample_reference(description, scene)
    normal = np.array([-slope[0], -slope[1], 1.0])
    reference = visible.select(visible.points @ (normal / np.linalg.norm(normal)) > _LOWEST_M)
    return Proxy(scene, reference, Volume.around(reference.points, margin_m=_MARGIN_M), description.camera)


def sloped(scene: Scene, slope: Gradient) -> Scene:
    """The scene's meshes on a slope; the sky is unchanged."""
    if slope == LEVEL:
        return scene
    return replace(scene, meshes=tuple(_sloped_mesh(mesh, slope) for mesh in scene.meshes))


def _sloped_mesh(mesh: Mesh, slope: Gradient) -> Mesh:
    if mesh.normals is None or not len(mesh.vertices):
        return mesh
    vertices = mesh.vertices.astype(np.float64)
    standing = mesh.plant or mesh.name.startswith(_NEIGHBOUR)
    foot = vertices[vertices[:, 2] <= vertices[:, 2].min() + _FOOT_M, :2].mean(axis=0)
    vertices[:, 2] += (foot if standing else vertices[:, :2]) @ np.array(slope)
    if standing:
        return replace(mesh, vertices=vertices.astype(np.float32))
    normals = mesh.normals.astype(np.float64)
    normals[:, :2] -= normals[:, 2:] * np.array(slope)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(mesh, vertices=vertices.astype(np.float32), normals=normals.astype(np.float32))


def sheared(cameras: Cameras, slope: Gradient) -> Cameras:
    """Cameras on a slope as `export-mission` puts them: z and the optical axes are sheared upright."""
    moved = shifted(cameras, slope)
    yaw, pitch = np.radians(cameras.yaw_deg), np.radians(cameras.pitch_deg)
    ahead = np.sin(yaw) * slope[0] + np.cos(yaw) * slope[1]
    turned = np.degrees(np.arctan2(np.sin(pitch) + ahead * np.cos(pitch), np.cos(pitch)))
    return Cameras(moved.positions, cameras.yaw_deg, turned)


def shifted(cameras: Cameras, slope: Gradient) -> Cameras:
    """Cameras at their heights above the local ground, with the angles of the level plot."""
    positions = np.array(cameras.positions)
    positions[:, 2] += positions[:, :2] @ np.array(slope)
    return Cameras(positions, cameras.yaw_deg, cameras.pitch_deg)


def turned(cameras: Cameras, slope: Gradient) -> Cameras:
    """Cameras turned about the origin with the ground; the resulting roll is dropped."""
    steepness = float(np.hypot(*slope))
    if steepness == 0.0:
        return cameras
    angle = np.arctan(steepness)
    axis = np.array([slope[1], -slope[0], 0.0]) / steepness
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    poses = [Pose(p.rotation @ rotation.T, rotation @ p.center) for p in cameras.poses()]
    return Cameras.from_poses(poses)
