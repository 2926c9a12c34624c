"""Expected matches, how firmly cameras hang together by them, and the connectivity of view graphs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import least_squares

from fieldkit.planning.score.matchability import (
    Matchability,
    connectivity,
    expected_matches,
    looseness_m,
    view_angles_deg,
)
from tests.planning.leafy import around, problem

CENTER = problem().center
COUNT = 6
MATCHES = arrays(np.float64, (COUNT, COUNT), elements=st.floats(0.0, 500.0)).map(
    lambda m: np.triu(m, 1) + np.triu(m, 1).T
)


def test_looseness_of_two_cameras_is_known() -> None:
    # Against their mean: half the difference, whose variance is that of two priors and a spring side by side.
    n, prior, match = 25.0, 0.01, 0.02
    difference = 1.0 / (1.0 / (2 * prior**2) + n / match**2)
    found = looseness_m(np.array([[0, n], [n, 0]]), prior_m=prior, match_m=match)
    np.testing.assert_allclose(found, 0.5 * np.sqrt(difference))
    free = looseness_m(np.zeros((4, 4)), prior_m=0.01)
    np.testing.assert_allclose(free, 0.01 * np.sqrt(3 / 4))


def test_matches_fall_with_angle_overlap_and_scale() -> None:
    pictured = np.ones((3, 20), dtype=bool)
    cameras = around(np.array([0.0, 10.0, 30.0]))
    found = expected_matches(cameras.positions, CENTER, pictured, Matchability())
    angles = view_angles_deg(cameras.positions, CENTER)
    np.testing.assert_allclose(found[0, 1], Matchability().expected(angles[0, 1]), rtol=1e-3)  # as far away but for mm
    assert found[0, 1] > found[1, 2] > found[0, 2] > 0
    np.testing.assert_array_equal(found, found.T)
    pictured[1, :10] = False
    half = expected_matches(cameras.positions, CENTER, pictured, Matchability())
    assert half[0, 1] == pytest.approx(0.5 * found[0, 1])
    far = np.array(cameras.positions)
    far[1] = CENTER + 2 * (far[1] - CENTER)
    assert expected_matches(far, CENTER, np.ones((3, 20), bool), Matchability())[0, 1] < 0.2 * found[0, 1]


def test_the_decay_is_fitted() -> None:
    angles, medians = np.array([6, 12, 18, 27, 36, 48]), np.array([309, 204, 104, 40, 16, 9])
    chosen = Matchability()
    found = least_squares(
        lambda x: np.log1p(x[0] * np.exp(-angles / x[1]) + x[2]) - np.log1p(medians), (500.0, 10.0, 1.0)
    ).x
    np.testing.assert_allclose(found, (chosen.matches, chosen.decay_deg, 5.1), rtol=0.01)


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
def test_more_matches_never_connect_worse_and_the_order_does_not_count(matches, more, order) -> None:
    assert connectivity(matches + more) >= connectivity(matches) - 1e-6
    assert connectivity(matches[np.ix_(order, order)]) == pytest.approx(connectivity(matches), abs=1e-6)
