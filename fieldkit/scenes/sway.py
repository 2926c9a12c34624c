"""Leaves in the wind and in a vehicle's wash: where a scene's plants are at a moment."""

from __future__ import annotations

from dataclasses import dataclass
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fieldkit.arrays import Float32Array, FloatArray
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.scene import Mesh, Scene
from fieldkit.vehicles.wash import swayed_m

REFERENCE_M = 0.5
"""Distance from the collar at which a leaf moves by the strength."""

GUST_SHARE = 0.4
"""Of the variance; the rest is swing. An oscillator of 1 to 2 Hz with a tenth of critical damping, in turbulence whose
spectrum peaks at 0.1 Hz, has 38 to 43 % of its variance below 0.2 Hz (16 to 57 % for peaks at 0.25 to 0.05 Hz): an
estimate. What a vehicle's wash moves has the same share, for leaves are also held aside while it stays."""

_GUST_M = 5.0
"""Length L of gusts, whose correlation falls as exp(−r² / 2 L²), metres: 0.92 after 1 s, 0.28 after 4 s."""
_WIND_MPS = 2.0
"""Speed at which the wind carries gusts along, metres a second."""
_WAVES = 32  # of which the gusts are made
_OWN_HZ = (1.12, 2.70)  # of a leaf: 1 to 3 Hz with its tones
_TONES = 3
"""Number of tones of a leaf's swing, which so swells and fades within seconds, as a damped one does under
turbulence."""
_DETUNED = 0.10
"""Largest deviation of a tone from the leaf's own frequency, as a share."""
_LAG_RAD_M = 2.0  # a leaf's tip comes after its middle
_TURNED_RAD = 1.0  # at most, of a leaf's answer to a gust against its neighbour's
_PLACES_M = 0.20
"""Length over which phases change where leaves are not known, metres. By eye."""
_PLACES_RAD = 4.0
"""Range of these phases, radians. By eye."""
_POWER = 1.6  # of the deflection along a leaf; a cantilever of even stiffness has 2 near its foot and 1 at its end
_UPWARDS = 0.5  # of the sideways motion


class Motion:
    """The motion of a scene's plants, a function of time that only the scene and a seed decide.

    Each leaf swings at its own 1 to 3 Hz about where gusts hold it; neighbours share the gusts and swing apart. A leaf
    bends as one, its tip later; it does not stretch. Collars and stems stand still. A plant without known leaves bends
    above its foot as a whole. Normals and baked light stay as they are, right to first order for some centimetres.
    """

    def __init__(self, scene: Scene, seed: int) -> None:
        bending = (m for m in scene.meshes if (m.plant or m.flex_m is not None) and len(m.vertices))
        self._meshes = [_Bending.of(mesh, seed) for mesh in bending]
        rng = np.random.default_rng([seed, 4])
        self._waves = rng.normal(size=(2, _WAVES)) / _GUST_M
        self._phases = rng.uniform(0, 2 * np.pi, (_WAVES, 3))
        heading = rng.uniform(0, 2 * np.pi)
        self._wind = _WIND_MPS * np.array([np.cos(heading), np.sin(heading)])

    def at(
        self, time_s: float, wind_m: float, vehicle_kg: float = 0.0, camera: ArrayLike = (0.0, 0.0, 0.0)
    ) -> dict[str, Float32Array]:
        """Vertices (n, 3) of every mesh that moves, by name, for `Renderer.move`.

        Args:
            time_s: of the moment.
            wind_m: root mean square of the sideways motion, per axis, `REFERENCE_M` out along a leaf. 0.005 is a calm,
                0.02 a breeze in which photographs of leaves no longer agree.
            vehicle_kg: mass of a vehicle whose wash adds in quadrature, by each vertex's distance from ``camera`` (3,).
        """
        if not wind_m >= 0:
            raise ValueError(f"the wind's strength is at least 0, not {wind_m}")
        if wind_m == 0 and not vehicle_kg:
            return {}
        vehicle = (vehicle_kg, np.asarray(camera, np.float64)) if vehicle_kg else None
        return {m.mesh.name: m.at(time_s, self._gust(m.feet, time_s), wind_m, vehicle) for m in self._meshes}

    def _gust(self, places: FloatArray, time_s: float) -> FloatArray:
        """(n, 3) the gusts at places (n, 2), of unit variance per axis."""
        angle = (places - self._wind * time_s) @ self._waves
        waves = np.cos(angle) @ np.cos(self._phases) - np.sin(angle) @ np.sin(self._phases)
        return np.asarray(np.sqrt(2.0 / _WAVES) * waves)


