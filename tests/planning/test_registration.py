"""Which sets blind mapping is expected to register, by the connectivity of their views."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fieldkit.planning.registration import THRESHOLD, Registration, connectivity

COUNT = 6
MATCHES = arrays(np.float64, (COUNT, COUNT), elements=st.floats(0.0, 500.0)).map(
    lambda m: np.triu(m, 1) + np.triu(m, 1).T
)


def graph(pairs: dict[tuple[int, int], float], count: int = COUNT) -> np.ndarray:
    found = np.zeros((count, count))
    for (i, j), matches in pairs.items():
        found[i, j] = found[j, i] = matches
    return found


def test_a_complete_graph_a_ring_and_a_chain_have_the_connectivity_of_textbooks() -> None:
    complete = graph({(i, j): 7.0 for i in range(COUNT) for j in range(i)})
    ring = graph({(i, (i + 1) % COUNT): 7.0 for i in range(COUNT)})
    chain = graph({(i, i + 1): 7.0 for i in range(COUNT - 1)})
    assert connectivity(complete) == pytest.approx(7.0 * COUNT)
    assert connectivity(ring) == pytest.approx(14.0 * (1 - np.cos(2 * np.pi / COUNT)))
    assert connectivity(chain) == pytest.approx(14.0 * (1 - np.cos(np.pi / COUNT)))


def test_two_groups_without_a_match_between_them_are_not_connected() -> None:
    groups = graph({(0, 1): 300.0, (1, 2): 300.0, (3, 4): 300.0, (4, 5): 300.0})
    assert connectivity(groups) == pytest.approx(0.0, abs=1e-9)


@given(MATCHES, MATCHES, st.permutations(range(COUNT)))
def test_more_matches_never_connect_worse_and_the_order_does_not_count(
    matches: np.ndarray, more: np.ndarray, order: list[int]
) -> None:
    assert connectivity(matches + more) >= connectivity(matches) - 1e-6
    assert connectivity(matches[np.ix_(order, order)]) == pytest.approx(connectivity(matches), abs=1e-6)


def test_without_results_half_of_the_sets_at_the_threshold_register() -> None:
    nothing = Registration.learn([], [])
    assert nothing.probability(THRESHOLD) == pytest.approx(0.5)
    found = nothing.probability([0.0, 5.0, 20.0, 60.0, 400.0])
    assert (np.diff(found) > 0).all()
    assert found[0] > 0.0
    assert found[1] < 0.05
    assert found[-1] > 0.98


def test_while_every_set_fails_the_threshold_rises_above_what_was_tried() -> None:
    tried: list[float] = []
    for _ in range(6):
        known = Registration.learn(tried, [False] * len(tried))
        steps = np.geomspace(5.0, 2000.0, 400)
        tried.append(float(steps[np.argmax(known.probability(steps) > 0.5)]))
    assert (np.diff(tried) > 0).all()
    assert tried[-1] > 1.8 * tried[0]


def test_what_registers_says_that_its_like_do() -> None:
    before = Registration.learn([30.0], [False])
    after = Registration.learn([30.0, 34.0, 35.0, 36.0], [False, True, True, True])
    assert after.probability(35.0) > before.probability(35.0) + 0.2
    assert after.probability(20.0) < 0.5


def test_what_is_believed_is_bayes_rule() -> None:
    prior, learnt = Registration.learn([], []), Registration.learn([18.0, 40.0], [True, False])
    likelihood = np.ones(len(prior.weights))
    for place, whole in ((18.0, True), (40.0, False)):
        found = 1.0 / (1.0 + np.exp((prior.thresholds - np.log(place)) / prior.widths))
        likelihood *= found if whole else 1.0 - found
    expected = prior.weights * likelihood
    assert np.allclose(learnt.weights, expected / expected.sum())
