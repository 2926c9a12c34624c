"""Expected matches of photographs over a canopy."""

import numpy as np
import pytest

from fieldkit.planning.score.matchability import canopy_matches
from fieldkit.reconstruction.mapping.view_graph import EDGE_FACTOR


def test_matches_fall_with_angle_and_height_and_rise_with_overlap() -> None:
    angle, overlap, height = (axis.ravel() for axis in np.meshgrid([5, 30, 60], [0.2, 0.5, 0.9], [0.5, 1.5, 3.0]))
    usual = canopy_matches(angle, overlap, height)
    assert (canopy_matches(angle, overlap, height + 0.3) < usual).all()
    assert (canopy_matches(angle, 1.1 * overlap, height) > usual).all()
    assert (canopy_matches(angle + 10, overlap, 0.5) < canopy_matches(angle, overlap, 0.5)).all()


@pytest.mark.parametrize(("height_m", "tied"), [(0.8, True), (3.0, False)])
def test_pairs_stand_out_from_chance_where_those_over_rendered_blocks_tied(height_m: float, tied: bool) -> None:
    """At V6 all pairs tied up to 60° apart, at R1 a quarter at 25° and hardly any beyond."""
    angles = np.array([25.0, 35.0, 45.0, 55.0])
    by_chance = canopy_matches(angles, 0.5, 100.0)
    assert ((canopy_matches(angles, 0.5, height_m) > EDGE_FACTOR * by_chance) == tied).all()


def test_matches_by_chance_are_left_where_nothing_else_matches() -> None:
    assert canopy_matches(170.0, 0.5, 3.0) == pytest.approx(20.0, abs=0.5)
