"""Positions that lag behind their photographs are told from right ones, and from others that are wrong."""

import numpy as np
import pytest

from fieldkit.geometry import Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.reconstruction.mapping.blind import find_lag

_MODEL = Similarity(0.3, rotation_from_vector([0.4, -1.0, 2.0]), [5.0, 1.0, -2.0])


def passes(count: int) -> np.ndarray:
    """Photographs every two metres of a flight to and fro, passes 3 m apart."""
    along = [(2.0 * k if row % 2 == 0 else 2.0 * (5 - k), 3.0 * row, 10.0) for row in range(4) for k in range(6)]
    return np.array(along[:count])


@pytest.mark.parametrize("lag", [-2.0, -1.0, 0.5, 1.0, 1.5])
def test_a_lag_is_found_from_a_model_of_any_scale(lag: float) -> None:
    flown = passes(24)
    rng, number = np.random.default_rng(0), np.arange(24)
    recorded = np.stack([np.interp(number - lag, number, column) for column in flown.T], axis=1)
    found = find_lag(_MODEL.apply(flown + rng.normal(0.0, 0.03, flown.shape)), recorded)
    assert found is not None
    assert found.photographs == pytest.approx(lag, abs=0.3)
    assert found.metres == pytest.approx(2.0 * abs(lag), rel=0.3)


@pytest.mark.parametrize(
    "recorded",
    [
        passes(24) + np.random.default_rng(1).normal(0.0, 1.0, (24, 3)),  # a coarse receiver
        np.random.default_rng(2).permutation(passes(24)),  # of other photographs
        passes(6),  # one line is moved into itself
        passes(5),
    ],
)
def test_other_positions_have_none(recorded: np.ndarray) -> None:
    assert find_lag(_MODEL.apply(passes(len(recorded))), recorded) is None
