"""The space of patterns: all that it holds can be flown."""

import numpy as np
import pytest

from fieldkit.planning.patterns.space import SIZE, PatternSpace
from fieldkit.results.pattern import Look, Pattern
from fieldkit.vehicles.vehicle_file import load_vehicle


@pytest.mark.parametrize("vehicle", ["dji-mavic-3-enterprise", "ardupilot-pitch"])
def test_patterns_keep_the_vehicles_limits(vehicle: str) -> None:
    space = PatternSpace(load_vehicle(vehicle), 1.8)
    for code in np.random.default_rng(3).random((64, SIZE)):
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


def test_photographs_far_apart_do_not_match() -> None:
    space, look = PatternSpace(load_vehicle("ardupilot-pitch"), 1.4), Look(90.0, -60.0)
    assert space.matches(Pattern((look,), 8.0, 2.0, 2.5))
    assert not space.matches(Pattern((look,), 8.0, 2.0, 4.0))
    assert not space.matches(Pattern((Look(0.0, -90.0),), 8.0, 2.5, 2.0))
