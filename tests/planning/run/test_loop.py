"""The loop: what methods may know, what is logged, and that an interrupted run ends as an unbroken one."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.planners.random_sets import Random
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective
from fieldkit.planning.plan_settings import NoiseSettings, PlanSettings
from fieldkit.planning.problem import Gain, PlanningProblem, Trial, lowest
from fieldkit.planning.run.folder import LogEntry, RunFolder, create_run, open_run
from fieldkit.planning.run.loop import (
    Ending,
    Evaluations,
    Finalist,
    confirm,
    evaluating,
    finalists,
    search,
)
from fieldkit.planning.run.request import resumed_settings
from fieldkit.planning.settings import SearchSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.plan import PlanSource
from fieldkit.runtime.context import Context
from tests.planning.bowl import Bowl, bowl_problem, bowl_settings, here


@dataclass
class Greedy:
    """Moves the best set it knows of by a little; keeps what it was told."""

    problem: PlanningProblem = field(default_factory=bowl_problem)
    told: dict[int, tuple[list[int], list[int]]] = field(default_factory=dict)
    most: int = 1000
    converges: int = 1000

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        self.told[number] = [r.number for r in results], [t.number for t in pending]
        if number >= self.most:
            return None
        gain = Gain(0.001, 0.002) if number >= self.converges else Gain(0.002, 0.001)
        best = min(results, key=lambda r: r.value_m, default=None)
        if best is None:
            return Trial(number, self.problem.sample(number), "random")
        rows = best.cameras.rows() + np.random.default_rng([number, len(pending)]).normal(0, 0.05, (4, 5))
        rows[:, 4] = np.clip(rows[:, 4], -90, 0)
        return Trial(number, self.problem.nearest(Cameras.from_vector(rows)), f"about {best.number}", gain=gain)


def ignore(entry: LogEntry) -> None:
    pass


def plain(entries: Sequence[LogEntry]) -> list[dict[str, object]]:
    """Everything that has to be the same however often a run was interrupted: all but the times, in order."""
    listed = [e.model_dump(exclude={"finished_s", "proposal_cpu_s"}) for e in entries]
    return sorted(listed, key=lambda e: (e["stage"], e["number"], e["seed"]))


def whole_run(run: RunFolder, evaluations: Evaluations, watch: Any = ignore) -> Ending:
    ending = search(Greedy(), evaluations, run, watch=watch)
    chosen, _ = finalists(Greedy(), run)
    confirm(Greedy(), evaluations, run, chosen, watch=watch)
    return ending


def unbroken(tmp_path: Path, settings: SearchSettings) -> list[dict[str, object]]:
    with create_run(tmp_path / "unbroken", settings) as run:
        assert whole_run(run, here(Bowl(noise_m=0.1))) == Ending("evaluations")
        return plain(run.entries)


@contextmanager
def searched(path: Path, evaluator: Bowl, **settings: object) -> Iterator[tuple[Evaluations, RunFolder]]:
    """A run whose search is done, at random."""
    with create_run(path, bowl_settings(**settings)) as run:
        evaluations = here(evaluator)
        search(Random(bowl_problem()), evaluations, run, watch=ignore)
        yield evaluations, run


@pytest.mark.parametrize("lag", [0, 3])
def test_a_method_knows_what_the_lag_says(tmp_path: Path, lag: int) -> None:
    method = Greedy()
    with create_run(tmp_path / "run", bowl_settings(lag=lag)) as run:
        search(method, here(Bowl()), run, watch=ignore)
    for number in range(12):
        known = max(0, number - lag)
        assert method.told[number] == (list(range(known)), list(range(known, number)))


@pytest.mark.parametrize(("stop", "lag"), [(0, 0), (5, 0), (5, 2), (11, 2), (13, 0), (15, 2)])
def test_an_interrupted_run_ends_as_an_unbroken_one(tmp_path: Path, stop: int, lag: int) -> None:
    settings = bowl_settings(lag=lag)
    seen = []

    def break_off(entry: LogEntry) -> None:
        if len(seen) == stop:
            raise KeyboardInterrupt
        seen.append(entry)

    evaluations = here(Bowl(tmp_path, noise_m=0.1))
    with create_run(tmp_path / "run", settings) as run, pytest.raises(KeyboardInterrupt):
        whole_run(run, evaluations, break_off)
    with open_run(tmp_path / "run") as run:
        whole_run(run, evaluations)
        assert plain(run.entries) == unbroken(tmp_path, settings)
    evaluated = (tmp_path / "evaluated").read_text().splitlines()
    assert len(evaluated) == len(set(evaluated)) == 18  # nothing was done twice


def test_the_same_whatever_the_workers_with_one_lag(tmp_path: Path) -> None:
    settings = bowl_settings(lag=6)
    with (
        create_run(tmp_path / "run", settings) as run,
        evaluating(Bowl(noise_m=0.1, seconds=0.02), Context(workers=2)) as pool,
    ):
        whole_run(run, pool)
        assert plain(run.entries) == unbroken(tmp_path, settings)


def test_a_run_stops_when_its_method_has_no_more(tmp_path: Path) -> None:
    with create_run(tmp_path / "run", bowl_settings()) as run:
        assert search(Greedy(most=3), here(Bowl()), run, watch=ignore) == Ending("exhausted")
        assert len(run.entries) == 3


@pytest.mark.parametrize("lag", [0, 2])
def test_a_run_stops_where_nothing_is_left_to_gain_and_goes_on_when_told(tmp_path: Path, lag: int) -> None:
    whole = unbroken(tmp_path, bowl_settings(lag=lag))
    method, evaluations = Greedy(converges=7), here(Bowl(noise_m=0.1))
    stopped = Ending("converged", Gain(0.001, 0.002))
    with create_run(tmp_path / "run", bowl_settings(lag=lag)) as run:
        for _ in range(2):
            assert search(method, evaluations, run, watch=ignore) == stopped
            assert [entry.number for entry in run.entries] == list(range(7))
        run.save_settings(resumed_settings(run.settings, PlanSettings(evaluations=12)))
        assert search(method, evaluations, run, watch=ignore) == Ending("evaluations")
        assert plain(run.entries) == [entry for entry in whole if entry["stage"] == "search"]


class Dull(Bowl):
    """Its values are 3 m and little of the bowl's."""

    def evaluate(self, cameras: Cameras, *, seed: int | None = None, fidelity: Any = None) -> Evaluation:
        found = super().evaluate(cameras, seed=seed, fidelity=fidelity)
        return found.model_copy(update={"value_m": 3.0 + 0.001 * found.value_m})

    def on(self, plot: int) -> Objective:
        return self


