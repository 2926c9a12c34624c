"""Angles on a circle."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.geometry.pose import wrapped_deg


@given(st.floats(-1e4, 1e4))
def test_the_same_direction_within_half_a_turn(angle: float) -> None:
    wrapped = wrapped_deg(angle)
    assert -180.0 <= wrapped < 180.0 + 1e-9
    assert abs(np.exp(1j * np.radians(angle)) - np.exp(1j * np.radians(wrapped))) < 1e-9


def test_arrays_and_ends() -> None:
    np.testing.assert_array_equal(wrapped_deg(np.array([180.0, -180.0, 190.0, 359.0, 0.0])), [-180, -180, -170, -1, 0])
