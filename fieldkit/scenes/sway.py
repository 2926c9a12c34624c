"""Leaves in the wind: where a scene's plants are at the moment of a photograph."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.scene import Mesh, Scene
from fieldkit.scenes.simulate import Sway

REFERENCE_M = 0.5
"""Distance from the collar at which a leaf moves by the strength."""

_CORRELATION_M = 0.20  # of the gusts, by eye: a leaf bends as one, its neighbour differently
_POWER = 1.6  # of the deflection along a leaf; a cantilever of even stiffness has 2 near its foot and 1 at its end
_RMS = 0.40  # of one octave of the noise, so that strengths are root mean squares


def sway(scene: Scene, strength_m: float, seed: int) -> dict[str, NDArray[np.float32]]:
    """Vertices (n, 3) of every mesh that wind moves, by name, for `Renderer.move`; the same seed gives the same moment.

    Each leaf bends away from where the scene has it by a random field that is smooth in space; nothing is moved at the
    collars, and stems stand still. A plant without known leaves bends as a whole above its foot. Normals and baked
    light stay as they are, which is right to first order for some centimetres.

    Args:
        scene: at rest.
        strength_m: root mean square of the sideways motion, per axis, `REFERENCE_M` out along a leaf. 0.005 is a calm,
            0.02 a breeze in which photographs of leaves no longer agree.
        seed: of the moment; give each photograph its own.
    """
    if not strength_m >= 0:
        raise ValueError(f"the wind's strength is at least 0, not {strength_m}")
    if strength_m == 0:
        return {}
    return {
        mesh.name: _bent(mesh, strength_m, seed)
        for mesh in scene.meshes
        if (mesh.plant or mesh.flex_m is not None) and len(mesh.vertices)
    }


def _bent(mesh: Mesh, strength_m: float, seed: int) -> NDArray[np.float32]:
    points = mesh.vertices.astype(np.float64)
    flex = _flex(mesh, points)
    moving = np.flatnonzero(flex > 1e-4)
    p, reach = points[moving], flex[moving]
    # A plane that is oblique to all axes, so that height counts as well.
    u, v = (p[:, 0] + 0.47 * p[:, 2]) / _CORRELATION_M, (p[:, 1] - 0.61 * p[:, 2]) / _CORRELATION_M
    base = 3 * (seed % 1_000_003)
    field = np.stack([fractal_noise(u, v, base + axis, octaves=1) for axis in range(3)], axis=1).astype(np.float64)
    shift = strength_m / _RMS * ((reach / REFERENCE_M) ** _POWER)[:, None] * field * (1.0, 1.0, 0.5)
    # A leaf does not stretch: what goes sideways is lost outwards, here taken from the height.
    shift[:, 2] -= (shift[:, :2] ** 2).sum(axis=1) / (2.0 * np.maximum(reach, 0.02))
    points[moving] += shift
    return points.astype(np.float32)


def _flex(mesh: Mesh, points: NDArray[np.float64]) -> NDArray[np.float64]:
    if mesh.flex_m is not None:
        return mesh.flex_m.astype(np.float64)
    # A plant that came as a mesh: it stands on its lowest point and bends with the distance from there.
    foot = points[points[:, 2] <= np.quantile(points[:, 2], 0.02)].mean(axis=0)
    return np.asarray(np.linalg.norm(points - foot, axis=1))


def wind_sway(strength_m: float, seed: int) -> Sway | None:
    """Leaves bent by wind, another moment in each photograph (see `fieldkit.scenes.sway`); None where it is calm."""
    if strength_m == 0:
        return None

    def moved(scene: Scene, photograph: int) -> Mapping[str, NDArray[np.float32]]:
        moment = int(np.random.default_rng([seed, 4, photograph]).integers(1 << 30))
        return sway(scene, strength_m, moment)

    return moved
