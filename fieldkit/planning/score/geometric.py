"""A geometric score of a set of cameras, without photographs: the expected distance from the plants' points to the
nearest reconstructed one, and how firmly the set is tied together by matches.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtrtrs
from scipy.spatial import cKDTree

from fieldkit.arrays import BoolArray, Float32Array, FloatArray, IntArray
from fieldkit.clouds.canopy import with_room_m
from fieldkit.geometry.similarity import similarity_motion
from fieldkit.planning.problem import POSE_NOISE_M, PlanningProblem
from fieldkit.planning.score.matchability import canopy_matches
from fieldkit.planning.score.visibility import POINTS, PerCamera, Surface, in_picture, look
from fieldkit.planning.space.cameras import Cameras, view_angles_deg
from fieldkit.planning.space.plots import Plot
from fieldkit.reconstruction.evidence import ERROR_PX, FINEST_M, quality_of_views, worth_of_angles
from fieldkit.runtime.kernels import fast_kernel, kernel
from fieldkit.vehicles.wash import swayed_m
from fieldkit.vocabulary import BY_CHANCE, CAP_M, FREE_RAD

_STEPS = 4096
"""Number of steps in the table of pairs' worth."""
_GRID = 3
"""Number of places of soil along each side of the plot."""
_AROUND_M = 0.3
"""Width of the soil about the plants, metres."""
_PICTURED = 6
"""Number of the plants' points that matches lie on."""
_OF_PLANTS = 0.1
"""Matches on plants as a share of those on as many points of soil seen squarely."""
SWAYING = 0.7
"""Sway of the highest leaves as a share of that half a metre out, and in proportion to the height below: over maize of
four scenes 0.36 to 0.48, root mean square."""
_TOLERANCE_PX = 6.0
"""Motion of a leaf between two views at which half of their matches fail: 2 ranks sets in wind worse, 4 to 20 about as
well (docs/decisions.md)."""
_AGREEING = 2
"""Least number of views with a right depth at a point."""
_NEIGHBORS = 24
"""Number of nearest points that can replace a missing one."""
_COLUMN_M = 0.10
"""Side of the columns of plants, metres."""
_CLOSED = 0.8
"""Share of the columns of the plot and of the soil about it with plants, or other rows, from which a canopy is closed:
plants that stand alone have half of it."""
_MISSED_M = 0.05
"""Distance by which flights miss their stations and people plants' heights, metres."""


_SQUARELY = 1600.0
"""Matches of two views at the same angle that show nothing but soil squarely from above. This and the decay are fitted
to the pairs of 40 sets about tuning-1 and tuning-2 in wind, at draft (docs/decisions.md)."""
_DECAY_DEG = 25.0
"""Angle between views at which 1/e of the matches is left, degrees: prior mapping matches soil as seen from above."""
_OCTAVES = 0.5
"""Standard deviation of the ratio of scales at which features match, octaves."""


class Geometry(NamedTuple):
    """The score of a set; small values are good. Its expected chamfer distance is ``gap_m`` + ``noise_m``."""

    gap_m: float
    """Expected distance from a point of the plants to the nearest reconstructed one, mean over points."""
    noise_m: float
    """Expected error of the reconstructed points, mean over them; the cap if there are none."""
    tie_m: float
    """Root mean square of the cameras' expected standard deviations (`camera_sigmas_m`)."""
    lost_room: float
    """Expected share of the room above the plants in which a higher leaf would not be reconstructed."""

    @property
    def terms_m(self) -> FloatArray:
        """(3,) gap, noise and tie."""
        return np.array(self[:3])


class _View(NamedTuple):
    """A camera's (p, 6) rays to points, qualities, pixel footprints in metres and variances of the points' sway, m²;
    and the same to points that nothing hides: those that matches lie on, and those of the room above the plants.
    """

    points: Float32Array
    free: Float32Array


