"""Choices among recorded views without evaluations."""

from dataclasses import replace

import numpy as np
import pytest

from fieldkit.errors import UsageError
from fieldkit.planning.methods.baselines import MatchGraph, Uniform, greedy_by_matches
from tests.planning.leafy import problem, recorded


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


def test_a_number_that_does_not_divide_is_nearly_even() -> None:
    plot = recorded(9, 40)
    trials = [Uniform(plot).propose(k, (), ()) for k in range(4)]
    for trial in trials:
        gaps = np.diff(sorted(trial.notes["views"]))
        assert set(gaps) <= {4, 5}
        assert len(set(trial.notes["views"])) == 9


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
    with pytest.raises(UsageError, match="30 views"):
        replace(plot, plots=(replace(plot.plots[0], matches=np.zeros((4, 4))),))
