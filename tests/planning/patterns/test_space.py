"""The space of patterns: all that it holds can be flown."""

import numpy as np
import pytest

from fieldkit.planning.patterns.space import PatternSpace
from fieldkit.vehicles.vehicle_file import load_vehicle


@pytest.mark.parametrize("vehicle", ["dji-mavic-3-enterprise", "ardupilot-pitch"])
def test_patterns_keep_the_vehicles_limits(vehicle: str) -> None:
    space = PatternSpace(load_vehicle(vehicle), 1.8)
    for code in space.sample(64, 3):
        pattern = space.decode(code)
        pixel_m = (pattern.height_m - 1.8) / space.vehicle.camera.fx
        assert space.allows(pattern)
        assert pattern.speed_mps * space.vehicle.trigger.shutter_s <= pixel_m + 1e-5
        assert pattern.along_m >= pattern.speed_mps * space.vehicle.trigger.interval_s - 0.02


def test_families_differ_by_their_looks() -> None:
    space = PatternSpace(load_vehicle("dji-mavic-3-enterprise"), 1.0)
    rest = np.full(6, 0.5)
    looks = [space.decode(np.array([share, *rest])).looks for share in np.linspace(0.0, 0.99, 7)]
    assert [len(ways) for ways in looks] == [1, 1, 2, 2, 2, 4, 5]
    assert [look.heading_deg for look in looks[5]] == [45.0, 135.0, 225.0, 315.0]
