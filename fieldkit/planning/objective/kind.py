"""The plots of a run, the given ones and others drawn of their kind, and their objectives."""

from __future__ import annotations

import pickle
import shutil
import tempfile
import weakref
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.files import lock, write_atomic
from fieldkit.geometry import Intrinsics
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.objective.simulated import Proxy, SimulatedSource
from fieldkit.planning.space.plots import Plot, of_interest
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.from_reference import SCENE_FILE
from fieldkit.scenes.plants_apart import PlantsApart, tell_apart
from fieldkit.scenes.recorded import recorded_plants
from fieldkit.scenes.recorded_kind import Variation, bounds_around, draw_variation, varied_cloud, write_varied_scene
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import CaptureNoise, Outdoors
from fieldkit.scenes.simulated_field import simulated_field
from fieldkit.sites.fitted import Stretch

_SEEDS_APART = 1_000_003
"""Distance between the seeds of two given plots, so that their draws differ."""


@dataclass(frozen=True)
class Kind:
    """Plots by number: first the given ones, then others drawn of each of them in turn.

    For a simulated plot they come from `plots_of_kind`. For one made from a reference, plants that can be told apart
    are turned, scaled and left out; else the whole plot is turned and mirrored (`draw_variation`). Plot k does not
    depend on the number of plots.
    """

    descriptions: tuple[SceneDescription, ...]
    """Of the given plots, all simulated or all recorded. The first one's camera effects apply to all."""
    seed: int
    folder: Path
    """Where scenes of recorded plots are written."""

    @cached_property
    def recorded(self) -> tuple[tuple[Cloud, PlantsApart], ...]:
        """Each recorded plot's plants, and how they are told apart; empty for simulated plots."""
        clouds = [recorded_plants(each.recorded) for each in self.descriptions if each.recorded is not None]
        return tuple((cloud, tell_apart(cloud)) for cloud in clouds)

    def plot(self, number: int) -> tuple[Plot, Volume]:
        """The plot as known without a photograph. Raises SceneError."""
        given, drawn = self._origin(number)
        if not drawn or not self.recorded:
            return Plot.of(self._simulated(number))
        cloud, apart = self.recorded[given]
        varied = varied_cloud(cloud, apart, self._variation(number))
        bounds = self.descriptions[given].bounds
        description = replace(self.descriptions[given], bounds=bounds_around(bounds, varied))
        reference, volume = of_interest(description, varied)
        return Plot.without_others(reference), volume

    def proxy(self, number: int, camera: Intrinsics) -> Proxy:
        """The proxy to photograph. Raises SceneError, StorageError."""
        given, drawn = self._origin(number)
        description = self._simulated(number)
        if drawn and self.recorded:
            made = self.folder / f"{number}"
            if not made.is_dir():
                write_varied_scene(description, self.recorded[given][1], self._variation(number), made)
            description = read_scene(made / SCENE_FILE)
        return Proxy.from_description(description, camera)

    def source(self, proxy: Proxy, noise: CaptureNoise, outdoors: Outdoors) -> SimulatedSource:
        """The source of a plot's photographs."""
        return SimulatedSource.of_scene(self.descriptions[0], proxy, noise, outdoors)

    def _origin(self, number: int) -> tuple[int, int]:
        """The given plot that a plot is drawn of, and the number of the draw; draw 0 is the given plot itself."""
        return number % len(self.descriptions), number // len(self.descriptions)

    def _seed(self, given: int) -> int:
        return self.seed + _SEEDS_APART * given

    def _variation(self, number: int) -> Variation:
        given, drawn = self._origin(number)
        cloud, apart = self.recorded[given]
        return draw_variation(cloud, apart, self._seed(given), drawn - 1)

    def _simulated(self, number: int) -> SceneDescription:
        """A simulated plot; for a recorded one the given plot itself."""
        given, drawn = self._origin(number)
        description = self.descriptions[given]
        if not drawn or description.recorded is not None:
            return description
        generator = simulated_field("generator")
        plots: tuple[SceneDescription, ...] = generator.plots_of_kind(description, drawn, self._seed(given))
        return plots[-1]


_OPEN = 2
"""Number of plots that a process keeps ready to render; another renderer takes a second to start."""


class PlotsObjective:
    """Objectives by the plots' numbers; see `executor.Evaluator`.

    A plot's scene takes 17 CPU s to build. The first process that needs it shares it with the machine's other processes
    in a temporary folder, which is removed with this object.

    Args:
        build: makes a plot's proxy; picklable.
        source: makes the source of photographs from a plot's proxy; picklable.
        stretches: by plots' numbers, for those that cameras are fitted to.
    """

    def __init__(
        self, build: Callable[[int], Proxy], source: Callable[[Proxy], SimulatedSource],
        settings: ObjectiveSettings, *, seed: int = 0, stretches: Mapping[int, Stretch] | None = None,
    ) -> None:  # fmt: skip
        self._build, self._source, self.settings, self.seed = build, source, settings, seed
        self._stretches = stretches or {}
        self._shared = Path(tempfile.mkdtemp(prefix="fieldkit-plots-"))
        weakref.finalize(self, shutil.rmtree, self._shared, ignore_errors=True)
        self._open: OrderedDict[int, Objective] = OrderedDict()

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_open": OrderedDict()}

    def prepare(self) -> None:
        """Raises RenderingError: this machine cannot render."""
        Renderer(Scene(())).close()

    def on(self, plot: int) -> Objective:
        """The plot's objective. Raises SceneError."""
        if plot not in self._open:
            self._open[plot] = Objective(
                self._source(self._proxy(plot)), self.settings, seed=self.seed, stretch=self._stretches.get(plot)
            )
            if len(self._open) > _OPEN:
                self._open.popitem(last=False)[1].close()
        self._open.move_to_end(plot)
        return self._open[plot]

    def close(self) -> None:
        """Free the renderers."""
        for objective in self._open.values():
            objective.close()
        self._open.clear()

    def _proxy(self, plot: int) -> Proxy:
        if not self._shared.is_dir():  # on another machine
            return self._build(plot)
        file = self._shared / f"{plot}.pickle"
        with (self._shared / f"{plot}.lock").open("wb") as held:
            with suppress(OSError):  # without locks it is built twice
                lock(held.fileno(), wait=True)  # the second process waits for the first one's scene
            if not file.is_file():
                write_atomic(file, pickle.dumps(self._build(plot), pickle.HIGHEST_PROTOCOL))
            proxy: Proxy = pickle.loads(file.read_bytes())
        return proxy
