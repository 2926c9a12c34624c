"""The plots of a run: the one that is planned on, and others drawn of its kind."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics
from fieldkit.planning.plots import Plot, of_interest
from fieldkit.planning.simulated import Proxy, SimulatedSource
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.from_reference import SCENE_FILE
from fieldkit.scenes.generator import plots_of_kind
from fieldkit.scenes.plants_apart import PlantsApart, tell_apart
from fieldkit.scenes.recorded import recorded_plants
from fieldkit.scenes.recorded_kind import bounds_around, draw_variation, varied_cloud, write_varied_scene
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import CaptureNoise


@dataclass(frozen=True)
class Kind:
    """Plots by number: 0 is the description's own, number k is the same however many there are.

    Of a simulated plot they are `plots_of_kind`; of one made from a reference its plants turned, scaled and left out
    where they can be told apart, else the whole plot turned and mirrored (`draw_variation`).

    Attributes:
        description: of the plot that is planned on.
        seed: of all draws.
        folder: where scenes of recorded plots are written.
    """

    description: SceneDescription
    seed: int
    folder: Path

    @cached_property
    def recorded(self) -> tuple[Cloud, PlantsApart] | None:
        """A recorded plot's plants, and how they are told apart; None of a simulated one."""
        if self.description.recorded is None:
            return None
        cloud = recorded_plants(self.description.recorded)
        return cloud, tell_apart(cloud)

    def plot(self, number: int) -> tuple[Plot, Volume]:
        """What is known of a plot without a photograph. Raises SceneError."""
        if number == 0 or self.recorded is None:
            return Plot.of(self._simulated(number))
        cloud, apart = self.recorded
        varied = varied_cloud(cloud, apart, draw_variation(cloud, apart, self.seed, number - 1))
        description = replace(self.description, bounds=bounds_around(self.description.bounds, varied))
        reference, volume = of_interest(description, varied)
        return Plot.without_others(reference), volume

    def proxy(self, number: int, camera: Intrinsics) -> Proxy:
        """A plot to photograph. Raises SceneError, StorageError."""
        description = self._simulated(number)
        if number and self.recorded is not None:
            cloud, apart = self.recorded
            made = self.folder / f"{number}"
            if not made.is_dir():
                write_varied_scene(self.description, apart, draw_variation(cloud, apart, self.seed, number - 1), made)
            description = read_scene(made / SCENE_FILE)
        return Proxy.from_description(description, camera)

    def source(self, proxy: Proxy, noise: CaptureNoise, wind_m: float) -> SimulatedSource:
        """Of a plot's photographs."""
        return SimulatedSource.of_scene(self.description, proxy, noise, wind_m)

    def _simulated(self, number: int) -> SceneDescription:
        if number == 0 or self.description.recorded is not None:
            return self.description
        return plots_of_kind(self.description, number, self.seed)[-1]
