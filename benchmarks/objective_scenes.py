"""The tuning scenes of the objective's studies."""

from __future__ import annotations

from dataclasses import dataclass

from fieldkit.clouds.cloud import Cloud
from fieldkit.planning.objective.simulated import SimulatedSource
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.planning.space.projection import project
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.scene_file import read_scene
from fieldkit_sim.simulation import ring_about

SCENES = ("tuning-1", "tuning-2", "tuning-3")
"""A row of three plants, five on a grid, and four at random between neighbour rows."""
VIEWS = 10


@dataclass(frozen=True, eq=False)
class TuningPlot:
    """A tuning scene, built for the objective."""

    name: str
    """Of the scene."""
    source: SimulatedSource
    """Of its photographs."""
    envelope: Envelope
    """Its feasible set."""
    ring: Cameras
    """Ten cameras on a circle at which the plants fill the picture, made feasible: the plain plan."""


def tuning_plot(name: str = SCENES[0]) -> TuningPlot:
    """One of fieldkit's scenes, built."""
    source = SimulatedSource.from_description(read_scene(find_scene(name)))
    proxy = source.proxy
    envelope = Envelope.around(Cloud(proxy.plot.points), proxy.volume)
    circle = Cameras.from_poses(ring_about(VIEWS)(proxy.scene, proxy.camera))
    return TuningPlot(name, source, envelope, project(circle, envelope))
