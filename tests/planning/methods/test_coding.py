"""Cameras and their codes in the unit cube."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

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


def test_a_code_is_read_as_documented() -> None:
    coding = Coding.of(FLAT)
    x, y, z = coding.center
    reach = coding.reach_m
    south = [x, y - 1.0, z]
    looking = Cameras.aimed([south] * 3, [[x, y, z], [x + 0.5 * reach, y, z], [x, y, z - 0.25 * reach]])
    aims = coding.encode(looking).reshape(-1, 5)[:, 3:]
    np.testing.assert_allclose(aims, [[0.5, 0.5], [0.75, 0.5], [0.5, 0.375]], atol=1e-12)


def test_right_above_the_middle_up_is_north() -> None:
    coding = Coding.of(BARE)
    above = Cameras([[*coding.center[:2], BARE.height_m[1]]], [0.0], [-90.0])
    code = coding.encode(above)
    np.testing.assert_allclose(code[3:], 0.5, atol=1e-9)
    np.testing.assert_allclose(coding.decode(code).forward, above.forward, atol=1e-9)
