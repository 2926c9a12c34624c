"""Methods that optimise a geometric criterion, without evaluations."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.planners.criteria import GeometricOptimum, Reconstructability, Triangulation
from fieldkit.planning.methods.optimise import Cost, Effort, optimise
from fieldkit.planning.score.visibility import Surface, look
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import fill_distance_m
from tests.planning.leafy import CAMERA, problem, recorded

PROBLEM = problem(5)
SMALL = Effort(designs=8, starts=2, moves=60)


def test_triangulation_is_the_covariance_of_the_rays() -> None:
    cameras = PROBLEM.sample(2)
    surface = Surface.of(PROBLEM.plots[0], 800)
    views = look(surface, cameras, CAMERA)
    expected = []
    for k in range(len(surface)):
        information = np.eye(3) / 0.1**2
        for view in views:
            if view.seen[k]:
                information += (CAMERA.fx / view.distance_m[k]) ** 2 * (
                    np.eye(3) - np.outer(view.rays[k], view.rays[k])
                )
        expected.append(np.sqrt(np.trace(np.linalg.inv(information))))
    assert Triangulation(PROBLEM)(cameras) == pytest.approx(np.mean(expected), rel=1e-6)


@pytest.mark.parametrize("cost", [Triangulation(PROBLEM), Reconstructability(PROBLEM)])
def test_one_trial_better_than_chance(cost: Cost) -> None:
    method = GeometricOptimum("smith", PROBLEM, cost, 3, effort=SMALL)
    trial = method.propose(0, (), ())
    assert method.trials == 1
    assert method.propose(1, (), ()) is None
    assert PROBLEM.contains(trial.cameras)
    assert trial.notes["criterion"] == cost(trial.cameras)
    assert cost(trial.cameras) < min(cost(PROBLEM.sample(seed)) for seed in range(20))
    again = GeometricOptimum("smith", PROBLEM, cost, 3, effort=SMALL).propose(0, (), ())
    assert again.cameras == trial.cameras


def test_reconstructability_is_the_sum_over_pairs() -> None:
    cameras = PROBLEM.sample(2)
    views = look(Surface.of(PROBLEM.plots[0], 800), cameras, CAMERA)
    farthest = 2.0 * fill_distance_m(PROBLEM.envelope, CAMERA)
    found = Reconstructability(PROBLEM).of_points(cameras)
    for k in range(0, len(found), 50):
        total = 0.0
        for a, b in itertools.combinations(views, 2):
            steepest = min(a.facing[k], b.facing[k])
            if a.seen[k] and b.seen[k] and steepest > 0.087 and max(a.distance_m[k], b.distance_m[k]) < farthest:
                alpha = np.arccos(np.clip(a.rays[k] @ b.rays[k], -1, 1))
                w1, w3 = 1 / (1 + np.exp(-32 * (alpha - np.pi / 16))), 1 - 1 / (1 + np.exp(-8 * (alpha - np.pi / 4)))
                total += w1 * w3 * (1 - max(a.distance_m[k], b.distance_m[k]) / farthest) * steepest
        assert found[k] == pytest.approx(total)
    assert Reconstructability(PROBLEM)(cameras) == pytest.approx(np.mean(np.minimum(found - 3, 0) ** 2))


def on_each(cost: Callable[[Cameras], float]) -> Cost:
    return lambda cameras, plots: np.full(len(plots), cost(cameras))


def test_a_recorded_set_is_searched_by_its_views() -> None:
    plot = recorded(5, 24)
    cost = Triangulation(plot)
    found = optimise(plot, on_each(cost), 0, SMALL)
    assert plot.contains(found)
    assert cost(found) <= min(cost(plot.sample(seed)) for seed in range(10))
    everything = recorded(5, 5)
    assert plot.contains(optimise(plot, on_each(cost), 1, Effort(2, 1, 5)))
    assert everything.contains(optimise(everything, on_each(Triangulation(everything)), 0, Effort(2, 1, 5)))


def test_known_sets_are_climbed_from_instead_of_designs() -> None:
    cost = Triangulation(PROBLEM)
    known = [PROBLEM.sample(seed) for seed in (1, 2)]
    found = optimise(PROBLEM, on_each(cost), 0, Effort(moves=60), known)
    assert PROBLEM.contains(found)
    assert cost(found) < min(map(cost, known))
    first = on_each(lambda cameras: float(cameras != known[0]))
    assert optimise(PROBLEM, first, 0, Effort(moves=5), known) == known[0]
