"""Similarity transforms (Sim3): scale, rotation, translation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray
from fieldkit.geometry.pose import Pose, cross_matrix

_TURNS = np.array([-cross_matrix(axis) for axis in np.eye(3)])


@dataclass(frozen=True, eq=False)
class Similarity:
    """x' = scale · rotation · x + translation."""

    scale: float
    """Positive, without unit (metres per model unit when it makes a model metric)."""
    rotation: FloatArray
    """(3, 3), determinant +1."""
    translation: FloatArray
    """(3,), in the target's unit."""

    def __post_init__(self) -> None:
        rotation = np.array(self.rotation, dtype=np.float64).reshape(3, 3)
        translation = np.array(self.translation, dtype=np.float64).reshape(3)
        rotation.setflags(write=False)
        translation.setflags(write=False)
        object.__setattr__(self, "scale", float(self.scale))
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @classmethod
    def identity(cls) -> Similarity:
        return cls(1.0, np.eye(3), np.zeros(3))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Similarity:
        """From a (3, 4) or (4, 4) matrix whose upper left block is a scaled rotation."""
        m = np.asarray(matrix, dtype=np.float64)
        determinant = float(np.linalg.det(m[:3, :3]))
        scale = float(np.cbrt(determinant))
        if scale <= 0 or not np.allclose(
            m[:3, :3] @ m[:3, :3].T, scale**2 * np.eye(3), rtol=1e-6, atol=1e-6 * scale**2
        ):
            raise ValueError("not a similarity: the upper left 3×3 block is not a rotation times a positive scale")
        return cls(scale, m[:3, :3] / scale, m[:3, 3])

    def matrix(self) -> FloatArray:
        """(4, 4) homogeneous matrix."""
        m = np.eye(4)
        m[:3, :3] = self.scale * self.rotation
        m[:3, 3] = self.translation
        return m

    def apply(self, points: ArrayLike) -> FloatArray:
        """Points (n, 3) or one point (3,), transformed."""
        return self.scale * (np.asarray(points, dtype=np.float64) @ self.rotation.T) + self.translation

    def apply_pose(self, pose: Pose) -> Pose:
        """The same camera in the target frame."""
        return Pose(pose.rotation @ self.rotation.T, self.apply(pose.center))

    def inverse(self) -> Similarity:
        rotation = self.rotation.T
        return Similarity(1.0 / self.scale, rotation, -(rotation @ self.translation) / self.scale)

    def after(self, first: Similarity) -> Similarity:
        """The transform that applies ``first`` and then this one."""
        return Similarity(self.scale * first.scale, self.rotation @ first.rotation, self.apply(first.translation))


def fit_similarity(source: ArrayLike, target: ArrayLike, *, weights: ArrayLike | None = None) -> Similarity:
    """Least-squares similarity from ``source`` (n, 3) to ``target`` (n, 3) (Umeyama 1991).

    ``weights`` (n,) are positive, of the squared errors; equal where None.
    """
    s, t = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if len(s) < 3 or s.shape != t.shape:
        raise ValueError("a similarity needs at least 3 pairs of points")
    share = np.full(len(s), 1.0) if weights is None else np.asarray(weights, dtype=np.float64)
    share = share / share.sum()
    s_mean, t_mean = share @ s, share @ t
    u, singular, vt = np.linalg.svd((t - t_mean).T @ ((s - s_mean) * share[:, None]))
    if singular[1] < 1e-9 * max(singular[0], 1e-300):
        raise ValueError("the points lie on one line, so the rotation about it is free")
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = u @ np.diag(signs) @ vt
    variance = float(share @ ((s - s_mean) ** 2).sum(axis=1))
    scale = float((singular * signs).sum() / variance)
    return Similarity(scale, rotation, t_mean - scale * rotation @ s_mean)


def similarity_motion(places: FloatArray) -> FloatArray:
    """(n, 3, 7) derivative of places (n, 3) by a small similarity about the origin: translation, rotation, scale."""
    turned = np.tensordot(places, _TURNS, 1)
    moves = [np.broadcast_to(np.eye(3), turned.shape), turned, np.asarray(places)[:, :, None]]
    motion: FloatArray = np.concatenate(moves, axis=2)
    return motion
