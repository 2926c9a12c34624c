"""Optima of the geometric score as plans."""

from dataclasses import replace

import numpy as np
import pytest

from fieldkit.geometry import Intrinsics
from fieldkit.planning.methods.optimise import Effort
from fieldkit.planning.methods.score import EvenRing, ScoreOptimum
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.planning.score.cost_model import CostModel
from fieldkit.planning.score.geometric import GeometricScore
from fieldkit.vocabulary import WEIGHTS
from tests.planning.leafy import problem, recorded

PROBLEM = problem(5)
SMALL = Effort(designs=8, starts=1, moves=60)


def test_optima_are_ordered_and_repeatable() -> None:
    found = ScoreOptimum(PROBLEM, seed=3, effort=SMALL).choose(3)
    assert sorted(trial.number for trial in found) == [0, 1, 2]
    values = [trial.notes["expected_m"] for trial in found]
    assert values == sorted(values)
    cost_model = CostModel(PROBLEM)
    for trial in found:
        assert PROBLEM.contains(trial.cameras)
        assert trial.notes["expected_m"] == cost_model.expected_m(trial.cameras, WEIGHTS)
    assert max(values) < min(cost_model.expected_m(PROBLEM.sample(seed), WEIGHTS) for seed in range(10))
    elsewhere = ScoreOptimum(PROBLEM, seed=3, effort=SMALL).choose(3, workers=2)
    assert [(trial.number, trial.cameras) for trial in elsewhere] == [(trial.number, trial.cameras) for trial in found]
    (alone,) = ScoreOptimum(PROBLEM, seed=3, effort=SMALL).choose(1)
    assert alone.cameras == next(trial for trial in found if trial.number == 0).cameras


def test_weights_say_what_is_optimal() -> None:
    (ties,) = ScoreOptimum(PROBLEM, (0.0, 0.0, 1.0), effort=SMALL).choose(1)
    (gaps,) = ScoreOptimum(PROBLEM, (1.0, 0.0, 0.0), effort=SMALL).choose(1)
    cost_model = CostModel(PROBLEM)
    assert cost_model.expected_m(ties.cameras, (0.0, 0.0, 1.0)) == ties.notes["expected_m"]
    assert ties.notes["expected_m"] < cost_model.expected_m(gaps.cameras, (0.0, 0.0, 1.0))


def test_room_above_the_plants_is_left_for_heights() -> None:
    narrow = replace(PROBLEM, camera=Intrinsics.pinhole(640, 480, 1100.0))
    (roomy,) = ScoreOptimum(narrow, effort=SMALL).choose(1)
    assert GeometricScore(narrow).score(roomy.cameras).lost_room < 0.5
    cost_model = CostModel(narrow)
    assert roomy.notes["expected_m"] == cost_model.expected_m(roomy.cameras, WEIGHTS)
    assert cost_model.cost_m(roomy.cameras, WEIGHTS) >= roomy.notes["expected_m"]


def test_plans_stand_farther_away_where_their_wash_moves_leaves() -> None:
    away = []
    for noise in (NoiseSettings(), NoiseSettings(vehicle_kg=2.0)):
        (found,) = ScoreOptimum(replace(PROBLEM, noise=noise), effort=SMALL).choose(1)
        away.append(np.linalg.norm(found.cameras.positions - PROBLEM.center, axis=1).mean())
    assert away[1] > away[0]


def test_leaves_that_sway_are_reconstructed_less_and_noisier() -> None:
    cameras = PROBLEM.sample(0)
    still, windy = (
        GeometricScore(replace(PROBLEM, noise=NoiseSettings(wind_m=wind_m))).score(cameras) for wind_m in (0.0, 0.01)
    )
    assert windy.gap_m > still.gap_m
    assert windy.noise_m > still.noise_m


@pytest.mark.parametrize("views", [5, 24])
def test_recorded_sets_are_never_chosen_twice(views: int) -> None:
    plot = recorded(5, views)
    found = ScoreOptimum(plot, effort=Effort(2, 1, 20)).choose(2)
    assert len({trial.cameras for trial in found}) == len(found)
    assert all(plot.contains(trial.cameras) for trial in found)


def test_the_even_ring_is_wide_even_and_looks_down() -> None:
    plot = problem()
    (trial,) = EvenRing(plot).choose(3)
    assert plot.contains(trial.cameras)
    assert trial.notes["expected_m"] == CostModel(plot).expected_m(trial.cameras, WEIGHTS)
    ring = trial.cameras
    away = ring.positions[:, :2] - plot.center[:2]
    turn = np.sort(np.degrees(np.arctan2(away[:, 1], away[:, 0])))
    assert np.linalg.norm(away, axis=1) == pytest.approx(plot.ranges.radius_m[1], rel=0.02)
    assert np.diff(turn) == pytest.approx(360.0 / plot.count, abs=1.0)
    assert len(np.unique(ring.positions[:, 2])) == 1
    highest = ring.positions[0, 2] == pytest.approx(plot.ranges.altitude_m[1])
    assert highest or ring.pitch_deg == pytest.approx(-40.0, abs=1.0)