class GeometricScore:
    """Scores sets of cameras about one plot. Each camera's view is computed once and kept.

    *Distance.* A camera's quality at a point is u = seen · incidence / (1 + (footprint / 8 mm)²); without normals
    incidence is 1. A pair succeeds there with s = worth of its angle · min(u, u'). A view's depth is right unless all
    its pairs fail, q = 1 − Π (1 − s). A point is reconstructed if at least two depths are right, with independent
    views. The distance of any other point from the cloud is that to its nearest reconstructed neighbour: Σ (d_k₊₁ −
    d_k) · Π (1 − p) over the neighbours sorted by distance, up to the cap. Another camera never raises it. The noise of
    reconstructed points is added, since accuracy is half of the objective: the root of the summed squares of
    triangulation's, (Σ s · sin²θ / (error · footprint)²)^−½ over a point's pairs, and of a pixel's footprint, root mean
    square over the views that see it, since dense stereo resolves nothing finer. A footprint is at least dense stereo's
    ground sampling distance.

    *Tie.* Matches fall with the angle between views, and the model of a set with weakly tied groups bends. From a
    recorded set's counted matches, else from those that prior mapping is expected to find, `camera_sigmas_m` says how
    firmly each camera is held. Soil counts as squarely as it is seen, plants a tenth, and less where they sway; in a
    closed canopy matches are those of `canopy_matches`. The root mean square counts, not the worst, since all cameras
    make the cloud.

    *Sway.* Leaves move between photographs by wind and by the vehicle's wash (`swayed_m`), the more the higher a point
    stands. Views whose points are σ apart, root mean square, match 1 + (σ / tolerance)² times less; a depth's error has
    σ beside the match's; and a reconstructed point lies the σ of its views from its place at rest.

    Not modelled: texture, specular light, motion blur, and the tilt of the whole cloud by noisy commands of few
    cameras close together.

    Args:
        plot: one of the problem's; the first one by default.
        points: largest number of points of the surface.
    """

    def __init__(self, problem: PlanningProblem, *, plot: Plot | None = None, points: int = POINTS) -> None:
        self.problem = problem
        self._plot = plot or problem.plots[0]
        self.surface = Surface.of(self._plot, points)
        around = _plot_points(problem, self.surface)
        self._matched, self._free = len(around), np.vstack([around, room_above(self._plot.reference.points)])
        self._soil = np.arange(len(self._free)) < _GRID**2
        self._found = np.where(self._soil, 1.0, _OF_PLANTS)[: self._matched]
        self._high, self._free_high = (
            SWAYING * np.clip(points[:, 2] / self._plot.height_m, 0.0, 1.0)
            for points in (self.surface.points, np.where(self._soil[:, None], 0.0, self._free))
        )
        self._canopy_m = self._plot.height_m if _is_closed(self._plot, *_soil(problem)) else None
        self._views = PerCamera(self._look)
        self._neighbours = _nearest(self.surface.points)

    def score(self, cameras: Cameras) -> Geometry:
        """The terms of a set of at least one camera, fitted to the plot; the cameras' order affects only rounding."""
        cameras = self._plot.fitted(cameras)
        views = self._views(cameras)
        p, noise = reconstructed([view.points for view in views])
        hidden = 1.0 - float(reconstructed([view.free[self._matched :] for view in views])[0].mean())
        matched = np.array([view.free[: self._matched] for view in views], dtype=np.float64)
        gap = float(_expected_distance(p, *self._neighbours, CAP_M).mean())
        total = float(p.sum())
        spread = float((p * noise).sum()) / total if total > 0 else CAP_M
        seen = matched[:, :, 3] * self._found
        matches = self.problem.counted_matches(cameras, self._plot)
        if matches is None:
            both = seen if self._canopy_m is None else (matched[:, :, 3] > 0.0).astype(np.float64)
            shared = both @ both.T / self._matched
            matches = expected_matches(cameras.positions, self.problem.center, shared, self._canopy_m)
        variance = (ERROR_PX * matched[:, :, 4]) ** 2 + matched[:, :, 5]
        points, prior_m = self._free[: self._matched], max(self.problem.noise.pose_m, POSE_NOISE_M)
        sigmas = camera_sigmas_m(cameras.positions, points, seen, variance, matches, prior_m)
        tie = float(np.sqrt((sigmas**2).mean()))
        return Geometry(gap, spread, tie, hidden)

    def _look(self, cameras: Cameras) -> list[_View]:
        camera, air = self.problem.camera, self.problem.noise.outdoors
        rays = cameras.positions[:, None] - self._free
        away = np.linalg.norm(rays, axis=2)
        rays /= np.maximum(away, 1e-9)[:, :, None]
        facing = np.where(self._soil, rays[:, :, 2], 1.0)

        def sights(
            rays: FloatArray, away_m: FloatArray, seen: BoolArray, facing: FloatArray, high: FloatArray
        ) -> Float32Array:
            below_m = away_m * np.maximum(rays[:, 2], 0.0)
            footprint = np.maximum(away_m / camera.fx, FINEST_M)
            quality = quality_of_views(seen, facing, footprint)
            sway = (high * swayed_m(air.wind_m, away_m, air.vehicle_kg, below_m)) ** 2
            return np.column_stack([rays, quality, footprint, sway]).astype(np.float32)

        return [
            _View(
                sights(sight.rays, sight.distance_m, sight.seen, sight.facing, self._high),
                sights(to_free, free_m, shown, squarely, self._free_high),
            )
            for sight, to_free, free_m, shown, squarely in zip(
                look(self.surface, cameras, camera),
                rays,
                away,
                in_picture(self._free, cameras, camera),
                facing,
                strict=True,
            )
        ]


