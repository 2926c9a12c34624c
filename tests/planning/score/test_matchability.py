"""How likely photographs over a canopy tie, against what was counted on rendered blocks."""

import numpy as np
import pytest

from fieldkit.planning.score.matchability import canopy_matches, ties


def test_ties_fall_with_angle_and_height_and_rise_with_overlap() -> None:
    angle, overlap, height = (axis.ravel() for axis in np.meshgrid([5, 30, 60], [0.2, 0.5, 0.9], [0.5, 1.5, 3.0]))
    usual = ties(angle, overlap, height)
    assert ((usual > 0) & (usual < 1)).all()
    assert (ties(angle + 10, overlap, height) < usual).all()
    assert (ties(angle, overlap, height + 0.3) < usual).all()
    assert (ties(angle, 1.1 * overlap, height) > usual - 1e-9).all()
    assert ties(60.0, 0.1, 1.5) < 0.8 * ties(60.0, 0.3, 1.5)
    assert ties(10.0, 0.0, 1.0) < 1e-9


@pytest.mark.parametrize(
    ("height_m", "shares"),
    [
        (0.8, {15: 1.0, 25: 1.0, 35: 1.0, 45: 1.0, 55: 1.0}),
        (1.6, {15: 1.0, 25: 0.8, 35: 0.57, 45: 0.63, 55: 0.54}),
        (3.0, {25: 0.25, 35: 0.1, 45: 0.1, 55: 0.0}),
    ],
)
def test_pairs_tie_as_often_as_over_rendered_blocks(height_m: float, shares: dict[int, float]) -> None:
    """Shares of the pairs within 5° of an angle; at half overlap."""
    assert ties(list(shares), 0.5, height_m) == pytest.approx(list(shares.values()), abs=0.25)


def test_matches_by_chance_are_left_where_nothing_else_matches() -> None:
    assert canopy_matches(170.0, 0.5, 3.0) == pytest.approx(20.0, abs=0.5)