def test_without_repeats_finalists_stay_as_the_method_has_them(tmp_path: Path) -> None:
    with searched(tmp_path / "run", Bowl(), repeats=0) as (evaluations, run):
        chosen, _ = finalists(Greedy(), run)
        found = confirm(Greedy(), evaluations, run, chosen, watch=ignore)
        assert [f.trial.number for f in found] == [t.number for t in lowest([e.trial for e in run.entries], 3)]
        assert all((f.value_m, f.spread_m, f.entries) == (None, None, ()) for f in found)
        assert all(entry.stage == "search" for entry in run.entries)


def test_plans_for_a_kind_are_confirmed_on_plots_that_no_trial_has_met(tmp_path: Path) -> None:
    with searched(tmp_path / "run", Dull(noise_m=0.1), plots=4, repeats=3) as (evaluations, run):
        chosen = [entry.trial for entry in run.entries[:2]]
        found: list[Finalist] = confirm(None, evaluations, run, chosen, watch=ignore)
        count = len(run.entries)
        found += confirm(None, evaluations, run, chosen, watch=ignore)
        assert len(run.entries) == count  # nothing is done twice
    assert {entry.plot for entry in run.entries if entry.stage == "search"} == {0}
    for finalist in found:
        assert [entry.plot for entry in finalist.entries] == [4, 5, 6]
        assert len({entry.value_m for entry in finalist.entries}) == 3


