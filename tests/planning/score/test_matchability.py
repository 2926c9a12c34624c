"""Expected matches, how firmly cameras are held by them, and the connectivity of view graphs."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from fieldkit.planning.score.matchability import (
    Matchability,
    camera_sigmas_m,
    connectivity,
    expected_matches,
    overlap,
    view_angles_deg,
)
from tests.planning.leafy import around, problem

CENTER = problem().center
COUNT = 6
MATCHES = arrays(np.float64, (COUNT, COUNT), elements=st.floats(0.0, 500.0)).map(
    lambda m: np.triu(m, 1) + np.triu(m, 1).T
)


def test_sigmas_are_those_of_all_rays_distances() -> None:
    """The same by numerical derivatives of every distance between two rays through a point."""
    rng, prior = np.random.default_rng(3), 0.02
    positions, points = rng.normal((0.0, 0.0, 2.0), 1.0, (4, 3)), rng.normal(0.0, 0.2, (5, 3))
    seen, variance = rng.uniform(0.0, 1.0, (4, 5)), rng.uniform(0.5, 2.0, (4, 5)) * 1e-6
    matches = graph({(0, 1): 90.0, (1, 2): 40.0, (2, 3): 150.0, (0, 3): 60.0, (0, 2): 5.0}, 4)

    def distances(x: np.ndarray) -> np.ndarray:
        turned, centers = x[:12].reshape(4, 3), positions + x[12:].reshape(4, 3)
        found = []
        for i, j, k in itertools.product(range(4), range(4), range(5)):
            if i < j:
                rays = [Rotation.from_rotvec(turned[c]).apply(points[k] - positions[c]) for c in (i, j)]
                across = np.cross(*rays) / np.linalg.norm(np.cross(*rays))
                share = seen[i, k] * seen[j, k] / (seen[i] @ seen[j])
                weight = np.sqrt(max(matches[i, j] - 12.0, 0.0) * share / (variance[i, k] + variance[j, k]))
                found.append(weight * (across @ (centers[i] - centers[j])))
        return np.array(found)

    step = 1e-6 * np.eye(24)
    by = np.stack([(distances(row) - distances(-row)) / 2e-6 for row in step], axis=1)
    covariance = np.linalg.inv(by.T @ by + np.diag([1.0] * 12 + [prior**-2] * 12))[12:, 12:]
    centered = positions - positions.mean(axis=0)
    common = [np.tile(axis, 4) for axis in np.eye(3)] + [np.cross(axis, centered).ravel() for axis in np.eye(3)]
    basis = np.linalg.qr(np.stack([*common, centered.ravel()], axis=1))[0]
    own = np.eye(12) - basis @ basis.T
    expected = np.sqrt(np.diag(own @ covariance @ own).reshape(4, 3).sum(axis=1))
    np.testing.assert_allclose(camera_sigmas_m(positions, points, seen, variance, matches, prior), expected, rtol=1e-4)
    untied = camera_sigmas_m(positions, points, seen, variance, np.zeros((4, 4)), prior)
    assert (untied**2).sum() == pytest.approx((12 - 7) * prior**2)  # all but the common similarity
    firmer = camera_sigmas_m(positions, points, seen, variance, 4.0 * matches, prior)
    assert (firmer < camera_sigmas_m(positions, points, seen, variance, matches, prior)).all()


def test_matches_fall_with_angle_overlap_and_scale() -> None:
    pictured = np.ones((3, 20), dtype=bool)
    cameras = around(np.array([0.0, 10.0, 30.0]))
    found = expected_matches(cameras.positions, CENTER, overlap(pictured), Matchability())
    angles = view_angles_deg(cameras.positions, CENTER)
    np.testing.assert_allclose(found[0, 1], Matchability().expected(angles[0, 1]), rtol=1e-3)  # as far away but for mm
    assert found[0, 1] > found[1, 2] > found[0, 2] > 0
    np.testing.assert_array_equal(found, found.T)
    pictured[1, :10] = False
    half = expected_matches(cameras.positions, CENTER, overlap(pictured), Matchability())
    assert half[0, 1] == pytest.approx(0.5 * found[0, 1])
    far = np.array(cameras.positions)
    far[1] = CENTER + 2 * (far[1] - CENTER)
    assert expected_matches(far, CENTER, np.ones((3, 3)), Matchability())[0, 1] < 0.2 * found[0, 1]


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
