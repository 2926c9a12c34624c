"""Algorithm 1 on cameras: feasible, repeatable, never twice the same, and it gets somewhere; and cameras as codes."""

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.planners.random_sets import Random, TunedBosfm
from fieldkit.clouds import Cloud
from fieldkit.geometry import Intrinsics
from fieldkit.planning.methods.bosfm import Bosfm, Coding, EncodedSpace
from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.planning.space.plots import Plot
from tests.planning.space.test_envelope import BARE, FLAT, NARROW

QUICK = 4
"""Initial trials."""

EFFORT = {"_FITS": 1, "_FIT_ITERATIONS": 8, "_CLIMB_ITERATIONS": 5}
"""Less of it than in a run."""


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in EFFORT.items():
        monkeypatch.setattr(f"fieldkit.planning.surrogate.ensemble.{name}", value)


def problem(count: int, envelope: Envelope = FLAT, views: int = 0) -> PlanningProblem:
    recorded = envelope.sample(views, 77) if views else None
    cloud = Cloud(envelope.plants)
    return PlanningProblem(count, envelope, Intrinsics.pinhole(640, 480, 560.0), (Plot(cloud, cloud.points),), recorded)


def cost(cameras: Cameras) -> float:
    """How far cameras are from 1.2 m height and from a pitch of −40°, in no order; about 0.02 to 0.06."""
    low = (cameras.positions[:, 2] - 1.2) ** 2
    return 0.02 + 0.02 * float(low.mean()) + 1e-5 * float(((cameras.pitch_deg + 40.0) ** 2).mean())


def run(method: Bosfm | Random, count: int) -> list[Trial]:
    results: list[Trial] = []
    for number in range(count):
        trial = method.propose(number, results, ())
        if trial is None:
            break
        results.append(replace(trial, value_m=cost(trial.cameras)))
    return results


@cache
def begun() -> tuple[PlanningProblem, list[Trial]]:
    """Four random trials and two by the models, with the seed 3."""
    plot = problem(4)
    return plot, run(Bosfm(plot, QUICK, 3), 6)


@given(
    st.sampled_from([problem(4), problem(4, NARROW), problem(5, views=9)]),
    st.integers(0, 2**31),
    st.integers(1, 8),
    st.integers(0, 2),
    st.booleans(),
)
@settings(max_examples=12)
def test_every_proposal_is_feasible(plot: PlanningProblem, seed: int, known: int, waiting: int, tuned: bool) -> None:
    method = (TunedBosfm if tuned else Bosfm)(plot, QUICK, seed)
    trials = [Trial(k, plot.sample(seed + k), "given") for k in range(known + waiting)]
    results = [replace(trial, value_m=cost(trial.cameras)) for trial in trials[:known]]
    trial = method.propose(50, results, trials[known:])
    assert plot.contains(trial.cameras)
    assert len(trial.cameras) == plot.count
    assert trial.number == 50
    assert json.loads(json.dumps(trial.notes)) == trial.notes


def test_the_first_trials_are_those_of_random() -> None:
    plot, ours = begun()
    random = run(Random(plot, 3), 6)
    same = [mine.cameras == other.cameras for mine, other in zip(ours, random, strict=True)]
    assert same == [True] * 4 + [False] * 2
    assert [result.origin for result in ours[:4]] == ["random"] * 4
    assert run(Random(plot, 6), 1)[0].cameras != random[0].cameras


def test_notes_tell_the_model_and_the_weights() -> None:
    trial = begun()[1][4]
    assert set(trial.notes) == {"model", "weights"}
    assert set(trial.notes["weights"]) == {"periodic", "rbf", "matern"}
    assert sum(trial.notes["weights"].values()) == pytest.approx(1.0)
    assert trial.origin == f"EI of {trial.notes['model']}"


def test_results_that_are_not_measured_do_not_count() -> None:
    plot, results = begun()
    method = Bosfm(plot, QUICK, 3)
    broken = Trial(6, plot.sample(99), "given")
    with_it, without = method.propose(7, [*results, broken], ()), method.propose(7, results, ())
    assert with_it.cameras == without.cameras
    nothing = method.propose(7, [broken], ())
    assert nothing.origin == "random"


def test_pending_trials_change_the_proposal() -> None:
    plot, results = begun()
    method = Bosfm(plot, QUICK, 3)
    alone = method.propose(6, results, ())
    other = method.propose(6, results, [Trial(5, alone.cameras, "pending")])
    assert other.cameras != alone.cameras
    assert other.notes["weights"] == alone.notes["weights"]


