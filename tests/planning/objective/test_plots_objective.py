"""Evaluations on several plots of a kind, by workers that share what they build."""

from pathlib import Path

import numpy as np
import pytest

from fieldkit.planning.objective.objective import ObjectiveSettings, PlotsObjective
from fieldkit.planning.objective.simulated import Kind, Proxy, SimulatedSource
from fieldkit.planning.run.evaluations import Job, evaluating
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.context import Context
from fieldkit.scenes.description import ReferenceSampling, SceneDescription
from fieldkit.sites.fitted import Stretch
from tests.planning.conftest import CAMERA
from tests.scenes.conftest import SMALL_PLOT

BASE = SceneDescription(SMALL_PLOT, camera=CAMERA, reference=ReferenceSampling(points=5_000))


class LoggedKind(Kind):
    """Leaves a line in ``built`` for every scene that is built."""

    def proxy(self, number: int) -> Proxy:
        with (self.folder / "built").open("a") as file:
            file.write(f"{number}\n")
        return super().proxy(number)


@pytest.mark.slow
def test_each_plot_is_built_once_for_all_workers(
    source: SimulatedSource, arc: Cameras, tmp_path: Path
) -> None:  # the source says whether anything can be rendered here
    kind = LoggedKind((BASE,), 0, tmp_path)
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
    assert alone == found[1]
    assert flown == fitted != alone
