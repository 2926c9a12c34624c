"""A small proxy whose evaluations take seconds."""

from collections.abc import Iterator

import pytest

from fieldkit.geometry import Intrinsics
from fieldkit.planning.objective.simulated import Proxy, SimulatedSource
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.plots import above_soil
from fieldkit.scenes.renderer import RenderingError
from fieldkit.scenes.sampling import sample_visible
from fieldkit_sim.simulation import ring
from tests.scenes.conftest import made_scene

CAMERA = Intrinsics.pinhole(480, 360, 420.0)


@pytest.fixture(scope="session")
def proxy() -> Proxy:
    """Two plants on coarse soil, 480 × 360 pixels, with the plants' own surface as the truth."""
    scene = made_scene()
    return Proxy(scene, *above_soil(sample_visible(scene, (20_000,), 0)[0]), CAMERA)


@pytest.fixture(scope="session")
def source(proxy: Proxy) -> Iterator[SimulatedSource]:
    """A source of `proxy`, kept."""
    made = SimulatedSource(proxy)
    try:
        made.prepare()
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    yield made
    made.close()


@pytest.fixture(scope="session")
def arc() -> Cameras:
    """Six cameras 12° apart."""
    return Cameras.from_poses(ring(30, 1.1, 0.9, (0.15, 0.0, 0.2))[:6])
