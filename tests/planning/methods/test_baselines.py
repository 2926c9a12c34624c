"""Staged searches: a grid, a finer one about the best, and the end; and choices among recorded views."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.planners.rings import Cap, CircleAim, Hemisphere, TwoRings
from fieldkit.errors import UsageError
from fieldkit.planning.methods.baselines import CircleSearch, MatchGraph, Uniform, greedy_by_matches
from fieldkit.planning.problem import Method, Trial
from tests.planning.leafy import problem, recorded

PROBLEM = problem(6)


def wish(trial: Trial) -> float:
    """Best at 1.1 m, altitude 1.3 m (between those of the grid), aim 0.3 m."""
    notes = trial.notes
    return abs(notes["radius_m"] - 1.1) + abs(notes["altitude_m"] - 1.3) + abs(notes["aim_m"] - 0.3)


def most(trial: Trial) -> float:
    """Best at the largest sum of all numbers but the aim."""
    return -sum(value for name, value in trial.notes.items() if name != "aim_m")


def run(method: Method, cost: Callable[[Trial], float] = wish) -> list[Trial]:
    results: list[Trial] = []
    while (trial := method.propose(len(results), results, ())) is not None:
        assert trial.number == len(results)
        results.append(replace(trial, value_m=cost(trial)))
        assert len(results) < 100
    return results


@pytest.mark.parametrize(("aim", "count"), [(False, 33), (True, 37)])
def test_the_grid_is_refined_and_ends(aim: bool, count: int) -> None:
    method = CircleAim if aim else CircleSearch
    found = run(method(PROBLEM))
    assert len(found) == count
    assert all(PROBLEM.contains(r.cameras) for r in found)
    grid = found[:25]
    assert len({(r.notes["radius_m"], r.notes["altitude_m"]) for r in grid}) == 25
    assert len({r.notes["aim_m"] for r in grid}) == 1
    assert min(r.value_m for r in found) < min(r.value_m for r in grid)
    if aim:
        assert len({r.notes["aim_m"] for r in found}) == 5
        assert len({r.notes["radius_m"] for r in found[25:29]}) == 1
    assert [r.cameras for r in found] == [r.cameras for r in run(method(PROBLEM))]


def test_broken_and_missing_results_do_not_lead() -> None:
    method = CircleSearch(PROBLEM)
    grid = [method.propose(k, (), ()) for k in range(25)]
    results = [replace(t, value_m=np.nan if t.number == 3 else 0.2 - 0.001 * t.number) for t in grid if t]
    first = method.propose(25, results, ())
    again = CircleSearch(PROBLEM).propose(25, results, ())
    assert first.cameras == again.cameras
    step = abs(first.notes["radius_m"] - results[24].notes["radius_m"])
    assert 0 < step < 0.5
    assert abs(first.notes["altitude_m"] - results[24].notes["altitude_m"]) < 0.5
    assert method.propose(25, (), grid) is not None  # nothing is known yet
    assert method.propose(33, results, ()) is None


def test_a_recorded_set_has_few_circles() -> None:
    plot = recorded(6)
    found = run(CircleSearch(plot))
    assert len(found) < 33
    assert all(plot.contains(r.cameras) for r in found)
    assert np.ptp(found[0].cameras.positions[:, 2]) == 0


SEVEN = problem(7)


@pytest.mark.parametrize("make", [TwoRings, Hemisphere])
def test_a_grid_is_refined_about_its_best_and_ends(make: type[TwoRings | Hemisphere]) -> None:
    found = run(make(SEVEN), most)
    assert len(found) == make(SEVEN).trials == 33
    assert all(SEVEN.contains(r.cameras) for r in found)
    grid = min(found[:25], key=lambda r: r.value_m).notes
    for later in found[25:]:
        assert later.notes != grid
        assert all(abs(later.notes[key] - grid[key]) < 0.5 for key in grid)
    plot = recorded(6)
    few = run(make(plot), most)
    assert all(plot.contains(r.cameras) for r in few)
    assert len(few) == make(plot).trials


def test_a_cap_is_evenly_covered_within_the_height_band() -> None:
    low, high = SEVEN.envelope.height_m
    for cap in (Cap(1.5, 0.2), Cap(2.6, 0.0)):
        positions = cap.cameras(SEVEN).positions
        np.testing.assert_allclose(np.linalg.norm(positions - SEVEN.center, axis=1), cap.distance_m)
        assert low <= positions[:, 2].min()
        assert positions[:, 2].max() <= high
        assert np.ptp(np.diff(positions[:, 2])) < 1e-9  # zones of equal height have equal areas
    half = Cap(2.6, 0.5).cameras(SEVEN).positions[:, 2]
    assert half.min() > low + 0.5 * (high - low)


def test_uniform_subsets_are_even_and_differ() -> None:
    plot = recorded(8, 40)
    method = Uniform(plot)
    trials = [method.propose(k, (), ()) for k in range(5)]
    assert method.trials == 5
    assert method.propose(5, (), ()) is None
    steps = []
    for trial in trials:
        assert plot.contains(trial.cameras)
        turn = np.sort(np.degrees(np.arctan2(*trial.cameras.positions[:, :2].T)))
        steps.append(np.diff(turn))
    np.testing.assert_allclose(steps, 45.0, atol=2.0)
    assert len({trial.cameras for trial in trials if trial}) == 5


@pytest.mark.parametrize("method", [Uniform, MatchGraph])
def test_simulated_plots_have_no_views(method: type) -> None:
    with pytest.raises(UsageError, match="photographs that were taken"):
        method(problem(5))


def test_a_chain_of_views_is_followed() -> None:
    # Ten views in a row, neighbours match 100, next but one 30; and one apart that matches nothing.
    steps = np.abs(np.arange(11)[:, None] - np.arange(11)[None])
    matches = np.where(steps == 1, 100.0, np.where(steps == 2, 30.0, 0.0))
    matches[10], matches[:, 10] = 0.0, 0.0
    wide = greedy_by_matches(matches, 4, 20.0)
    firm = greedy_by_matches(matches, 4, 80.0)
    assert 10 not in wide
    for chosen, least in ((wide, 20.0), (firm, 80.0)):
        for k in range(1, 4):
            assert matches[chosen[k], chosen[:k]].sum() >= least
    assert np.ptp(wide) > np.ptp(firm)
    assert len(set(greedy_by_matches(matches, 11, 80.0))) == 11


def test_match_graph_goes_by_counts() -> None:
    plot = recorded(6, 30)
    # Counted matches that are all between the first views draw the choice there.
    counted = np.zeros((30, 30))
    counted[:6, :6] = 200.0
    method = MatchGraph(replace(plot, plots=(replace(plot.plots[0], matches=counted),)))
    assert method.propose(3, (), ()) is None
    drawn = method.propose(0, (), ())
    assert plot.contains(drawn.cameras)
    assert len(set(drawn.notes["views"]) & set(range(6))) >= 5
