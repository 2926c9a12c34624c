"""Rows, their spacing and gaps, from plants' places alone."""

import numpy as np
import pytest

from fieldkit.arrays import FloatArray
from fieldkit.clouds.plants_apart import find_rows


def field(rows: int, each: int, turn_deg: float = 0.0, off_m: float = 0.01) -> FloatArray:
    """Rows 0.75 m apart, plants 0.2 m apart, up to ``off_m`` from their places; row by row."""
    places = np.array([(0.2 * k, 0.75 * row) for row in range(rows) for k in range(each)])
    places += np.random.default_rng(0).uniform(-off_m, off_m, places.shape)
    angle = np.radians(turn_deg)
    return np.asarray(places @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]))


@pytest.mark.parametrize("turn_deg", [0.0, 37.0, -80.0])
def test_rows_in_any_direction(turn_deg: float) -> None:
    rows = find_rows(field(2, 6, turn_deg))
    assert rows is not None
    assert rows.row.tolist() == [1] * 6 + [2] * 6
    assert rows.spacing_m == pytest.approx(0.2, abs=0.005)
    assert rows.gaps == 0
    assert rows.in_row.tolist() == [*range(1, 7)] * 2


@pytest.mark.parametrize(("missing", "gaps"), [((2,), 1), ((2, 3), 2), ((1, 8), 2), ((0,), 0)])
def test_gaps_are_between_plants_of_a_row(missing: tuple[int, ...], gaps: int) -> None:
    rows = find_rows(np.delete(field(2, 6), missing, axis=0))
    assert rows is not None
    assert rows.gaps == gaps


def test_no_rows() -> None:
    assert find_rows(field(1, 3)) is None  # too few
    scattered = np.array([(0.19, 0.25), (-0.24, -0.24), (-0.08, 0.0), (0.0, -0.29), (-0.23, 0.28), (0.24, -0.07)])
    assert find_rows(scattered) is None
