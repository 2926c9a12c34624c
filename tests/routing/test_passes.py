from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.results.pattern import Look, Pattern
from fieldkit.routing.passes import lines_over

FIELD = shapely.box(-9.0, -6.0, 9.0, 6.0)


@given(
    heading=st.floats(0.0, 359.0),
    rows=st.floats(0.0, 359.0),
    pitch=st.floats(-90.0, -40.0),
    along=st.floats(0.8, 3.0),
    between=st.floats(0.8, 4.0),
    offset=st.floats(0.0, 1.0),
)
def test_every_place_of_the_field_lies_near_what_some_photograph_of_each_look_points_at(
    heading, rows, pitch, along, between, offset
):
    pattern = Pattern((Look(heading, pitch), Look(heading + 180.0, pitch)), 8.0, along, between, offset)
    lines = lines_over(pattern, FIELD, rows)
    axis = np.radians(heading + rows)
    turn = np.array([[np.sin(axis), np.cos(axis)], [np.cos(axis), -np.sin(axis)]])
    x, y = np.meshgrid(np.linspace(-9.0, 9.0, 13), np.linspace(-6.0, 6.0, 9))
    for yaw in {line.yaw_deg for line in lines}:
        poses = [pose for line in lines if line.yaw_deg == yaw for pose in line.poses]
        aims = np.array([(p.center - p.rotation[2] * p.center[2] / p.rotation[2][2])[:2] for p in poses])
        off = np.abs((np.column_stack([x.ravel(), y.ravel()])[:, None] - aims) @ turn.T)
        near = (off[..., 0] <= 0.5 * along + 1e-6) & (off[..., 1] <= 0.5 * between + 1e-6)
        assert near.any(axis=1).all()


def test_opposite_looks_are_flown_in_turns_to_and_fro():
    pattern = Pattern((Look(0.0, -60.0), Look(180.0, -60.0)), 8.0, 1.5, 3.0)
    lines = lines_over(pattern, FIELD, 0.0)
    across = [line.stations_m[0, 0] for line in lines]
    assert across == sorted(across)
    assert len({line.yaw_deg for line in lines[:2]}) == 2
    turns = [np.linalg.norm(b.stations_m[0, :2] - a.stations_m[-1, :2]) for a, b in pairwise(lines)]
    assert max(turns) < 12.0


def test_a_line_keeps_its_spacing_and_height():
    lines = lines_over(Pattern((Look(90.0, -90.0),), 12.0, 2.0, 4.0), FIELD, 30.0)
    for line in lines:
        assert np.linalg.norm(np.diff(line.stations_m, axis=0), axis=1) == pytest.approx(2.0)
        assert line.stations_m[:, 2] == pytest.approx(12.0)
