"""Two rings and hemispheres: as many trials as circles have, feasible, from the ranges, and refined about the best."""

import numpy as np
import pytest

from benchmarks.planners.rings import Cap, Hemisphere, TwoRings
from fieldkit.planning.methods.circle import StagedSearch
from fieldkit.planning.problem import Result
from tests.planning.leafy import problem, recorded

PROBLEM = problem(7)


def run(method: StagedSearch) -> list[Result]:
    """Best at the largest sum of all numbers but the aim."""
    results: list[Result] = []
    while (trial := method.propose(len(results), results, ())) is not None:
        value = -sum(value for name, value in trial.notes.items() if name != "aim_m")
        results.append(Result(trial, value))
        assert len(results) < 100
    return results


@pytest.mark.parametrize("make", [TwoRings, Hemisphere])
def test_a_grid_is_refined_about_its_best_and_ends(make: type[TwoRings | Hemisphere]) -> None:
    found = run(make(PROBLEM))
    assert len(found) == make(PROBLEM).trials == 33
    assert all(PROBLEM.contains(r.trial.cameras) for r in found)
    grid = min(found[:25], key=lambda r: r.value_m).trial.notes
    for later in found[25:]:
        assert later.trial.notes != grid
        assert all(abs(later.trial.notes[key] - grid[key]) < 0.5 for key in grid)
    assert [r.trial.cameras for r in found] == [r.trial.cameras for r in run(make(PROBLEM, 5))]
    plot = recorded(6)
    few = run(make(plot))
    assert all(plot.contains(r.trial.cameras) for r in few)
    assert len(few) == make(plot).trials


def test_a_cap_is_evenly_covered_within_the_height_band() -> None:
    low, high = PROBLEM.envelope.height_m
    for cap in (Cap(1.5, 0.2), Cap(2.6, 0.0)):
        positions = cap.cameras(PROBLEM).positions
        np.testing.assert_allclose(np.linalg.norm(positions - PROBLEM.center, axis=1), cap.distance_m)
        assert low <= positions[:, 2].min()
        assert positions[:, 2].max() <= high
        assert np.ptp(np.diff(positions[:, 2])) < 1e-9  # zones of equal height have equal areas
    half = Cap(2.6, 0.5).cameras(PROBLEM).positions[:, 2]
    assert half.min() > low + 0.5 * (high - low)
