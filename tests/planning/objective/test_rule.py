"""The rule of r: bounded, continuous, worst where there is nothing, and never against a good point."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fieldkit.clouds import Cloud, nearest_distances, score
from fieldkit.planning.objective.evaluation import SUPPORT, WORST_M, value_m
from fieldkit.vocabulary import CAP_M

some = st.integers(1, 40)
distances = some.flatmap(lambda n: arrays(np.float64, n, elements=st.floats(0, 5)))
points = some.flatmap(lambda n: arrays(np.float64, (n, 3), elements=st.floats(-1, 1, width=32)))


@given(distances, distances)
def test_bounded_and_worst_without_a_cloud(to_cloud: np.ndarray, to_truth: np.ndarray) -> None:
    value = value_m(to_cloud, to_truth)
    assert 0.0 <= value <= value_m([], []) == WORST_M == 2 * CAP_M


@given(distances, distances, st.floats(1e-9, 1e-3))
def test_continuous_in_every_distance(to_cloud: np.ndarray, to_truth: np.ndarray, step: float) -> None:
    before = value_m(to_cloud, to_truth)
    # Completeness counts once, and through the weight of the accuracy at most 1 / support times more.
    steepest = 1.0 + 1.0 / SUPPORT
    assert 0.0 <= value_m(to_cloud + step, to_truth) - before <= steepest * step + 1e-12
    assert 0.0 <= value_m(to_cloud, to_truth + step) - before <= step + 1e-12


@given(points, points, st.integers(0, 10**6))
def test_a_good_point_never_makes_it_worse(truth: np.ndarray, found: np.ndarray, number: int) -> None:
    reference, cloud = Cloud(truth), Cloud(found)
    more = Cloud(np.vstack([found, truth[number % len(truth)]]))
    assert value_of(reference, more) <= value_of(reference, cloud) + 1e-12


def test_an_ordinary_cloud_has_its_chamfer_distance() -> None:
    rng = np.random.default_rng(0)
    reference = Cloud(rng.uniform(0, 0.2, (2000, 3)))
    cloud = Cloud(reference.points[::2] + rng.normal(0, 0.002, (1000, 3)))
    assert value_of(reference, cloud) == pytest.approx(score(reference, cloud).chamfer.chamfer_m, rel=1e-12)


def test_a_cloud_in_the_wrong_place_is_worth_nothing() -> None:
    truth = np.random.default_rng(2).uniform(0, 0.3, (500, 3))
    assert value_of(Cloud(truth), Cloud(truth + 2.0)) == WORST_M


def value_of(reference: Cloud, cloud: Cloud) -> float:
    if not len(cloud):
        return value_m([], [])
    to_truth, to_cloud = nearest_distances(reference, cloud)
    return value_m(to_cloud, to_truth)
