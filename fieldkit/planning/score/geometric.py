"""A geometric score: how near every point of the plants a set of cameras should leave a reconstructed one, and how
firmly the set hangs together, without taking a photograph.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.score.matchability import Matchability, expected_matches, looseness_m
from fieldkit.planning.score.visibility import POINTS, PerCamera, Surface, in_picture, look
from fieldkit.planning.space.cameras import Array, Cameras
from fieldkit.planning.space.plots import Plot
from fieldkit.reconstruction.stereo_quality import StereoQuality
from fieldkit.runtime.kernels import fast_kernel, kernel

_STEPS = 4096
_GRID = 12
_AROUND_M = 0.3
_PICTURED = 150


@dataclass(frozen=True)
class ScoreSettings(StereoQuality):
    """Every constant of `GeometricScore`: those of `StereoQuality` and how views are counted.

    On 20 random sets about each of tuning-1, 2 and 3, which had no part in the choice of how the former enter, the
    distance had Spearman correlations of 0.69, 0.81 and 0.76 with draft values (0.75, 0.68 and 0.62 with fine).
    Footprints in the noise and a visibility in which stems hide their far sides came later: 0.93 and 0.66 with the
    standard values of the 100 and 47 sets of two searches about tuning-1 and tuning-2, where it had 0.83 and 0.62
    before the latter.

    Attributes:
        agreeing: views whose depths must be right at a point.
        neighbors: nearest points that stand in for one that is missing.
    """

    agreeing: int = 2
    neighbors: int = 24


@dataclass(frozen=True, eq=False)
class Geometry:
    """The score of a set; small distances are good.

    Attributes:
        distance_m: ``gap_m`` + ``noise_m``, for a chamfer distance is completeness + accuracy.
        tie_m: root of the cameras' mean squared looseness (`looseness_m`).
        gap_m: expected distance from a point of the plants to the nearest reconstructed one, mean over points.
        noise_m: by how much reconstructed points are expected to be off, mean over those; the cap where there are
            none.
        covered: expected share of the points that are reconstructed themselves.
        loose_m: (n,) looseness of each camera.
        matches: (n, n) of each pair: counted where the problem knows them, else to be expected.
    """

    distance_m: float
    tie_m: float
    gap_m: float
    noise_m: float
    covered: float
    loose_m: Array
    matches: Array


class _View(NamedTuple):
    """What is kept of a camera: (p, 5) a point's ray, quality and a pixel's footprint there, metres; and which of some
    points of the plot are in its picture.
    """

    points: NDArray[np.float32]
    pictured: NDArray[np.bool_]


class GeometricScore:
    """Scores sets of cameras about one plot; each camera's view is computed once and kept.

    *Distance.* A camera's quality at a point is u = seen · incidence / (1 + (footprint / 8 mm)²); without normals
    incidence is left out. A pair succeeds there with s = worth of its angle · min(u, u'). A view's depth is right
    unless all its pairs fail, q = 1 − Π (1 − s); a point is reconstructed where at least two depths are right, views
    counted as independent. A point that is not is as far from the cloud as the nearest of its neighbours that is:
    Σ (d_k₊₁ − d_k) · Π (1 − p) over the neighbours sorted by distance, up to the cap. This is the score that ranked the
    designs of a prototype (Spearman 0.82); counting visible points did not (0.10). Another camera never raises it. To
    it comes the noise of reconstructed points, for accuracy is half of the objective: the root of the summed squares
    of triangulation's, (Σ s · sin²θ / (error · footprint)²)^−½ over a point's pairs, and of a pixel's footprint, root
    mean square over the views that see it, for dense stereo tells nothing finer.

    *Tie.* Real plants lose matches with the angle between views, and a set that falls into groups which few matches tie
    together bends. The matches that a recorded set counted, else `expected_matches`, make a graph of the views, and
    `looseness_m` says how far they move against each
    other in it; the root of the mean square is taken, not the worst, for the cloud is made by all cameras.

    Not modelled: texture, specular light, wind, motion blur, and that few cameras close together, held by commands with
    noise, tilt the whole cloud.

    Args:
        problem: what is planned.
        matchability: of the plot's kind of plants and soil, for matches that are not counted.
        settings: constants.
        plot: of the problem's; the first one by default.
        points: of the surface, at most.
    """

    def __init__(
        self,
        problem: PlanningProblem,
        matchability: Matchability | None = None,
        settings: ScoreSettings | None = None,
        *,
        plot: Plot | None = None,
        points: int = POINTS,
    ) -> None:
        self.problem, self.matchability = problem, matchability or Matchability()
        self.settings = settings or ScoreSettings()
        self._plot = plot or problem.plots[0]
        self.surface = Surface.of(self._plot, points)
        self._around = _plot_points(problem, self.surface)
        self._worth = _pair_worth(self.settings)
        self._views = PerCamera(self._look)
        count = min(self.settings.neighbors, len(self.surface))
        distance, index = cKDTree(self.surface.points).query(self.surface.points, k=count)
        self._neighbors = np.asarray(index, dtype=np.int64).reshape(len(self.surface), count)
        self._distances = np.minimum(np.asarray(distance).reshape(len(self.surface), count), self.settings.cap_m)

    def score(self, cameras: Cameras) -> Geometry:
        """Both terms of a set of at least one camera; the order of the cameras only matters to rounding."""
        views, cap = self._views(cameras), self.settings.cap_m
        p, noise = self._reconstructed(views)
        gap = float(_expected_distance(p, self._neighbors, self._distances, cap).mean())
        total = float(p.sum())
        spread = float((p * noise).sum()) / total if total > 0 else cap
        matches = self.problem.counted_matches(cameras, self._plot)
        if matches is None:
            pictured = np.array([view.pictured for view in views])
            matches = expected_matches(cameras.positions, self.problem.center, pictured, self.matchability)
        loose = looseness_m(matches)
        tie = float(np.sqrt((loose**2).mean()))
        return Geometry(gap + spread, tie, gap, spread, float(p.mean()), loose, matches)

    def probability(self, cameras: Cameras) -> Array:
        """(p,) that each point of `surface` is reconstructed."""
        return self._reconstructed(self._views(cameras))[0]

    def _reconstructed(self, views: list[_View]) -> tuple[Array, Array]:
        s = self.settings
        found: tuple[Array, Array] = _reconstructed(
            np.stack([view.points for view in views]), s.error_px, self._worth, s.agreeing, s.cap_m
        )
        return found

    def _look(self, cameras: Cameras) -> list[_View]:
        camera = self.problem.camera
        focal = camera.fx * self.settings.width / camera.width
        pictured = in_picture(self._around, cameras, camera)
        views = []
        for sight, row in zip(look(self.surface, cameras, camera), pictured, strict=True):
            footprint = sight.distance_m / focal
            quality = self.settings.of_views(sight.seen, sight.facing, footprint)
            points = np.column_stack([sight.rays, quality, footprint]).astype(np.float32)
            views.append(_View(points, row))
        return views


def _pair_worth(settings: ScoreSettings) -> Array:
    """What a pair is worth by the sine of half its angle, in steps from 0 to 1 and one beyond."""
    worth = settings.of_angles(np.degrees(2.0 * np.arcsin(np.linspace(0.0, 1.0, _STEPS + 1))))
    return np.append(worth, worth[-1])


def _plot_points(problem: PlanningProblem, surface: Surface) -> Array:
    """(t, 3) about as many points on the ground, to 0.3 m beyond the plants, as on the plants: what pictures share."""
    low, high = np.array(problem.envelope.target.lower), np.array(problem.envelope.target.upper)
    axes = [np.linspace(low[k] - _AROUND_M, high[k] + _AROUND_M, _GRID) for k in (0, 1)]
    ground = np.stack([*np.meshgrid(*axes, indexing="ij"), np.zeros((_GRID, _GRID))], axis=-1).reshape(-1, 3)
    ground[:, 2] = problem.envelope.ground_m(ground)
    every = max(1, len(surface) // _PICTURED)
    return np.vstack([ground, surface.points[::every]])


@fast_kernel
def _reconstructed(sights, error, worth, least, cap):  # type: ignore[no-untyped-def]
    """(p,) probability that at least ``least`` views' depths are right, and (p,) the noise of these points in metres,
    at most the cap; from n views of the points (n, p, 5), as `_View` has them, and the error of a match in pixels.
    """
    count, points = sights.shape[:2]
    found, noise = np.zeros(points), np.full(points, cap)
    fails, at = np.empty(count), np.empty((count, 5))
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
            x, y, z, quality, footprint = at[a]
            squares += footprint**2
            for b in range(a + 1, views):
                cosine = x * at[b, 0] + y * at[b, 1] + z * at[b, 2]
                place = steps * np.sqrt(min(1.0, max(0.0, 0.5 - 0.5 * cosine)))
                step = int(place)
                success = worth[step] + (place - step) * (worth[step + 1] - worth[step])
                success *= min(quality, at[b, 3])
                fails[a] *= 1.0 - success
                fails[b] *= 1.0 - success
                information += success * (1.0 - cosine * cosine) / (footprint * at[b, 4])
        information = cap**-2 + information / error**2
        # Probabilities of exactly 0, 1, … right depths, one view after the other.
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
