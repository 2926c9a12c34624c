"""Time left by work: unequal steps, what comes from the cache, workers side by side."""

from __future__ import annotations

import pytest

from fieldkit.cli.pace import Pace


def left_after(pace: Pace, moments: list[float]) -> list[float | None]:
    """What is left after each step, one at each moment."""
    found = []
    for count, moment in enumerate(moments, 1):
        pace.done(count, moment)
        found.append(pace.left_s(moment))
    return found


def test_equal_steps() -> None:
    assert left_after(Pace(0.0, 4), [2.0, 4.0, 6.0, 8.0]) == [pytest.approx(6.0), 4.0, 2.0, None]


def test_nothing_is_told_before_the_first_step_nor_without_a_total() -> None:
    assert Pace(0.0, 4).left_s(10.0) is None
    pace = Pace(0.0, 0)
    pace.done(1, 5.0)
    assert pace.left_s(5.0) is None


def test_steps_count_by_their_work() -> None:
    """Two quick steps, then two of eight times their work: by count, 2 s would be left after 2 s, and not 16."""
    found = left_after(Pace(0.0, 4, [1, 1, 8, 8]), [1.0, 2.0, 10.0, 18.0])
    assert found == [pytest.approx(17.0), pytest.approx(16.0), pytest.approx(8.0), None]


def test_what_the_cache_gave_says_nothing_of_the_rest() -> None:
    pace = Pace(0.0, 100)
    pace.done(50, 0.1)
    pace.done(51, 10.1)
    assert pace.left_s(10.1) == pytest.approx(490.0)
    pace.done(52, 20.1)
    assert pace.left_s(20.1) == pytest.approx(480.0)


def test_workers_end_their_steps_together() -> None:
    """Six steps of 10 s on two workers: 20 s are left when the first of them ends, and not 50."""
    found = left_after(Pace(0.0, 6, workers=2), [9.9, 10.0, 19.9, 20.0, 29.9, 30.0])
    assert found[:4] == [pytest.approx(each, rel=0.05) for each in (20.0, 20.0, 10.0, 10.0)]
    assert found[4] is not None
    assert 0 < found[4] < 10.0
    assert found[5] is None


def test_it_runs_down_between_steps_and_never_below_zero() -> None:
    pace = Pace(0.0, 2)
    pace.done(1, 10.0)
    assert pace.left_s(14.0) == pytest.approx(6.0)
    assert pace.left_s(30.0) == 0.0
