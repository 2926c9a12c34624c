"""The feasible set: what is in it, samples of it, and the way into it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.clouds import Cloud, Volume
from fieldkit.errors import UsageError
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope, project

TARGET = Volume((-0.4, -0.3, 0.03), (0.4, 0.3, 0.8))


def plants(seed: int = 0) -> Cloud:
    rng = np.random.default_rng(seed)
    return Cloud(rng.uniform(TARGET.lower, TARGET.upper, (800, 3)))


FLAT = Envelope.around(plants(), TARGET)
NARROW = Envelope.around(
    plants(1), TARGET, height_m=(0.4, 1.8), clearance_m=0.35, pitch_deg=(-80.0, 10.0), separation_m=0.3
)
BARE = Envelope((-1.0, 1.0), (-1.0, 1.0), (1.0, 1.5), TARGET, separation_m=0.0)
envelopes = st.sampled_from([FLAT, NARROW, BARE])
wide = st.floats(-6, 6)
wild = st.integers(2, 12).flatmap(
    lambda n: st.lists(
        st.tuples(wide, wide, wide, st.floats(-180, 179), st.floats(-90, 90)), min_size=n, max_size=n
    ).map(lambda rows: Cameras.from_vector(np.array(rows).reshape(-1)))
)


@given(envelopes, wild)
def test_a_projection_is_inside_and_projects_onto_itself(envelope: Envelope, cameras: Cameras) -> None:
    inside = project(cameras, envelope)
    assert envelope.contains(inside)
    assert project(inside, envelope) == inside
    np.testing.assert_array_equal(inside.yaw_deg, cameras.yaw_deg)


@given(envelopes, st.integers(2, 12), st.integers(0, 2**32))
def test_samples_are_inside_and_repeatable(envelope: Envelope, count: int, seed: int) -> None:
    drawn = envelope.sample(count, seed)
    assert len(drawn) == count
    assert envelope.contains(drawn)
    assert drawn == envelope.sample(count, seed)
    assert drawn != envelope.sample(count, seed + 1)


def test_samples_are_uniform() -> None:
    drawn = np.vstack([BARE.sample(8, seed).positions for seed in range(100)])
    for axis, (low, high) in enumerate([(-1, 1), (-1, 1), (1.0, 1.5)]):
        counts = np.histogram(drawn[:, axis], 4, (low, high))[0]
        assert counts.sum() == 800
        assert (np.abs(counts - 200) < 50).all()


@given(wild)
def test_every_constraint_is_signed(cameras: Cameras) -> None:
    positions, heights = cameras.positions, cameras.positions[:, 2]
    nearest = np.linalg.norm(positions[:, None] - NARROW.plants[None], axis=2).min(axis=1)
    sides = np.abs(positions[:, :2]) - (1.9, 1.8)
    expected = np.max([*sides.T, 0.4 - heights, heights - 1.8, 0.35 - nearest], axis=0)
    np.testing.assert_allclose(NARROW.position_violation(positions), expected, atol=1e-9)
    turned = np.abs(cameras.pitch_deg + 35) - 45
    apart = np.linalg.norm(positions[:, None] - positions, axis=2)[~np.eye(len(cameras), dtype=bool)]
    assert NARROW.contains(cameras) == bool(max(expected.max(), turned.max(), 0.3 - apart.min()) <= 1e-9)


def test_a_projection_is_near() -> None:
    inside = FLAT.sample(10, 3)
    moved = inside.positions.copy()
    moved[4] = (0.1, 0.05, 0.9)  # into the plants' clearance: a way of at most about 0.5 m
    moved[7, 2] = -0.3  # 0.8 m below the band
    found = project(Cameras(moved, inside.yaw_deg, inside.pitch_deg), FLAT)
    way = np.linalg.norm(found.positions - moved, axis=1)
    assert (way[[0, 1, 2, 3, 5, 6, 8, 9]] == 0).all()
    assert 0.2 < way[4] < 0.55
    assert 0.8 <= way[7] < 1.0


def test_an_envelope_without_room_says_so() -> None:
    tight = Envelope((0, 0.1), (0, 0.1), (1, 1.1), TARGET, separation_m=0.5)
    with pytest.raises(UsageError, match="camera 2"):
        tight.sample(2, 0)
    with pytest.raises(UsageError, match="camera 2") as caught:
        project(Cameras(np.zeros((2, 3)), np.zeros(2), np.zeros(2)), tight)
    assert "separation" in caught.value.remedy
