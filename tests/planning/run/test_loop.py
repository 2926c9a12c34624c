"""The loop: what methods may know, what is logged, and that an interrupted run ends as an unbroken one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.planners.random_sets import Random
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective
from fieldkit.planning.plan_settings import NoiseSettings, PlanSettings
from fieldkit.planning.problem import Gain, PlanningProblem, Result, Trial, lowest
from fieldkit.planning.run.evaluations import Evaluations, evaluating
from fieldkit.planning.run.folder import LogEntry, RunFolder, create_run, open_run
from fieldkit.planning.run.loop import Ending, confirm, evaluate_again, search
from fieldkit.planning.run.request import resumed_settings
from fieldkit.planning.settings import SearchSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.plan import PlanSource
from fieldkit.runtime.context import Context
from tests.planning.bowl import Bowl, bowl_problem, bowl_settings, here


@dataclass
class Greedy:
    """Moves the best set it knows of by a little; keeps what it was told."""

    problem: PlanningProblem
    told: dict[int, tuple[list[int], list[int]]] = field(default_factory=dict)
    most: int = 1000
    converges: int = 1000
    name: str = "greedy"

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial | None:
        self.told[number] = [r.trial.number for r in results], [t.number for t in pending]
        if number >= self.most:
            return None
        gain = Gain(0.001, 0.002) if number >= self.converges else Gain(0.002, 0.001)
        best = min(results, key=lambda r: r.value_m, default=None)
        if best is None:
            return Trial(number, self.problem.sample(number), "random")
        rng = np.random.default_rng([number, len(pending)])
        z = best.trial.cameras.vector() + rng.normal(0, 0.05, 5 * self.problem.count)
        table = z.reshape(-1, 5)
        table[:, 4] = np.clip(table[:, 4], -90, 0)
        return Trial(number, self.problem.nearest(Cameras.from_vector(z)), f"about {best.trial.number}", gain=gain)


def never(seconds: float) -> bool:
    return False


def ignore(entry: LogEntry) -> None:
    pass


def plain(entries: Sequence[LogEntry]) -> list[dict[str, object]]:
    """Everything that has to be the same however often a run was interrupted: all but the times, in order."""
    listed = [e.model_dump(exclude={"finished_s", "proposal_cpu_s"}) for e in entries]
    return sorted(listed, key=lambda e: (e["stage"], e["number"], e["seed"]))


def serial(folder: Path | None = None, noise_m: float = 0.0) -> Evaluations:
    return here(Bowl(folder, noise_m=noise_m))


def unbroken(tmp_path: Path, settings: SearchSettings) -> list[dict[str, object]]:
    with create_run(tmp_path / "unbroken", settings) as run:
        evaluations = serial(noise_m=0.1)
        assert search(Greedy(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore) == Ending(
            "evaluations"
        )
        confirm(Greedy(bowl_problem()), evaluations, run, watch=ignore)
        return plain(run.entries)


def test_without_repeats_finalists_stay_as_the_method_has_them(tmp_path: Path) -> None:
    settings = bowl_settings(repeats=0)
    with create_run(tmp_path / "run", settings) as run:
        evaluations = serial()
        search(Greedy(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore)
        found = confirm(Greedy(bowl_problem()), evaluations, run, watch=ignore)
        assert [f.trial.number for f in found] == [t.number for t in lowest([e.result for e in run.entries], 3)]
        assert all((f.value_m, f.spread_m, f.entries) == (None, None, ()) for f in found)
        assert all(entry.stage == "search" for entry in run.entries)


@pytest.mark.parametrize("lag", [0, 1, 3])
def test_a_method_knows_what_the_lag_says(tmp_path: Path, lag: int) -> None:
    method = Greedy(bowl_problem())
    with create_run(tmp_path / "run", bowl_settings(lag=lag)) as run:
        evaluations = serial()
        search(method, evaluations, run, out_of_time=never, watch=ignore)
    for number in range(12):
        known = max(0, number - lag)
        assert method.told[number] == (list(range(known)), list(range(known, number)))


@pytest.mark.parametrize("stop", [0, 1, 5, 11, 13, 15])
@pytest.mark.parametrize("lag", [0, 2])
def test_an_interrupted_run_ends_as_an_unbroken_one(tmp_path: Path, stop: int, lag: int) -> None:
    settings = bowl_settings(lag=lag)
    whole = unbroken(tmp_path, settings)
    seen = 0

    def break_off(entry: LogEntry) -> None:
        nonlocal seen
        if seen == stop:
            raise KeyboardInterrupt
        seen += 1

    def go(run: RunFolder, evaluations: Evaluations, watch: object) -> None:
        search(Greedy(bowl_problem()), evaluations, run, out_of_time=never, watch=watch)
        confirm(Greedy(bowl_problem()), evaluations, run, watch=watch)

    with create_run(tmp_path / "run", settings) as run:
        evaluations = serial(tmp_path, noise_m=0.1)
        with pytest.raises(KeyboardInterrupt):
            go(run, evaluations, break_off)
    with open_run(tmp_path / "run") as run:
        evaluations = serial(tmp_path, noise_m=0.1)
        go(run, evaluations, ignore)
        assert plain(run.entries) == whole
    evaluated = (tmp_path / "evaluated").read_text().splitlines()
    assert len(evaluated) == len(set(evaluated)) == 18  # nothing was done twice


def test_more_evaluations_extend_a_finished_run(tmp_path: Path) -> None:
    long = unbroken(tmp_path, bowl_settings(evaluations=20))
    settings = bowl_settings(evaluations=9)
    with create_run(tmp_path / "run", settings) as run:
        evaluations = serial(noise_m=0.1)
        search(Greedy(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore)
        confirm(Greedy(bowl_problem()), evaluations, run, watch=ignore)
    with open_run(tmp_path / "run") as run:
        evaluations = serial(noise_m=0.1)
        run.save_settings(run.settings.model_copy(update={"evaluations": 20}))
        search(Greedy(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore)
        searched = [e for e in plain(run.entries) if e["stage"] == "search"]
    assert searched == [e for e in long if e["stage"] == "search"]


def test_the_same_whatever_the_workers_with_one_lag(tmp_path: Path) -> None:
    settings = bowl_settings(lag=6)
    whole = unbroken(tmp_path, settings)
    with (
        create_run(tmp_path / "run", settings) as run,
        evaluating(Bowl(noise_m=0.1, seconds=0.02), Context(workers=2)) as pool,
    ):
        search(Greedy(bowl_problem()), pool, run, out_of_time=never, watch=ignore)
        confirm(Greedy(bowl_problem()), pool, run, watch=ignore)
        assert plain(run.entries) == whole


def test_a_run_stops_when_its_time_is_up_or_its_method_is(tmp_path: Path) -> None:
    with create_run(tmp_path / "a", bowl_settings()) as run:
        evaluations = serial()
        full: Callable[[float], bool] = lambda _: len(run.entries) >= 5  # noqa: E731
        ending = search(Greedy(bowl_problem()), evaluations, run, out_of_time=full, watch=ignore)
        assert ending == Ending("time")
        assert len(run.entries) == 5
    with create_run(tmp_path / "b", bowl_settings()) as run:
        evaluations = serial()
        ending = search(Greedy(bowl_problem(), most=3), evaluations, run, out_of_time=never, watch=ignore)
        assert ending == Ending("exhausted")
        assert len(run.entries) == 3


@pytest.mark.parametrize("lag", [0, 2])
def test_a_run_stops_where_nothing_is_left_to_gain_and_goes_on_when_told(tmp_path: Path, lag: int) -> None:
    whole = unbroken(tmp_path, bowl_settings(lag=lag))
    method = Greedy(bowl_problem(), converges=7)
    stopped = Ending("converged", Gain(0.001, 0.002))
    with create_run(tmp_path / "run", bowl_settings(lag=lag)) as run:
        evaluations = serial(noise_m=0.1)
        assert search(method, evaluations, run, out_of_time=never, watch=ignore) == stopped
        assert [entry.number for entry in run.entries] == list(range(7))
    with open_run(tmp_path / "run") as run:
        evaluations = serial(noise_m=0.1)
        assert search(method, evaluations, run, out_of_time=never, watch=ignore) == stopped
        assert len(run.entries) == 7
        run.save_settings(resumed_settings(run.settings, PlanSettings(evaluations=12)))
        assert search(method, evaluations, run, out_of_time=never, watch=ignore) == Ending("evaluations")
        assert plain(run.entries) == [entry for entry in whole if entry["stage"] == "search"]


class Bowls(Bowl):
    """Bowls of several plots, each deeper than the one before."""

    def on(self, plot: int) -> Objective:
        return Bowl(self.folder, noise_m=0.1 * plot)


class Dull(Bowl):
    """Its values are 3 m and little of the bowl's."""

    def evaluate(self, cameras: Cameras, *, seed: int | None = None, fidelity: Any = None) -> Evaluation:
        found = super().evaluate(cameras, seed=seed, fidelity=fidelity)
        return replace(found, value_m=3.0 + 0.001 * found.value_m)

    def on(self, plot: int) -> Objective:
        return self