@dataclass(frozen=True, eq=False)
class _Bending:
    """What of a mesh moves, and how."""

    mesh: Mesh
    moving: NDArray[np.intp]  # (n,) its vertices away from where they are fixed
    rest: FloatArray  # (n, 3) where they are in still air
    reach: FloatArray  # (n, 1) distance along the leaf, metres
    leaf: NDArray[np.intp]  # (n,) number of each vertex's leaf
    lag: NDArray[np.complex128]  # (n, 1) of unit length, by which a vertex comes after its leaf's foot
    feet: FloatArray  # (leaves, 2) where the leaves are
    turned: NDArray[np.complex128]  # (leaves,) of unit length, by which a leaf's answer to a gust is turned
    tones: FloatArray  # (leaves, tones, 1) angular frequencies
    starts: FloatArray  # (leaves, tones, 3) phases by axis

    @classmethod
    def of(cls, mesh: Mesh, seed: int) -> _Bending:
        """How a mesh bends; the same for the same name, form and seed, whatever else is in the scene."""
        points = mesh.vertices.astype(np.float64)
        flex = _above_foot(points) if mesh.flex_m is None else mesh.flex_m.astype(np.float64)
        moving = np.flatnonzero(flex > 1e-4)
        rest, reach = points[moving], flex[moving]
        rng = np.random.default_rng([seed, 4, crc32(mesh.name.encode())])
        if mesh.flex_m is None:
            leaf, leaves = np.zeros(len(moving), np.intp), 1
            tones = rng.uniform(*_OWN_HZ, (1, _TONES))
            # A plane that is oblique to all axes, so that height counts as well.
            u, v = (rest[:, 0] + 0.47 * rest[:, 2]) / _PLACES_M, (rest[:, 1] - 0.61 * rest[:, 2]) / _PLACES_M
            lag = _PLACES_RAD * fractal_noise(u, v, int(rng.integers(1 << 20)), octaves=1).astype(np.float64)
        else:
            numbers, leaf = np.unique(_leaves(mesh)[moving], return_inverse=True)
            leaves = len(numbers)
            tones = rng.uniform(*_OWN_HZ, (leaves, 1)) * rng.uniform(1 - _DETUNED, 1 + _DETUNED, (leaves, _TONES))
            lag = _LAG_RAD_M * reach
        turned = np.exp(1j * rng.uniform(-_TURNED_RAD, _TURNED_RAD, leaves))
        count = np.maximum(np.bincount(leaf, minlength=leaves), 1)
        feet = np.stack([np.bincount(leaf, rest[:, axis], leaves) / count for axis in range(2)], axis=1)
        return cls(
            mesh,
            moving,
            rest,
            reach[:, None],
            leaf,
            np.exp(-1j * lag)[:, None],
            feet,
            turned,
            2 * np.pi * tones[..., None],
            rng.uniform(0, 2 * np.pi, (leaves, _TONES, 3)),
        )

    def at(
        self, time_s: float, gust: FloatArray, wind_m: float, vehicle: tuple[float, FloatArray] | None
    ) -> Float32Array:
        """The mesh's vertices (v, 3) at a moment; the gust (leaves, 3) of unit variance."""
        sideways = self.turned * (gust[:, 0] + 1j * gust[:, 1])
        gust = np.column_stack([sideways.real, sideways.imag, gust[:, 2]])
        swing = np.sqrt(2.0 / _TONES) * np.exp(1j * (self.tones * time_s + self.starts)).sum(axis=1)
        strength: float | FloatArray = wind_m
        if vehicle is not None:
            away = self.rest - vehicle[1]
            distance = np.linalg.norm(away, axis=1, keepdims=True)
            strength = swayed_m(wind_m, distance, vehicle[0], -away[:, 2:])
        shift = np.sqrt(1 - GUST_SHARE) * (self.lag * swing[self.leaf]).real + np.sqrt(GUST_SHARE) * gust[self.leaf]
        shift *= strength * (self.reach / REFERENCE_M) ** _POWER
        shift[:, 2] *= _UPWARDS
        # A leaf does not stretch: what goes sideways, its length at most, is lost outwards, here taken from the height.
        reach = np.maximum(self.reach, 0.02)
        shift /= np.sqrt(1.0 + (shift**2).sum(axis=1, keepdims=True) / reach**2)
        shift[:, 2] -= (shift[:, :2] ** 2).sum(axis=1) / (2.0 * reach[:, 0])
        vertices = self.mesh.vertices.copy()
        vertices[self.moving] = self.rest + shift
        return vertices


def _above_foot(points: FloatArray) -> FloatArray:
    """(n,) distance from the lowest points, on which a plant without known leaves stands."""
    foot = points[points[:, 2] <= np.quantile(points[:, 2], 0.02)].mean(axis=0)
    return np.asarray(np.linalg.norm(points - foot, axis=1))


def _leaves(mesh: Mesh) -> NDArray[np.intp]:
    """(n,) a number for each vertex's leaf: leaves hang together and hold no vertex with the stem or each other."""
    n = len(mesh.vertices)
    one, other = mesh.faces[:, (0, 1)].ravel(), mesh.faces[:, (1, 2)].ravel()
    linked = coo_array((np.ones(len(one), bool), (one, other)), (n, n))
    return np.asarray(connected_components(linked, directed=False)[1], np.intp)