@pytest.mark.parametrize(("evaluator", "even_wins"), [(Dull, True), (Bowl, False)])
def test_an_even_subset_is_the_plan_unless_another_is_ahead_of_it(
    tmp_path: Path, evaluator: type[Bowl], even_wins: bool
) -> None:
    with searched(tmp_path / "run", evaluator(), repeats=2, finalists=2) as (evaluations, run):
        worst = lowest([entry.trial for entry in run.entries], 100)[-1]
        chosen, standard = finalists(Greedy(), run, [worst])
        found = confirm(Greedy(), evaluations, run, chosen, watch=ignore, standard=standard)
    assert worst.cameras in [finalist.trial.cameras for finalist in found]
    assert (found[0].trial.cameras == worst.cameras) == even_wins


class Opinionated(Random):
    """Expects most of the set that was confirmed worst."""

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Trial]) -> list[float]:
        return [-float(np.mean([r.value_m for r in results if r.cameras == cameras])) for cameras in sets]


@pytest.mark.parametrize(("plots", "ascending"), [(1, True), (4, False)])
def test_finalists_of_a_kind_are_ranked_by_what_the_method_expects(tmp_path: Path, plots: int, ascending: bool) -> None:
    method = Opinionated(bowl_problem())
    with searched(tmp_path / "run", Dull(), plots=plots, repeats=2, finalists=3) as (evaluations, run):
        chosen, _ = finalists(method, run)
        found = [finalist.value_m for finalist in confirm(method, evaluations, run, chosen, watch=ignore)]
    assert found == sorted(found, reverse=not ascending)


def test_sets_that_change_their_numbers_keep_their_own_values(tmp_path: Path) -> None:
    with searched(tmp_path / "run", Bowl(tmp_path), repeats=2) as (evaluations, run):
        first, second, third = (entry.trial for entry in run.entries[:3])
        once = confirm(None, evaluations, run, [first, second], watch=ignore)
        done = len((tmp_path / "evaluated").read_text().splitlines())
        again = confirm(None, evaluations, run, [replace(third, number=0), replace(first, number=1)], watch=ignore)
    values = {found.trial.cameras: found.value_m for found in once}
    by_number = {f.trial.number: f for f in again}
    assert {number: f.trial.cameras for number, f in by_number.items()} == {0: third.cameras, 1: first.cameras}
    assert by_number[1].value_m == values[first.cameras]
    assert by_number[0].value_m not in values.values()
    assert len((tmp_path / "evaluated").read_text().splitlines()) == done + 2  # the third only


def test_finalists_are_chosen_anew_at_fresh_seeds(tmp_path: Path) -> None:
    with searched(tmp_path / "run", Bowl(noise_m=1.0), evaluations=30, finalists=5, repeats=3) as (evaluations, run):
        chosen, _ = finalists(Greedy(), run)
        confirmed, again = (confirm(Greedy(), evaluations, run, chosen, watch=ignore) for _ in range(2))
        by_search = sorted((e for e in run.entries if e.stage == "search"), key=lambda e: e.value_m)
    assert {f.trial.number for f in confirmed} == {e.number for e in by_search[:5]}
    assert [f.value_m for f in confirmed] == sorted(f.value_m for f in confirmed)
    for found in confirmed:
        assert len({e.seed for e in found.entries}) == 3
        assert not {e.seed for e in found.entries} & {e.seed for e in by_search}
        assert all(e.fidelity == run.settings.confirm_fidelity for e in found.entries)
        assert found.value_m == pytest.approx(np.mean([e.value_m for e in found.entries]))
    assert [f.value_m for f in again] == [f.value_m for f in confirmed]


@pytest.mark.parametrize(
    ("kind", "noise", "seeds"),
    [
        ("scene", NoiseSettings(), 12),
        ("captures", NoiseSettings(), 1),  # recorded as they are
        ("captures", NoiseSettings(pose_m=0.02), 12),
    ],
)
def test_every_trial_has_a_seed_of_its_own(tmp_path: Path, kind: Any, noise: NoiseSettings, seeds: int) -> None:
    with searched(tmp_path / "run", Bowl(), noise=noise, source=PlanSource(kind=kind, name="bowl")) as (_, run):
        assert len({e.seed for e in run.entries}) == seeds


def test_no_set_is_a_finalist_twice() -> None:
    cameras = [bowl_problem().sample(k) for k in (0, 0, 1, 2)]
    results = [Trial(k, cameras[k], "", value_m=value) for k, value in enumerate((1.0, 0.5, 2.0, np.nan))]
    assert [trial.number for trial in lowest(results, 3)] == [1, 2]