def reconstructed(sights: Sequence[Float32Array]) -> tuple[FloatArray, FloatArray]:
    """(p,) probability that at least two views' depths are right, and (p,) their noise, metres, at most the cap.

    Args:
        sights: of each view (p, 6): rays from the points to it, quality, footprint in metres, variance of sway in m².
    """
    found: tuple[FloatArray, FloatArray] = _reconstructed(
        np.stack(sights), ERROR_PX, _TOLERANCE_PX, _pair_worth(), _AGREEING, CAP_M
    )
    return found


def expected_distance_m(points: FloatArray, p: FloatArray) -> FloatArray:
    """(p,) from each point (p, 3) to the nearest reconstructed one, which each is with probability ``p``."""
    distances: FloatArray = _expected_distance(p, *_nearest(points), CAP_M)
    return distances


def _nearest(points: FloatArray) -> tuple[IntArray, FloatArray]:
    """(p, n) indices of the nearest points, and their distances up to the cap."""
    count = min(_NEIGHBORS, len(points))
    distance, index = cKDTree(points).query(points, k=count)
    neighbours = np.asarray(index, dtype=np.int64).reshape(len(points), count)
    return neighbours, np.minimum(np.asarray(distance).reshape(len(points), count), CAP_M)


@cache
def _pair_worth() -> FloatArray:
    """The worth of a pair by the sine of half its angle, in steps from 0 to 1 and one beyond."""
    worth = worth_of_angles(np.degrees(2.0 * np.arcsin(np.linspace(0.0, 1.0, _STEPS + 1))))
    return np.append(worth, worth[-1])