def test_plans_for_a_kind_are_confirmed_on_plots_that_no_trial_has_met(tmp_path: Path) -> None:
    settings = bowl_settings(plots=4, repeats=3)
    with create_run(tmp_path / "run", settings) as run:
        evaluations = here(Dull(noise_m=0.1))
        search(Random(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore)
        chosen = [entry.trial for entry in run.entries[:2]]
        first = evaluate_again(evaluations, run, chosen, watch=ignore)
        count = len(run.entries)
    with open_run(tmp_path / "run") as run:
        evaluations = here(Dull(noise_m=0.1))
        again = evaluate_again(evaluations, run, chosen, watch=ignore)
        assert len(run.entries) == count  # nothing is done twice
    assert {entry.plot for entry in run.entries if entry.stage == "search"} == {0}
    for found in (*first, *again):
        assert [entry.plot for entry in found.entries] == [4, 5, 6]
        assert len({entry.value_m for entry in found.entries}) == 3


@pytest.mark.parametrize(
    ("evaluator", "nearer", "rounds"), [(Dull, 0.0, [3, 3, 3]), (Dull, 0.2, [1, 1, 1]), (Bowls, 0.0, [1, 1, 1])]
)
def test_finalists_of_a_kind_race_as_long_as_noise_could_change_who_leads(
    tmp_path: Path, evaluator: type[Bowl], nearer: float, rounds: list[int]
) -> None:
    with create_run(tmp_path / "run", bowl_settings(plots=4, repeats=3, finalists=3)) as run:
        evaluations = here(evaluator())
        search(Random(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore)
        ordered = lowest([entry.result for entry in run.entries], 100)
        chosen = ordered[:3] if evaluator is Dull else [ordered[0], *ordered[-2:]]
        standard = chosen[1].cameras
        found = evaluate_again(evaluations, run, chosen, watch=ignore, standard=standard, nearer=nearer)
    assert [len(finalist.entries) for finalist in found] == rounds
    assert found[0].trial.cameras == ordered[0].cameras or evaluator is Dull


def test_an_even_subset_is_the_plan_unless_another_is_ahead_of_it(tmp_path: Path) -> None:
    for evaluator, even_wins in ((Dull, True), (Bowl, False)):
        with create_run(tmp_path / evaluator.__name__, bowl_settings(repeats=2, finalists=2)) as run:
            evaluations = here(evaluator())
            search(Random(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore)
            worst = lowest([entry.result for entry in run.entries], 100)[-1]
            found = confirm(Greedy(bowl_problem()), evaluations, run, watch=ignore, even=[worst])
        assert worst.cameras in [finalist.trial.cameras for finalist in found]
        assert (found[0].trial.cameras == worst.cameras) == even_wins


class Opinionated(Random):
    """Expects most of the set that was confirmed worst."""

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Result]) -> list[float]:
        return [-float(np.mean([r.value_m for r in results if r.trial.cameras == each])) for each in sets]


def test_finalists_of_a_kind_are_ranked_by_what_the_method_expects(tmp_path: Path) -> None:
    for plots, ascending in ((1, True), (4, False)):
        settings = bowl_settings(plots=plots, repeats=2, finalists=3)
        with create_run(tmp_path / f"{plots}", settings) as run:
            evaluations = here(Dull())
            method = Opinionated(bowl_problem())
            search(method, evaluations, run, out_of_time=never, watch=ignore)
            found = [finalist.value_m for finalist in confirm(method, evaluations, run, watch=ignore)]
        assert found == sorted(found, reverse=not ascending)


def test_sets_that_change_their_numbers_keep_their_own_values(tmp_path: Path) -> None:
    with create_run(tmp_path / "run", bowl_settings(repeats=2)) as run:
        evaluations = serial(tmp_path)
        search(Random(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore)
        first, second, third = (entry.trial for entry in run.entries[:3])
        once = evaluate_again(evaluations, run, [first, second], watch=ignore)
        done = len((tmp_path / "evaluated").read_text().splitlines())
        renumbered = [replace(third, number=0), replace(first, number=1)]
        again = evaluate_again(evaluations, run, renumbered, watch=ignore)
    values = {found.trial.cameras: found.value_m for found in once}
    assert {f.trial.number: f.trial.cameras for f in again} == {0: third.cameras, 1: first.cameras}
    assert next(f.value_m for f in again if f.trial.number == 1) == values[first.cameras]
    assert next(f.value_m for f in again if f.trial.number == 0) not in values.values()
    assert len((tmp_path / "evaluated").read_text().splitlines()) == done + 2  # the third only


def test_finalists_are_chosen_anew_at_fresh_seeds(tmp_path: Path) -> None:
    settings = bowl_settings(evaluations=30, finalists=5, repeats=3)
    with create_run(tmp_path / "run", settings) as run:
        evaluations = serial(noise_m=1.0)
        search(Random(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore)
        confirmed = confirm(Greedy(bowl_problem()), evaluations, run, watch=ignore)
        by_search = sorted((e for e in run.entries if e.stage == "search"), key=lambda e: e.value_m)
        again = confirm(Greedy(bowl_problem()), evaluations, run, watch=ignore)
    assert {f.trial.number for f in confirmed} == {e.number for e in by_search[:5]}
    assert [f.value_m for f in confirmed] == sorted(f.value_m for f in confirmed)
    for found in confirmed:
        assert len({e.seed for e in found.entries}) == 3
        assert not {e.seed for e in found.entries} & {e.seed for e in by_search}
        assert all(e.fidelity == settings.confirm_fidelity for e in found.entries)
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
    settings = bowl_settings(noise=noise, source=PlanSource(kind=kind, name="bowl"))
    with create_run(tmp_path / "run", settings) as run:
        evaluations = serial()
        search(Random(bowl_problem()), evaluations, run, out_of_time=never, watch=ignore)
    assert len({e.seed for e in run.entries}) == seeds


def test_no_set_is_a_finalist_twice() -> None:
    cameras = [bowl_problem().sample(k) for k in (0, 0, 1, 2)]
    values = [1.0, 0.5, 2.0, 0.1]
    results = [
        Result(Trial(k, c, ""), v, measured=k != 3) for k, (c, v) in enumerate(zip(cameras, values, strict=True))
    ]
    assert [trial.number for trial in lowest(results, 3)] == [1, 2]
