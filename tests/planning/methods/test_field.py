"""The method `field`: feasible, repeatable, never twice the same, and better than chance on a planted optimum."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import spearmanr

from benchmarks.planners import PLANNERS
from benchmarks.planners.random_sets import Random
from fieldkit.clouds import Cloud
from fieldkit.planning.methods.baselines import MatchGraph, Uniform
from fieldkit.planning.methods.field import Field
from fieldkit.planning.methods.optimise import Effort, near
from fieldkit.planning.problem import FinalistSelector, FixedDesign, Method, PlanningProblem, Trial
from fieldkit.planning.score.cost_model import ROOM_M
from fieldkit.planning.score.geometric import GeometricScore
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.plots import Plot
from fieldkit.planning.surrogate.set_process import TERMS, SetEmbedding
from tests.planning.bowl import Bowl, bowl_problem, bowl_settings
from tests.planning.leafy import problem as leafy
from tests.planning.leafy import recorded

QUICK = 4


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Optima of the score are looked for with less effort."""
    monkeypatch.setattr("fieldkit.planning.methods.field._EVERYWHERE", Effort(8, 1, 150))
    monkeypatch.setattr("fieldkit.planning.methods.field._NEARBY", Effort(moves=40))
    monkeypatch.setattr("fieldkit.planning.methods.field._MOVES", 16)


def bowl_m(cameras: Cameras) -> float:
    return Bowl().evaluate(cameras).value_m


def run(
    method: Method, count: int, problem: PlanningProblem, value_m: Callable[[Cameras], float] = bowl_m
) -> list[Trial]:
    results: list[Trial] = []
    for number in range(count):
        trial = method.propose(number, results, [])
        if trial is None:
            break
        assert problem.contains(trial.cameras), trial.origin
        results.append(replace(trial, value_m=value_m(trial.cameras)))
    return results


def terms_m(method: Field, sets: Sequence[Cameras]) -> np.ndarray:
    """(n, 3) the geometric score's gap, noise and tie, metres."""
    return np.exp(-method.inputs(sets)[:, TERMS])


def vectors(results: Sequence[Trial]) -> list[bytes]:
    return [result.cameras.vector().tobytes() for result in results]


@cache
def searched() -> tuple[PlanningProblem, list[Trial]]:
    """Eight trials with four cameras about a bowl; whoever goes on from fewer takes the first of them."""
    problem = bowl_problem(4)
    return problem, run(Field(problem, QUICK), 8, problem)


def test_every_trial_is_feasible_and_new_and_the_best_beats_chance() -> None:
    problem = bowl_problem(5)
    found = run(Field(problem, QUICK), 16, problem)
    assert len(set(vectors(found))) == 16
    chance = run(Random(problem), 32, problem)
    assert min(r.value_m for r in found) < 0.7 * min(r.value_m for r in chance)


def test_a_proposal_depends_on_its_arguments_only() -> None:
    problem, found = searched()
    for number in (0, 3, 6):
        again = Field(problem, QUICK).propose(number, found[:number], [])
        assert again.cameras == found[number].cameras
        assert again.notes == found[number].notes
        assert again.gain == found[number].gain
    other = Field(problem, QUICK, seed=1).propose(6, found[:6], [])
    assert other.cameras != found[6].cameras


def test_the_geometric_scores_optimum_is_the_first() -> None:
    problem = bowl_problem(3)
    method = Field(problem)
    trials = [method.propose(number, [], []) for number in range(6)]
    terms = terms_m(method, [trial.cameras for trial in trials if trial is not None])
    assert len(terms) == 6
    assert int(np.argmin(terms @ method.weights)) in (0, 2)
    assert [trial.origin.split()[0] for trial in trials if trial][:3] == ["optimum", "circle", "optimum"]
    other = Field(problem, weights=(0.0, 0.0, 1.0)).propose(0, [], [])
    assert terms_m(method, [other.cameras])[0, 2] < terms[0, 2]


