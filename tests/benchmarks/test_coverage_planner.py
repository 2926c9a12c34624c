"""Maximum coverage: exact against greedy and brute force."""

import itertools

import numpy as np
import pytest

from benchmarks.planners.coverage import MaximumCoverage, exact_cover, greedy_cover, lattice_views
from tests.planning.leafy import problem, recorded


def brute_force(seen: np.ndarray, count: int, place: np.ndarray, views: int) -> int:
    return max(
        int((seen[list(chosen)].sum(axis=0) >= views).sum())
        for chosen in itertools.combinations(range(len(seen)), count)
        if len(set(place[list(chosen)])) == count
    )


@pytest.mark.parametrize("seed", range(6))
def test_exact_is_the_best_there_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    seen, place = rng.random((10, 40)) < 0.35, np.repeat(np.arange(5), 2) if seed % 2 else np.arange(10)
    best = brute_force(seen, 4, place, 2)
    exact, greedy = exact_cover(seen, 4, place), greedy_cover(seen, 4, place)
    assert exact.proven
    assert exact.covered == best == pytest.approx(exact.bound)
    assert greedy.covered <= exact.covered
    for found in (exact, greedy):
        assert len({int(p) for p in place[list(found.chosen)]}) == 4
        assert found.covered == (seen[list(found.chosen)].sum(axis=0) >= 2).sum()


def test_candidates_are_feasible_in_any_choice() -> None:
    plot = problem(6)
    views = lattice_views(plot, 60)
    places = np.unique(views.positions, axis=0)
    assert 20 < len(places) <= 60
    assert len(views) == 2 * len(places)
    rng = np.random.default_rng(0)
    for _ in range(5):
        chosen = 2 * rng.choice(len(places), 6, replace=False) + rng.integers(0, 2, 6)
        assert plot.contains(views.select(chosen))


@pytest.mark.parametrize("plot", [problem(6), recorded(6, 20)])
def test_one_greedy_and_one_exact_trial(plot) -> None:
    method = MaximumCoverage(plot, seconds=20.0)
    greedy, exact = (method.propose(k, (), ()) for k in range(2))
    assert method.trials == 2
    assert method.propose(2, (), ()) is None
    assert plot.contains(greedy.cameras)
    assert plot.contains(exact.cameras)
    assert exact.notes["covered"] >= greedy.notes["covered"]
    assert exact.notes["bound"] >= exact.notes["covered"]
    assert exact.notes["views"] == greedy.notes["views"] >= 2
    assert "exact" in exact.origin
    again = MaximumCoverage(plot).propose(0, (), ())
    assert again.cameras == greedy.cameras
