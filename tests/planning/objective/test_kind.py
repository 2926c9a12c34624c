"""Plots of a kind, as planning knows them, as they are photographed, and as workers share what they build."""

import pickle
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from fieldkit.clouds import Cloud, write_ply
from fieldkit.planning.objective.objective import ObjectiveSettings, PlotsObjective
from fieldkit.planning.objective.simulated import Kind, Proxy, SimulatedSource
from fieldkit.planning.run.loop import Job, evaluating
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.plots import Plot
from fieldkit.runtime.context import Context
from fieldkit.scenes.description import Bounds, ReferenceSampling, SceneDescription
from fieldkit.scenes.recorded import RecordedSurface
from fieldkit.sites.fitted import Stretch
from fieldkit_sim.generator import new_scene
from tests.planning.conftest import CAMERA
from tests.scenes.conftest import SMALL_PLOT, make_row


def test_a_recorded_plot_is_photographed_as_it_is_known(tmp_path: Path) -> None:
    row = make_row()
    write_ply(tmp_path / "plants.ply", row.cloud)
    ground = np.column_stack([np.random.default_rng(0).uniform(-0.5, 0.5, (400, 2)), np.zeros(400)])
    write_ply(tmp_path / "ground.ply", Cloud(ground, np.full((400, 3), 90, np.uint8)))
    surface = RecordedSurface(tmp_path / "plants.ply", tmp_path / "ground.ply", 0.004, 0.05)
    bounds = Bounds((-0.4, -0.2, -0.05), (0.4, 0.2, 0.5))
    kind = Kind((SceneDescription(recorded=surface, bounds=bounds, camera=CAMERA),), 3)
    plots = [kind.plot(number) for number in range(3)]
    np.testing.assert_array_equal(plots[0][0].reference.points, kind.plot(0)[0].reference.points)
    for number, (plot, volume) in enumerate(plots):
        proxy = pickle.loads(pickle.dumps(kind)).proxy(number)  # as a worker has it
        for ours, theirs in ((volume.lower, proxy.volume.lower), (volume.upper, proxy.volume.upper)):
            np.testing.assert_allclose(ours, theirs, atol=1e-5)
        known, photographed = (np.sort(c.points, axis=0) for c in (plot.reference, proxy.reference))
        np.testing.assert_allclose(known, photographed, atol=1e-5)  # a PLY's coordinates are rounded
    assert len({plot.reference.points.tobytes() for plot, _ in plots}) == 1


def test_of_several_given_plots_each_is_there_and_each_is_drawn_of() -> None:
    first, second = new_scene(2, 11), new_scene(2, 12)
    kind, alone = Kind((first, second), 0), Kind((first,), 0)
    points = [kind.plot(number)[0].reference.points for number in range(4)]
    for number, description in enumerate((first, second)):
        np.testing.assert_array_equal(points[number], Plot.of(description)[0].reference.points)
    np.testing.assert_array_equal(points[2], alone.plot(1)[0].reference.points)
    assert len({each.tobytes() for each in points}) == 4


BASE = SceneDescription(SMALL_PLOT, camera=CAMERA, reference=ReferenceSampling(points=5_000))


@dataclass(frozen=True)
class LoggedKind(Kind):
    """Leaves a line in ``built`` for every scene that is built."""

    built: Path = Path()

    def proxy(self, number: int) -> Proxy:
        with self.built.open("a") as file:
            file.write(f"{number}\n")
        return super().proxy(number)


@pytest.mark.slow
def test_each_plot_is_built_once_for_all_workers(
    source: SimulatedSource, arc: Cameras, tmp_path: Path
) -> None:  # the source says whether anything can be rendered here
    kind = LoggedKind((BASE,), 0, built=tmp_path / "built")
    objective = PlotsObjective(kind, ObjectiveSettings("draft"))
    plots = [0, 1, 2, 0, 1, 2]
    with evaluating(objective, Context(workers=2)) as pool:
        found = list(pool.each(Job(arc, 5, plot=plot) for plot in plots))
    assert sorted((tmp_path / "built").read_text().split()) == ["0", "1", "2"]
    digests = [evaluation.cloud_digest for evaluation in found]
    assert digests[:3] == digests[3:]
    assert len(set(digests)) == 3
    stretch = Stretch(np.array([-0.3, -0.2, 0.0]), np.array([0.3, 0.2, 0.4]), np.array([1.0, 1.0, 1.2]))
    fitting = PlotsObjective(kind, ObjectiveSettings("draft"), stretches={1: stretch})
    alone = objective.on(1).evaluate(arc, seed=5)  # in this process, of the same scene
    flown = objective.on(1).evaluate(arc.stretched(stretch), seed=5)
    fitted = fitting.on(1).evaluate(arc, seed=5)
    for each in (objective, fitting):
        each.close()
    assert alone.cloud_digest == found[1].cloud_digest
    assert flown.cloud_digest == fitted.cloud_digest != alone.cloud_digest