def test_weights_of_the_scores_terms_are_learnt_where_results_tell_them_apart() -> None:
    problem = bowl_problem(3)
    method = Field(problem, QUICK, weights=(0.5, 1.2, 0.1))
    sets = [problem.sample(seed) for seed in range(12)]
    terms = terms_m(method, sets)

    def learnt(weights: tuple[float, ...], chosen: slice) -> np.ndarray:
        values = terms @ weights
        trials = [Trial(number, cameras, "given") for number, cameras in enumerate(sets)]
        results = [replace(trial, value_m=float(value)) for trial, value in zip(trials, values, strict=True)]
        return method.learn(results[chosen]).process.slopes

    assert np.allclose(learnt((0.5, 1.2, 0.1), slice(None)), (0.5, 1.2, 0.1))
    few, many = (np.abs(learnt((1.0, 0.4, 0.0), slice(n)) - (1.0, 0.4, 0.0)).sum() for n in (3, 12))
    assert many < few < 2.0
    assert (learnt((0.0, 0.5, 1.0), slice(None)) >= 0).all()


def test_what_a_plot_adds_to_all_sets_is_not_learnt_as_the_sets_doing() -> None:
    plot = leafy(5).plots[0]
    turned = [Plot(Cloud(plot.reference.points @ turn(a)), np.zeros((0, 3))) for a in (0.0, 2.0, 4.0)]
    problem = replace(leafy(5), plots=tuple(turned))
    method = Field(problem, QUICK)
    assert [method.propose(number, [], []).plot for number in range(4)] == [0, 1, 2, 0]
    sets = [problem.sample(seed) for seed in range(18)]
    effect = (1.0, 2.0, 0.6)
    results = []
    for number, cameras in enumerate(sets):
        expected_m = float(np.exp(-method.inputs([cameras], [number % 3])[0, TERMS]) @ method.weights)
        results.append(Trial(number, cameras, "given", plot=number % 3, value_m=expected_m * effect[number % 3]))
    learnt = method.learn(results)
    truth = np.log(np.exp(-method.inputs(sets)[:, TERMS]) @ method.weights)
    assert spearmanr(-learnt.mean, truth).statistic > 0.9
    blind = method.learn([replace(r, plot=0) for r in results])
    assert spearmanr(-blind.mean, truth).statistic < 0.8


def turn(angle: float) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([(cosine, sine, 0.0), (-sine, cosine, 0.0), (0.0, 0.0, 1.0)])


def test_confirmations_on_unmet_plots_count_for_what_all_evaluations_are_worth_together() -> None:
    """One lucky plot does not make a set the best of the kind; as many plots as one likes do."""
    plot = leafy(5).plots[0]
    problem = replace(leafy(5), plots=(plot,) * 2, unseen=(plot,) * 12)
    method = Field(problem, QUICK)
    sets = [problem.sample(seed) for seed in range(12)]
    before = np.array(method.expect_m(sets, []))
    order = np.argsort(before)
    good = sets[order[0]]
    poor = sets[next(k for k in order if before[k] > 1.15 * before.min())]
    better = float(before.min())

    def confirmed(cameras: Cameras, plots: range, value_m: float) -> list[Trial]:
        return [Trial(0, cameras, "", plot=number, value_m=value_m) for number in plots]

    lucky = method.expect_m(
        [good, poor], confirmed(good, range(2, 3), 1.1 * better) + confirmed(poor, range(2, 3), better)
    )
    assert lucky[0] < lucky[1]
    proven = method.expect_m(
        [good, poor], confirmed(good, range(2, 14), 2 * better) + confirmed(poor, range(2, 14), better)
    )
    assert proven[0] > proven[1]


def test_it_tells_when_nothing_is_left_to_gain() -> None:
    problem = bowl_problem(3)
    score = GeometricScore(problem)

    def value_m(cameras: Cameras) -> float:
        terms = score.score(cameras)
        return terms.gap_m + terms.noise_m + ROOM_M * terms.lost_room

    found = run(Field(problem, QUICK), 13, problem, value_m)
    gains = {r.number: r.gain for r in found if r.gain is not None}
    assert list(gains) == [4, 8, 12]  # where the optimum was looked for anywhere
    assert gains[12].negligible
    assert gains[12].noise_m == pytest.approx(0.05 * min(r.value_m for r in found), rel=0.5)
    doubtful = [replace(r, value_m=r.value_m * (3.0 if r.number % 2 else 0.3)) for r in found[:8]]
    trial = Field(problem, QUICK).propose(8, doubtful, [])  # values that the score does not explain
    assert not trial.gain.negligible


