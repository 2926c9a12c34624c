"""Two dates of a plot: older plants, and the table of ways to fly the second."""

from __future__ import annotations

from benchmarks.next_visit import Visited, older, visit_table
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.space.plots import Plot
from fieldkit_sim.generator import new_scene


def evaluation(value_m: float, right: int) -> Evaluation:
    return Evaluation(value_m, value_m, None, None, {}, 10, 10, right, 1, 100, "", ())


def test_plants_are_a_stage_older_and_higher_where_they_stood() -> None:
    young = new_scene(2, 5)
    old = older(young)
    before, after = (Plot.of(scene)[0].reference.points for scene in (young, old))
    assert after[:, 2].max() > 1.02 * before[:, 2].max()
    assert [(p.x_m, p.y_m) for p in old.plot.plants] == [(p.x_m, p.y_m) for p in young.plot.plants]


def test_ways_are_held_against_the_carried_plan() -> None:
    found = {"carried": [0.004, 0.006], "fitted": [0.005, 0.005], "next": [0.004, 0.005]}
    evaluations = {
        way: [evaluation(value, 10 - (way == "carried")) for value in values] for way, values in found.items()
    }
    row, mean = visit_table([Visited("a", 1.08, 12.3, evaluations)]).rows
    assert row == ("a", "1.08", "5.00", "5.00", "4.50", "0.90", "9.0 / 10.0 / 10.0", "12")
    assert mean[2:6] == ("1.00", "1.00", "0.90", "0.90")


def test_the_oldest_plants_stay_as_they_are() -> None:
    scene = new_scene(1, 5, stages=("R1",))
    assert older(scene) == scene
