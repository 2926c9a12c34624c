"""Two dates of a plot: older plants, and the table of ways to fly the second."""

from benchmarks.next_visit import older
from fieldkit.planning.space.plots import Plot
from fieldkit_sim.generator import new_scene


def test_plants_are_a_stage_older_and_higher_where_they_stood() -> None:
    young = new_scene(2, 5)
    old = older(young)
    before, after = (Plot.of(scene)[0].reference.points for scene in (young, old))
    assert after[:, 2].max() > 1.02 * before[:, 2].max()
    assert [(p.x_m, p.y_m) for p in old.plot.plants] == [(p.x_m, p.y_m) for p in young.plot.plants]


def test_the_oldest_plants_stay_as_they_are() -> None:
    scene = new_scene(1, 5, stages=("R1",))
    assert older(scene) == scene