def test_of_a_recorded_set_the_first_are_what_a_person_would_take() -> None:
    plot = recorded(8, 40)
    found = [Field(plot, 7).propose(number, [], []) for number in range(7)]
    given = [method(plot).propose(turn, (), ()) for turn in range(3) for method in (Uniform, MatchGraph)]
    assert [t.cameras for t in found[:6] if t] == [t.cameras for t in given if t]
    assert found[6].cameras not in {t.cameras for t in given if t}


def test_a_small_recorded_set_is_tried_out_and_then_left() -> None:
    problem = bowl_problem(3, views=5)
    found = run(Field(problem, QUICK), 30, problem)
    assert len(set(vectors(found))) == len(found) == 10  # 5 over 3
    assert Field(problem, QUICK).propose(10, found, []) is None


def lucky_place() -> tuple[PlanningProblem, list[Trial], list[Trial]]:
    """A search, and one of its places tried again and again, with one lucky value."""
    problem, found = searched()
    center = found[6].cameras
    rng = np.random.default_rng(1)
    return (
        problem,
        found,
        [
            Trial(8 + k, near(center, problem, 0.01, rng), "", value_m=0.05 if k == 3 else found[6].value_m)
            for k in range(8)
        ],
    )


def test_finalists_are_good_by_the_model_and_apart() -> None:
    problem, found, around = lucky_place()
    chosen = Field(problem, QUICK).favourites([*found, *around], 4)
    assert isinstance(Field(problem), FinalistSelector)
    assert len({trial.cameras.vector().tobytes() for trial in chosen}) == 4
    close = {6, *range(8, 16)}
    assert len([trial for trial in chosen if trial.number in close]) <= 1
    assert Field(problem, QUICK).favourites([], 3) == []
    alike = [replace(result, value_m=value) for result, value in zip(found[:3], (3.0, 3.1, 3.2), strict=True)]
    assert len(Field(problem, QUICK).favourites(alike, 4)) == 3
    beaten = [*alike[:2], replace(alike[2], value_m=6.0)]
    assert {trial.number for trial in Field(problem, QUICK).favourites(beaten, 4)} == {0, 1}


def test_where_a_set_has_one_value_at_every_seed_finalists_are_the_lowest() -> None:
    noisy, found, around = lucky_place()
    exact = replace(noisy, exact=True)
    results = [*found, *around]
    lowest = sorted(results, key=lambda result: (result.value_m, result.number))[:4]
    assert [t.number for t in Field(exact, QUICK).favourites(results, 4)] == [r.number for r in lowest]
    lucky = len(found) + 3
    assert np.exp(-Field(exact, QUICK).learn(results).mean[lucky]) == pytest.approx(0.05)
    assert np.exp(-Field(noisy, QUICK).learn(results).mean[lucky]) > 0.06


def test_the_embedding_knows_no_order_and_its_distance_is_the_discrepancy() -> None:
    problem = bowl_problem(6)
    embedding = SetEmbedding(problem)
    sets = [problem.sample(k) for k in range(8)]
    turned = [s.select([3, 1, 5, 0, 2, 4]) for s in sets]
    assert np.allclose(embedding(sets), embedding(turned))

    def kernel(a: np.ndarray, b: np.ndarray) -> float:
        squared = ((a[:, None] - b[None]) ** 2).sum(axis=-1)
        return float(np.exp(-0.5 * squared).mean())

    scale = 0.35 * embedding.distance_m
    rows = [np.column_stack([s.positions - problem.center, embedding.distance_m * s.forward]) / scale for s in sets]
    embedded = embedding(sets)
    for i in range(8):
        for j in range(i):
            exact = kernel(rows[i], rows[i]) + kernel(rows[j], rows[j]) - 2 * kernel(rows[i], rows[j])
            assert float(((embedded[i] - embedded[j]) ** 2).sum()) == pytest.approx(exact, abs=0.12)


@pytest.mark.parametrize("name", PLANNERS)
def test_every_method_proposes(name: str) -> None:
    problem = bowl_problem(4, views=12 if name in ("uniform", "match-graph") else 0)
    method = PLANNERS[name].make(problem, bowl_settings(method=name))
    assert isinstance(method, FixedDesign) or method.propose(0, (), ()) is not None