def _plot_points(problem: PlanningProblem, surface: Surface) -> FloatArray:
    """(t, 3) points of the ground up to 0.3 m beyond the plants, then points of these: what matches lie on."""
    low, high = _soil(problem)
    places = low + (np.arange(_GRID)[:, None] + 0.5) / _GRID * (high - low)
    ground = np.stack([*np.meshgrid(*places.T, indexing="ij"), np.zeros((_GRID, _GRID))], axis=-1).reshape(-1, 3)
    every = max(1, len(surface) // _PICTURED)
    return np.vstack([ground, surface.points[::every]])


def _soil(problem: PlanningProblem) -> tuple[FloatArray, FloatArray]:
    """Corners (2,) of the soil up to 0.3 m beyond the plants."""
    target = problem.envelope.target
    return np.array(target.lower[:2]) - _AROUND_M, np.array(target.upper[:2]) + _AROUND_M


def _is_closed(plot: Plot, low: FloatArray, high: FloatArray) -> bool:
    """Whether plants, of this plot or others, stand nearly everywhere between two corners (2,)."""
    places = np.floor((plot.points[:, :2] - low) / _COLUMN_M)
    steps = np.ceil((high - low) / _COLUMN_M)
    columns = np.unique(places[((places >= 0.0) & (places < steps)).all(axis=1)], axis=0)
    return bool(len(columns) >= _CLOSED * steps.prod())


def room_above(plants: FloatArray) -> FloatArray:
    """(r, 3) points above columns of 10 cm in which plants (n, 3) stand: up to there pictures show a higher leaf even
    where a flight misses its stations.
    """
    columns: FloatArray = (np.unique(np.floor(plants[:, :2] / _COLUMN_M), axis=0) + 0.5) * _COLUMN_M
    return np.column_stack([columns, np.full(len(columns), with_room_m(float(plants[:, 2].max())) + _MISSED_M)])


@fast_kernel
def _reconstructed(sights, error, tolerance, worth, least, cap):  # type: ignore[no-untyped-def]
    """(p,) probability that at least ``least`` views' depths are right, and (p,) the points' noise in metres, at most
    the cap. Takes n views of the points (n, p, 6), as in `_View`, and a match's error and tolerance in pixels.
    """
    count, points = sights.shape[:2]
    found, noise = np.zeros(points), np.full(points, cap)
    fails, at = np.empty(count), np.empty((count, 6))
    exactly = np.empty(least)
    steps = len(worth) - 2
    for k in range(points):
        views = 0
        for i in range(count):
            if sights[i, k, 3] > 0.0:
                at[views] = sights[i, k]
                fails[views] = 1.0
                views += 1
        if views < least:
            continue
        information, squares = 0.0, 0.0
        for a in range(views):
            x, y, z, quality, footprint, sway = at[a]
            squares += footprint**2 + sway
            for b in range(a + 1, views):
                cosine = x * at[b, 0] + y * at[b, 1] + z * at[b, 2]
                place = steps * np.sqrt(min(1.0, max(0.0, 0.5 - 0.5 * cosine)))
                step = int(place)
                success = worth[step] + (place - step) * (worth[step + 1] - worth[step])
                moved, area = sway + at[b, 5], footprint * at[b, 4]
                success *= min(quality, at[b, 3]) / (1.0 + moved / (tolerance**2 * area))
                fails[a] *= 1.0 - success
                fails[b] *= 1.0 - success
                information += success * (1.0 - cosine * cosine) / (error**2 * area + moved)
        information += cap**-2
        # Probabilities of exactly 0, 1, … right depths, updated view by view.
        exactly[:] = 0.0
        exactly[0] = 1.0
        for a in range(views):
            for m in range(least - 1, 0, -1):
                exactly[m] = exactly[m] * fails[a] + exactly[m - 1] * (1.0 - fails[a])
            exactly[0] *= fails[a]
        found[k] = max(0.0, 1.0 - exactly.sum())
        noise[k] = min(cap, np.sqrt(1.0 / information + squares / views))
    return found, noise


@kernel
def _expected_distance(p, neighbors, distances, cap):  # type: ignore[no-untyped-def]
    """(p,) metres to the nearest reconstructed point; the first neighbour of a point is itself."""
    expected = np.zeros(len(p))
    for i in range(len(p)):
        missing = 1.0
        last = neighbors.shape[1] - 1
        for k in range(last + 1):
            missing *= 1.0 - p[neighbors[i, k]]
            until = distances[i, k + 1] if k < last else cap
            expected[i] += missing * (until - distances[i, k])
    return expected


def expected_matches(
    positions: FloatArray, center: FloatArray, shared: FloatArray, canopy_m: float | None = None
) -> FloatArray:
    """(n, n) expected matches of each pair of views, symmetric, 0 on the diagonal.

    Matches at the pair's angle about the plot, times what their pictures share, times exp(−½ (o / 0.5)²) for o octaves
    between their distances: mapping takes no match beyond 0.75 (docs/mapping.md). ``shared`` (n, n) is the share that
    each pair's pictures have in common, ``canopy_m`` the height of a closed canopy.
    """
    octave = np.log2(np.maximum(np.linalg.norm(positions - center, axis=1), 1e-9))
    scale = np.exp(-0.5 * ((octave[:, None] - octave[None]) / _OCTAVES) ** 2)
    angles = view_angles_deg(positions, center)
    alike = _SQUARELY * np.exp(-angles / _DECAY_DEG) if canopy_m is None else canopy_matches(angles, 1.0, canopy_m)
    matches: FloatArray = alike * shared * scale
    np.fill_diagonal(matches, 0.0)
    return matches


def camera_sigmas_m(
    positions: FloatArray,
    points: FloatArray,
    seen: FloatArray,
    variance: FloatArray,
    matches: FloatArray,
    prior_m: float,
) -> FloatArray:
    """(n,) standard deviation of each camera's centre against the others that prior mapping is expected to leave.

    It foretells `reconstruction.mapping.uncertainty`. A pair's matches lie on points that both views show, and say how
    far apart the two rays pass. Centres are known with ``prior_m``, rotations are free. The similarity that all centres
    have in common is the frame's and is taken off.

    Args:
        points: (t, 3) of the plot.
        seen: (n, t) how well each view shows them.
        variance: (n, t) of a ray beside a point, m².
        matches: (n, n) of pairs; those that a wrong relative pose has by chance, too, say nothing.
    """
    count, arms = 3 * len(positions), points - positions[:, None]
    shared = np.maximum(matches - BY_CHANCE, 0.0) / np.maximum(seen @ seen.T, 1e-12)
    each = shared[:, :, None] * seen[:, None] * seen
    normal = _information(arms, each / (variance[:, None] + variance)).reshape(2 * count, 2 * count)
    normal.flat[:: 2 * count + 1] += np.repeat([FREE_RAD**-2, prior_m**-2], count)
    # Rotations come first: of Cholesky's factor the centres' block is that of the centres' own information.
    half = np.linalg.cholesky(normal)[count:, count:]
    motion = similarity_motion(positions - positions.mean(axis=0)).swapaxes(0, 1).reshape(-1, 7)
    own = np.eye(count) - motion @ np.linalg.solve(motion.T @ motion + 1e-9 * np.eye(7), motion.T)
    sigmas: FloatArray = np.sqrt((dtrtrs(half, own, lower=True)[0] ** 2).sum(axis=0).reshape(3, -1).sum(axis=0))
    return sigmas


@fast_kernel
def _information(arms, weight):  # type: ignore[no-untyped-def]
    """(6, n, 6, n) information of cameras' rotations, radians, and centres from how far apart rays pass.

    Takes the arms (n, t, 3) from cameras to points, and what each pair's rays weigh there (n, n, t), 1/m².
    """
    count, points = arms.shape[:2]
    found, rows = np.zeros((6, count, 6, count)), np.empty((2, 6, points))
    for i in range(count):
        for j in range(i):
            for k in range(points):
                (ax, ay, az), (bx, by, bz) = arms[i, k], arms[j, k]
                x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
                size = np.sqrt(weight[i, j, k] / max(x * x + y * y + z * z, 1e-18))
                x, y, z = size * x, size * y, size * z
                one, other = rows[0, :, k], rows[1, :, k]
                one[0], one[1], one[2] = ay * z - az * y, az * x - ax * z, ax * y - ay * x
                other[0], other[1], other[2] = bz * y - by * z, bx * z - bz * x, by * x - bx * y
                one[3], one[4], one[5], other[3], other[4], other[5] = x, y, z, -x, -y, -z
            for a in range(6):
                for b in range(6):
                    first, second, both = 0.0, 0.0, 0.0
                    for k in range(points):
                        first += rows[0, a, k] * rows[0, b, k]
                        second += rows[1, a, k] * rows[1, b, k]
                        both += rows[0, a, k] * rows[1, b, k]
                    found[a, i, b, i] += first
                    found[a, j, b, j] += second
                    found[a, i, b, j] = found[b, j, a, i] = both
    return found
