"""Which sets blind mapping is expected to register, by the connectivity of their views."""

import numpy as np
import pytest

from fieldkit.planning.score.registration import THRESHOLD, Registration


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
