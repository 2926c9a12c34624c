"""Air that a hovering vehicle moves, and leaves in moving air."""

import numpy as np
import pytest

from fieldkit.vehicles.wash import air_speed_mps, sway_m, swayed_m


def test_air_is_slower_farther_away() -> None:
    assert air_speed_mps([1.0, 1.5, 2.0, 3.0], 1.0) == pytest.approx([3.7, 2.4, 1.7, 1.1], rel=0.1)
    assert air_speed_mps(1.0, 0.25) == pytest.approx(0.5 * air_speed_mps(1.0, 1.0))
    assert air_speed_mps(1.5, 1.0, 1.5) == pytest.approx(9.0)  # straight below
    assert air_speed_mps(np.hypot(1.5, 1.0), 1.0, 1.5) == air_speed_mps(np.hypot(1.5, 1.0), 1.0)  # beside the wake
    assert air_speed_mps(1.5, 1.0, -1.5) == air_speed_mps(1.5, 1.0)  # above
    below = air_speed_mps(np.linspace(0.1, 10, 50), 1.0, np.linspace(0.1, 10, 50))
    assert (np.diff(below) <= 0).all()
    assert below[-1] == pytest.approx(2.0)
    assert np.isfinite(air_speed_mps(0.0, 1.0))


def test_leaves_move_by_the_speed_of_the_air() -> None:
    assert 0.0025 < sway_m(2.0) < 0.004 < sway_m(2.5)
    assert sway_m(3.0) < 0.010 < sway_m(3.5)
    assert swayed_m(0.003, [1e6, 1.5], 1.0) == pytest.approx([0.003, np.hypot(0.003, sway_m(2.4))])
    assert swayed_m(0.0, np.ones((4, 3)), 1.0).shape == (4, 3)
