"""Photographs find their stations by pose, in any order and whatever offset a receiver has."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.geometry.stations import PoseArray, associate


def ring(count: int, radius: float = 1.5) -> PoseArray:
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    positions = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(count, 1.4)], axis=1)
    yaws = (270.0 - np.degrees(angles)) % 360.0
    return PoseArray(positions, yaws, np.full(count, -35.0))


@given(
    seed=st.integers(0, 10_000),
    shift=st.tuples(st.floats(-4, 4), st.floats(-4, 4), st.floats(-60, 60)),
    lost=st.integers(0, 4),
    angles=st.booleans(),
)
def test_any_order_and_offset(seed: int, shift: tuple[float, float, float], lost: int, angles: bool) -> None:
    """A ring of 13 turned by its headings; without them a triangle of odd sides would do, here the noise is small."""
    rng = np.random.default_rng(seed)
    stations = ring(13)
    if not angles:  # an uneven ring has one way to lie only
        stations = PoseArray(stations.positions + np.random.default_rng(5).normal(0, 0.25, (13, 3)), *_unknown(13))
    order = rng.permutation(13)[: 13 - lost]
    noise = rng.normal(0.0, 0.02, (len(order), 3))
    photographs = PoseArray(
        stations.positions[order] + shift + noise,
        stations.yaws[order] + rng.normal(0, 1, len(order)),
        stations.pitches[order],
    )
    found = associate(photographs, stations)
    assert found.station_of == dict(enumerate(order.tolist()))
    assert found.offset_m == pytest.approx(shift, abs=0.06)


def _unknown(count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.full(count, np.nan), np.full(count, np.nan)


def test_another_plot_is_none_of_this_plan() -> None:
    stations = ring(7)
    elsewhere = PoseArray(stations.positions + np.array([0.0, 14.0, 0.0]), stations.yaws, stations.pitches)
    found = associate(elsewhere, stations)
    assert found.station_of == {}
    assert np.isnan(found.offset_m).all()
    assert associate(PoseArray.of([]), stations).station_of == {}


def test_a_displaced_photograph_belongs_to_no_station() -> None:
    stations = ring(7)
    positions = stations.positions + np.array([0.4, 0.0, 0.0])
    positions[2] += np.array([0.0, 0.0, 5.0])
    found = associate(PoseArray(positions, stations.yaws, stations.pitches), stations)
    assert found.station_of == {k: k for k in range(7) if k != 2}
    assert found.offset_m == pytest.approx([0.4, 0.0, 0.0])


def test_a_known_offset_is_kept_to() -> None:
    stations = ring(5)
    found = associate(stations, PoseArray.of([((1.5, 0.0, 1.4), None, None)]), offset_m=np.zeros(3))
    assert found.station_of == {0: 0}
    assert found.offset_m == pytest.approx(np.zeros(3))
