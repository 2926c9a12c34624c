"""The recordings of the stand-in."""

from tests.sim.standin.conftest import delays, flown, probe, recording, sitl

__all__ = ["delays", "flown", "probe", "recording", "sitl"]