HERE = Path(__file__).parents[3]
OTHER = """
import pytest
from tests.planning.methods.test_bosfm import EFFORT, Bosfm, QUICK, problem, run
for name, value in EFFORT.items():
    pytest.MonkeyPatch().setattr(f"fieldkit.planning.surrogate.ensemble.{name}", value)
print(run(Bosfm(problem(4), QUICK, 3), 6)[-1].cameras.vector().tobytes().hex())
"""


def test_a_recorded_set_is_gone_through_once() -> None:
    plot = problem(3, views=5)
    results = run(Bosfm(plot, QUICK, 0), 20)
    assert len(results) == math.comb(5, 3)
    assert len({result.cameras for result in results}) == len(results)
    broken = [replace(result, value_m=math.nan) for result in results[:-1]]
    last = Bosfm(plot, QUICK, 0).propose(9, broken, ())
    assert last.cameras == results[-1].cameras
    shuffled = [Trial(0, result.cameras.select([2, 0, 1]), "other", value_m=1.0) for result in results]
    assert Bosfm(plot, QUICK, 0).propose(10, shuffled, ()) is None


def test_it_is_better_than_random() -> None:
    plot = problem(3)
    ours = [result.value_m for result in run(Bosfm(plot, 8, 1), 22)]
    random = [result.value_m for result in run(Random(plot, 1), 66)]
    assert min(ours) < min(random)  # though there are three times as many of these


def test_codes_of_recorded_sets_do_not_know_the_order() -> None:
    space = EncodedSpace(problem(4, views=9))
    views = space.problem.views
    code = space.encode(views.select([7, 1, 3, 0]))
    np.testing.assert_array_equal(code, space.encode(views.select([0, 1, 3, 7])))
    assert space.cameras(code) == views.select([0, 1, 3, 7])
    for near in space.around(code, 20, np.random.default_rng(0)):
        chosen = space.cameras(near)
        assert space.problem.contains(chosen)
        kept = {row.tobytes() for row in chosen.positions} & {row.tobytes() for row in space.cameras(code).positions}
        assert 1 <= len(kept) <= 3
    few = EncodedSpace(problem(4, views=6))
    assert len(few.sample(3, np.random.default_rng(0))) == math.comb(6, 4)


envelopes = st.sampled_from([FLAT, NARROW, BARE])
unit = st.floats(0, 1)
codes = st.integers(1, 6).flatmap(lambda n: st.lists(unit, min_size=5 * n, max_size=5 * n)).map(np.array)


@given(envelopes, st.integers(2, 12), st.integers(0, 2**32))
def test_cameras_come_back(envelope, count, seed) -> None:
    coding = Coding.of(envelope)
    cameras = envelope.sample(count, seed)
    code = coding.encode(cameras)
    assert code.shape == (5 * count,)
    assert ((code >= 0) & (code <= 1)).all()
    back = coding.decode(code)
    np.testing.assert_allclose(back.positions, cameras.positions, atol=1e-12)
    whole = ((code > 0) & (code < 1)).reshape(-1, 5)[:, 3:].all(axis=1)
    np.testing.assert_allclose(back.forward[whole], cameras.forward[whole], atol=1e-9)
    assert envelope.contains(back)


@given(envelopes, codes)
def test_every_code_looks_at_the_target(envelope, code) -> None:
    coding = Coding.of(envelope)
    cameras = coding.decode(code)
    towards = coding.center - cameras.positions
    along = np.maximum((towards * cameras.forward).sum(axis=1), 0.0)
    past = np.linalg.norm(towards - along[:, None] * cameras.forward, axis=1)
    low, high = envelope.pitch_deg
    free = (cameras.pitch_deg > low) & (cameras.pitch_deg < high)
    assert (past[free] <= np.sqrt(2.0) * coding.reach_m + 1e-9).all()
    again = coding.encode(cameras).reshape(-1, 5)
    np.testing.assert_allclose(again[:, :3], code.reshape(-1, 5)[:, :3], atol=1e-12)
    np.testing.assert_allclose(again[free], code.reshape(-1, 5)[free], atol=1e-6)


def test_a_code_is_read_as_documented() -> None:
    coding = Coding.of(FLAT)
    x, y, z = coding.center
    reach = coding.reach_m
    south = [x, y - 1.0, z]
    looking = Cameras.aimed([south] * 3, [[x, y, z], [x + 0.5 * reach, y, z], [x, y, z - 0.25 * reach]])
    aims = coding.encode(looking).reshape(-1, 5)[:, 3:]
    np.testing.assert_allclose(aims, [[0.5, 0.5], [0.75, 0.5], [0.5, 0.375]], atol=1e-12)
