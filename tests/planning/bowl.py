"""An objective that answers at once: how far cameras are from a place that is best."""

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.run.loop import Evaluations, Job
from fieldkit.planning.settings import GivenPlot, SearchSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.planning.space.plots import Plot
from fieldkit.results.plan import PlanSource
from fieldkit.vocabulary import SearchFidelity

VOLUME = Volume((-0.5, -0.5, 0.03), (0.5, 0.5, 0.8))
CAMERA = Intrinsics.pinhole(2000, 1500, 1700.0)
BEST = np.array([0.9, -0.8, 1.4])


def bowl_problem(count: int = 4, views: int = 0) -> PlanningProblem:
    """Some points as plants, and an envelope about them; with ``views`` a recorded ring of so many."""
    points = np.random.default_rng(3).uniform(VOLUME.lower, VOLUME.upper, (400, 3))
    normals = np.tile(np.array([0.0, 0.0, 1.0], dtype=np.float32), (400, 1))
    plants = Cloud(points, normals=normals)
    envelope = Envelope.around(plants, VOLUME)
    ring = matches = None
    if views:
        matches = np.full((views, views), 100.0) * (1.0 - np.eye(views))
        turn = 2 * np.pi * np.arange(views) / views
        centers = np.stack([1.5 * np.cos(turn), 1.5 * np.sin(turn), np.full(views, 1.0)], axis=1)
        ring = Cameras.aimed(centers, (0.0, 0.0, 0.4))
    return PlanningProblem(count, envelope, CAMERA, (Plot(plants, points, matches),), ring)


class Here(Executor):
    """Calls at once in this process, with an objective as their first argument as workers have it."""

    def __init__(self, objective: Objective) -> None:
        self.objective = objective
        objective.prepare()

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **keywords: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(function(self.objective, *arguments, **keywords))
        except Exception as error:
            future.set_exception(error)
        return future


class InTurn(Evaluations):
    """One evaluation after the other, each when it is asked for."""

    def each(self, jobs: Iterable[Job]) -> Iterator[Evaluation]:
        return (self.outcome(job, self.submit(job)) for job in jobs)


def here(objective: Objective) -> Evaluations:
    """Evaluations in this process."""
    return InTurn(Here(objective))


class Bowl(Objective):
    """The mean squared distance of the cameras from the best place, with noise by the seed where asked for.

    With a folder every evaluation leaves a line in ``evaluated`` there.
    """

    def __init__(self, folder: Path | None = None, *, noise_m: float = 0.0, seconds: float = 0.0) -> None:
        self.settings, self.seed = ObjectiveSettings(), 0
        self.folder, self.noise_m, self.seconds = folder, noise_m, seconds

    def prepare(self) -> None:
        pass

    def close(self) -> None:
        pass

    def evaluate(
        self, cameras: Cameras, *, seed: int | None = None, fidelity: SearchFidelity | None = None
    ) -> Evaluation:
        time.sleep(self.seconds * (1 + float(cameras.yaw_deg[0]) % 1.0))
        value = float(np.mean(np.sum((cameras.positions - BEST) ** 2, axis=1)))
        rng = np.random.default_rng([seed or 0, *np.frombuffer(cameras.vector().tobytes(), dtype=np.uint32).tolist()])
        value += self.noise_m * abs(float(rng.standard_normal()))
        if self.folder is not None:
            with (self.folder / "evaluated").open("a") as file:
                file.write(f"{value!r} {seed} {fidelity}\n")
        return Evaluation(value_m=value, registered=len(cameras), right=len(cameras), models=1, points=9)


BOWL = PlanSource(kind="scene", name="bowl")


def bowl_settings(source: PlanSource = BOWL, **more: object) -> SearchSettings:
    """Settings of a small run by the method `circle`."""
    given = (GivenPlot(source=source, path="nowhere"),)
    usual: dict[str, object] = {"cameras": 4, "method": "circle", "evaluations": 12, "finalists": 3, "repeats": 2}
    return SearchSettings(fieldkit="0", given=given, **(usual | more))
