"""The tuning scenes that the objective is measured on."""

from __future__ import annotations

from dataclasses import dataclass

from fieldkit.geometry import Intrinsics
from fieldkit.planning.cameras import Cameras
from fieldkit.planning.envelope import Envelope
from fieldkit.planning.simulated import Proxy
from fieldkit.scenes.benchmark import benchmark_scene
from fieldkit.scenes.plot import PlotDescription, build_scene, plant_layout
from fieldkit.scenes.rigs import ring
from fieldkit.scenes.soil import SoilDescription

SCENES = 3
CAMERA = Intrinsics.pinhole(2000, 1500, 1700.0)
VIEWS = 10
_RADIUS_M, _HEIGHT_M = 1.45, 1.15


@dataclass(frozen=True, eq=False)
class TuningPlot:
    """A tuning scene ready for the objective.

    Attributes:
        name: of the scene.
        proxy: the scene and its truth.
        envelope: its feasible set.
        ring: ten cameras on a circle, the plain plan.
    """

    name: str
    proxy: Proxy
    envelope: Envelope
    ring: Cameras


def tuning_description(index: int) -> PlotDescription:
    """One of three plots that parameters may be chosen on: a row of 3 plants, two rows of 5, and 6 at random.

    Raises:
        ValueError: no such scene.
    """
    if index in (0, 1):
        return benchmark_scene("tuning", index)
    if index == 2:
        return PlotDescription(plant_layout(6, 13, layout="random"), SoilDescription(seed=13))
    raise ValueError(f"there is no tuning scene {index}: it is 0, 1 or 2")


def tuning_plot(index: int, camera: Intrinsics = CAMERA, description: PlotDescription | None = None) -> TuningPlot:
    """A tuning scene, built (or another one by its description)."""
    proxy = Proxy.of(build_scene(description or tuning_description(index)), camera)
    envelope = Envelope.around(proxy.reference, proxy.volume)
    target = proxy.volume.center
    circle = Cameras.from_poses(ring(VIEWS, _RADIUS_M, _HEIGHT_M, (target[0], target[1], 0.25)))
    return TuningPlot(f"tuning {index}", proxy, envelope, circle)
