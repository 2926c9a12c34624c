"""Cameras and their codes in the unit cube."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.planning.cameras import Cameras
from fieldkit.planning.coding import Coding
from tests.planning.test_envelope import BARE, FLAT, SLOPED

envelopes = st.sampled_from([FLAT, SLOPED, BARE])
unit = st.floats(0, 1)
codes = st.integers(1, 6).flatmap(lambda n: st.lists(unit, min_size=5 * n, max_size=5 * n)).map(np.array)


@given(envelopes, st.integers(2, 12), st.integers(0, 2**32))
def test_cameras_come_back(envelope, count, seed) -> None:
    coding = Coding.of(envelope)
    cameras = envelope.sample(count, seed)
    code = coding.encode(cameras)
    assert code.shape == (5 * count,)
    assert ((code >= 0) & (code <= 1)).all()
    back = coding.decode(code)
    np.testing.assert_allclose(back.positions, cameras.positions, atol=1e-12)
    np.testing.assert_allclose(back.forward, cameras.forward, atol=1e-12)
    assert envelope.contains(back)


@given(envelopes, codes)
def test_codes_come_back(envelope, code) -> None:
    coding = Coding.of(envelope)
    difference = np.abs(coding.encode(coding.decode(code)) - code).reshape(-1, 5)
    difference[:, 3] = np.minimum(difference[:, 3], 1 - difference[:, 3])
    np.testing.assert_allclose(difference, 0, atol=1e-12)


@given(envelopes, codes, st.integers(-3, 3))
def test_yaw_wraps_and_the_rest_is_cut(envelope, code, turns) -> None:
    coding = Coding.of(envelope)
    turned = code.copy()
    turned[3::5] += turns
    np.testing.assert_allclose(coding.decode(turned).forward, coding.decode(code).forward, atol=1e-9)
    far = code.copy()
    far[0::5] += 5.0
    np.testing.assert_allclose(coding.decode(far).positions[:, 0], envelope.x_m[1])


def test_a_code_is_read_as_documented() -> None:
    a, b, c = SLOPED.ground
    x, y = 0.5 * sum(SLOPED.x_m), SLOPED.y_m[0]
    cameras = Cameras([[x, y, a * x + b * y + c + 1.8]], [-180.0], [-80.0])
    np.testing.assert_allclose(Coding.of(SLOPED).encode(cameras), [0.5, 0.0, 1.0, 0.0, 0.0], atol=1e-12)
    north = Coding.of(SLOPED).decode(np.array([0.5, 0.5, 0.5, 0.5, 1.0]))
    assert north.yaw_deg[0] == 0.0
    assert north.pitch_deg[0] == 10.0


def test_recorded_views_out_of_the_envelope_keep_their_places() -> None:
    views = Cameras([[9.0, 0.0, 5.0], [0.0, -7.0, 0.1], [0.2, 0.1, 1.2]], [0.0, 90.0, -90.0], [-95 + 10, 45.0, 0.0])
    coding = Coding.of(BARE, views)
    np.testing.assert_allclose(coding.decode(coding.encode(views)).vector(), views.vector(), atol=1e-12)


def test_a_single_height_has_a_code() -> None:
    level = Coding.of(BARE)
    fixed = Coding(np.where(np.arange(5) == 2, 1.2, level.low), np.where(np.arange(5) == 2, 1.2, level.high), (0, 0, 0))
    cameras = Cameras([[0.1, 0.2, 1.2]], [10.0], [-20.0])
    assert fixed.encode(cameras)[2] == 0.5
    np.testing.assert_allclose(fixed.decode(fixed.encode(cameras)).vector(), cameras.vector(), atol=1e-12)


@pytest.mark.parametrize("wrong", [np.zeros(7), np.full(5, np.nan)])
def test_senseless_codes_are_refused(wrong: np.ndarray) -> None:
    with pytest.raises(ValueError):
        Coding.of(FLAT).decode(wrong)
