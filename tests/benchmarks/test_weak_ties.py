"""Rings with gaps."""

import pytest

from benchmarks.weak_ties import with_gaps


@pytest.mark.parametrize(("views", "count", "phase"), [(72, 13, 0), (72, 10, 5), (60, 13, 59), (80, 10, 1)])
def test_two_gaps_opposite_each_other_hold_no_photograph(views: int, count: int, phase: int) -> None:
    chosen = with_gaps([str(k) for k in range(views)], count, phase)
    assert len(set(chosen)) == count
    angles = sorted(((int(name) - phase) % views) * 360 / views for name in chosen)
    steps = sorted((b - a) % 360 for a, b in zip(angles, [*angles[1:], angles[0]], strict=True))
    half_view = 180 / views
    assert all(abs(step - 55) <= 2 * half_view for step in steps[-2:])
    assert steps[-3] < 40
    assert all(27.5 - half_view <= angle <= 332.5 + half_view for angle in angles)
