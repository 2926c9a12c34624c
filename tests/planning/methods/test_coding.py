"""Cameras and their codes in the unit cube."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.planners.random_sets import CylindricalCoding
from fieldkit.planning.methods.bosfm import Coding
from fieldkit.planning.space.cameras import Cameras
from tests.planning.space.test_envelope import BARE, FLAT, NARROW

envelopes = st.sampled_from([FLAT, NARROW, BARE])
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
    whole = ((code > 0) & (code < 1)).reshape(-1, 5)[:, 3:].all(axis=1)
    np.testing.assert_allclose(back.forward[whole], cameras.forward[whole], atol=1e-9)
    assert envelope.contains(back)


@given(envelopes, st.integers(2, 12), st.integers(0, 2**32))
def test_cameras_come_back_by_azimuth(envelope, count, seed) -> None:
    coding = CylindricalCoding.of(envelope)
    cameras = envelope.sample(count, seed)
    code = coding.encode(cameras)
    azimuths, radii = code.reshape(-1, 5)[:, :2].T
    assert (np.diff(azimuths) >= 0).all()
    assert ((radii > 0) & (radii <= 1)).all()
    order = np.argsort(np.degrees(np.arctan2(*(cameras.positions[:, :2] - coding.center[:2]).T)) % 360.0)
    plain = Coding.of(envelope)
    expected = plain.decode(plain.encode(cameras.select(order)))
    np.testing.assert_allclose(coding.decode(code).vector(), expected.vector(), atol=1e-6)


@given(envelopes, codes)
def test_every_code_looks_at_the_target(envelope, code) -> None:
    coding = Coding.of(envelope)
    cameras = coding.decode(code)
    towards = coding.center - cameras.positions
    along = np.maximum((towards * cameras.forward).sum(axis=1), 0.0)
    past = np.linalg.norm(towards - along[:, None] * cameras.forward, axis=1)
    low, high = envelope.pitch_deg
    free = (cameras.pitch_deg > low) & (cameras.pitch_deg < high)
    assert (past[free] <= np.sqrt(2.0) * coding.reach_m + 1e-9).all()
    again = coding.encode(cameras).reshape(-1, 5)
    np.testing.assert_allclose(again[:, :3], code.reshape(-1, 5)[:, :3], atol=1e-12)
    np.testing.assert_allclose(again[free], code.reshape(-1, 5)[free], atol=1e-6)


@given(envelopes, codes)
def test_what_is_out_of_the_cube_is_cut(envelope, code) -> None:
    coding = Coding.of(envelope)
    far = code.copy()
    far[0::5] += 5.0
    np.testing.assert_allclose(coding.decode(far).positions[:, 0], envelope.x_m[1])


def test_a_code_is_read_as_documented() -> None:
    coding = Coding.of(FLAT)
    x, y, z = coding.center
    reach = coding.reach_m
    south = [x, y - 1.0, z]
    looking = Cameras.aimed([south] * 3, [[x, y, z], [x + 0.5 * reach, y, z], [x, y, z - 0.25 * reach]])
    aims = coding.encode(looking).reshape(-1, 5)[:, 3:]
    np.testing.assert_allclose(aims, [[0.5, 0.5], [0.75, 0.5], [0.5, 0.375]], atol=1e-12)


def test_what_looks_away_is_cut_to_the_side_it_looks_to() -> None:
    coding = Coding.of(FLAT)
    x, y, z = coding.center
    away = Cameras([[x, y - 1.0, z]] * 2, [120.0, -120.0], [0.0, 0.0])
    np.testing.assert_allclose(coding.encode(away).reshape(-1, 5)[:, 3], [1.0, 0.0])


def test_right_above_the_middle_up_is_north() -> None:
    coding = Coding.of(BARE)
    above = Cameras([[*coding.center[:2], BARE.height_m[1]]], [0.0], [-90.0])
    code = coding.encode(above)
    np.testing.assert_allclose(code[3:], 0.5, atol=1e-9)
    np.testing.assert_allclose(coding.decode(code).forward, above.forward, atol=1e-9)


def test_recorded_views_out_of_the_envelope_keep_their_places() -> None:
    target = np.array(BARE.target.center) + 0.02
    views = Cameras.aimed([[9.0, 0.0, 5.0], [0.0, -7.0, 0.1], [0.2, 0.1, 1.2]], target)
    coding = Coding.of(BARE, views)
    back = coding.decode(coding.encode(views))
    np.testing.assert_allclose(back.positions, views.positions, atol=1e-12)
    np.testing.assert_allclose(back.forward, views.forward, atol=1e-9)


def test_a_single_height_has_a_code() -> None:
    level = Coding.of(BARE)
    fixed = replace(level, low=np.array([*level.low[:2], 1.2]), high=np.array([*level.high[:2], 1.2]))
    cameras = Cameras.aimed([[0.1, 0.2, 1.2]], level.center)
    assert fixed.encode(cameras)[2] == 0.5
    np.testing.assert_allclose(fixed.decode(fixed.encode(cameras)).vector(), cameras.vector(), atol=1e-9)


@pytest.mark.parametrize("wrong", [np.zeros(7), np.full(5, np.nan)])
def test_senseless_codes_are_refused(wrong: np.ndarray) -> None:
    with pytest.raises(ValueError):
        Coding.of(FLAT).decode(wrong)
