"""The recordings of the stand-in."""

from tests.standin.conftest import delays, flown, probe, recording, sitl

__all__ = ["delays", "flown", "probe", "recording", "sitl"]
