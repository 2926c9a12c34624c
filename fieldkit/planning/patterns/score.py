"""What a pattern is expected to be worth over a canopy, without photographs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.evaluation.flight import MOST_VIEWS
from fieldkit.evaluation.traits import LEAST_PHOTOGRAPHS
from fieldkit.geometry import Intrinsics
from fieldkit.planning.patterns.block import Block
from fieldkit.planning.patterns.photographs import plot_volume, poses_about, showing
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.planning.score.geometric import SWAYING, expected_distance_m, reconstructed
from fieldkit.reconstruction.evidence import FINEST_M, quality_of_views
from fieldkit.results.pattern import Pattern
from fieldkit.scenes.sampling import visible_from
from fieldkit.vehicles.wash import swayed_m
from fieldkit.vocabulary import CAP_M

_POINTS = 1000
"""Points of the plot's surface that are looked at."""
_DIRECTIONS = 250
"""Number of directions from which it is known what is hidden, some 6° apart."""
_FARTHEST_DEG = 65.0
"""Angle from the vertical of the lowest of them."""
_PIXELS = 800
"""Side of the depth maps that tell what is hidden, pixels of some 6 mm."""
_BIAS_M = 0.01
"""How far in front of a point something must be to hide it, metres."""
PHASES = ((0.0, 0.0), (0.5, 0.5))
"""Where lines lie beside a plot, in shares of their spacings: which plots have which is chance."""


WEIGHTS = (0.07, 4.0, 0.0)
"""Of gap, noise and ties in the objective's value, to which what no photograph shows adds as much for all patterns of a
stage: fitted on 15 evaluations at V6, V10 and V14, from 8 to 14 m (docs/benchmarks.md). Points miss by more than in
sets from near."""


class Expectation(NamedTuple):
    """Of a pattern, mean over where its lines lie."""

    gap_m: float
    """Distance from a point of the plants' surface to the nearest reconstructed one."""
    noise_m: float
    """Error of reconstructed points."""


_NOTHING = Expectation(CAP_M, CAP_M)
"""Of a pattern by whose few photographs traits are refused."""


@dataclass(frozen=True, eq=False)
class PatternScore:
    """Which points of a plot's surface, among its neighbours, are seen from where; looked at once for all patterns.

    Photographs are taken from so far above that rays to a place are parallel, nearly.
    """

    block: Block
    points: FloatArray
    normals: FloatArray
    directions: cKDTree
    seen: BoolArray
    """(p, d) whether a point is seen from a direction."""

    @classmethod
    def of(cls, block: Block) -> PatternScore:
        """Of a block; some 10 CPU s."""
        assert block.reference.normals is not None
        drawn = np.random.default_rng(0).permutation(len(block.reference))[:_POINTS]
        points, normals = block.reference.points[drawn], block.reference.normals[drawn].astype(np.float64)
        # Spread evenly over a cap of the sphere.
        k = np.arange(_DIRECTIONS) + 0.5
        up = 1.0 - k / _DIRECTIONS * (1.0 - np.cos(np.radians(_FARTHEST_DEG)))
        turn = k * np.pi * (3.0 - np.sqrt(5.0))
        level = np.sqrt(1.0 - up**2)
        directions = np.column_stack([level * np.cos(turn), level * np.sin(turn), up])
        middle = block.triangles.reshape(-1, 3).mean(axis=0)
        triangles, centred = block.triangles - middle, points - middle
        radius_m = float(np.linalg.norm(triangles.reshape(-1, 3), axis=1).max())
        seen = np.empty((len(points), _DIRECTIONS), dtype=np.bool_)
        for number, direction in enumerate(directions):
            open_ = visible_from(centred, triangles, direction, radius_m, pixels=_PIXELS, bias_m=_BIAS_M)
            seen[:, number] = open_ > 0.5
        return cls(block, points, normals, cKDTree(directions), seen)

    def expect(self, pattern: Pattern, camera: Intrinsics, noise: NoiseSettings) -> Expectation:
        """What a pattern is worth, by the terms of the geometric score for views that neighbours hide."""
        found = [self._of_phase(pattern, camera, noise, phase) for phase in PHASES]
        return Expectation(*np.mean(found, axis=0).tolist())

    def _of_phase(
        self, pattern: Pattern, camera: Intrinsics, noise: NoiseSettings, phase: tuple[float, float]
    ) -> Expectation:
        poses = poses_about(pattern, self.block, camera, phase)
        sights = []
        for pose in showing(poses, camera, plot_volume(self.block), MOST_VIEWS):
            rays = pose.center - self.points
            away = np.linalg.norm(rays, axis=1)
            rays /= away[:, None]
            seen = (
                camera.sees(pose.to_camera(self.points))
                & self.seen[np.arange(len(rays)), self.directions.query(rays)[1]]
            )
            footprint = np.maximum(away / camera.fx, FINEST_M)
            quality = quality_of_views(seen, np.abs((self.normals * rays).sum(axis=1)), footprint)
            air_m = swayed_m(noise.wind_m, away, noise.vehicle_kg, away * rays[:, 2])
            sway = (SWAYING * np.clip(self.points[:, 2] / self.block.height_m, 0.0, 1.0) * air_m) ** 2
            sights.append(np.column_stack([rays, quality, footprint, sway]).astype(np.float32))
        if len(sights) < LEAST_PHOTOGRAPHS:
            return _NOTHING
        p, error = reconstructed(sights)
        gap_m = float(expected_distance_m(self.points, p).mean())
        noise_m = float((p * error).sum() / max(p.sum(), 1e-9))
        return Expectation(gap_m, noise_m)
