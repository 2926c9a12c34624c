"""Points as blocks: what comes out again is what went in."""

import base64
import gzip

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.arrays import ByteArray, FloatArray, IntArray
from fieldkit.report.html.viewer import NO_VALUE, PackedPoints, pack_points


def unpacked(block: PackedPoints) -> tuple[FloatArray, ByteArray, ByteArray]:
    """As the module's docstring describes a block, in other words than `pack_points`."""
    data = np.frombuffer(gzip.decompress(base64.b64decode(block.text)), dtype=np.uint8)
    n = block.count
    high, low = data[: 3 * n].astype(np.int64), data[3 * n : 6 * n].astype(np.int64)
    zigzag = (high * 256 + low).reshape(3, n)
    steps = np.where(zigzag % 2 == 0, zigzag // 2, -(zigzag + 1) // 2)
    grid = np.cumsum(steps, axis=1) % 65536
    rest = data[6 * n :]
    tones = np.zeros((n, 3), dtype=np.uint8)
    if block.colored:
        green, red, blue = np.cumsum(rest[: 3 * n].reshape(3, n).astype(np.int64), axis=1) % 256
        tones = np.stack([(red + green) % 256, green, (blue + green) % 256], axis=1).astype(np.uint8)
        rest = rest[3 * n :]
    levels = rest[:n] if block.valued else np.zeros(n, dtype=np.uint8)
    assert len(rest) == (n if block.valued else 0)
    return grid.T * block.step + np.array(block.origin), tones, levels


def by_color(tones: ByteArray) -> IntArray:
    return np.lexsort(tones.T)


@given(
    count=st.integers(1, 400),
    scale=st.sampled_from([0.0, 1e-6, 0.3, 2.0, 50.0, 3000.0]),
    offset=st.sampled_from([0.0, -4.0, 5.2e6]),
    seed=st.integers(0, 1000),
)
def test_there_and_back(count: int, scale: float, offset: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 1, (count, 3)) * scale + offset
    identity = np.arange(count)
    colors = np.stack([identity % 256, identity // 256, rng.integers(0, 256, count)], axis=1).astype(np.uint8)
    values = rng.uniform(-0.01, 0.05, count)
    values[rng.random(count) < 0.2] = np.nan
    block = pack_points(points, colors, values, limit=0.02)
    found, tones, levels = unpacked(block)
    assert block.count == count
    back, there = by_color(tones[:, :2]), by_color(colors[:, :2])  # the first two channels number the points
    np.testing.assert_array_equal(tones[back], colors[there])
    extent = float(np.ptp(points, axis=0).max())
    assert block.step <= max(1e-4, extent / 65535)
    np.testing.assert_allclose(found[back], points[there], rtol=0, atol=0.5001 * block.step + 1e-9)
    known = ~np.isnan(values[there])
    assert (levels[back][~known] == NO_VALUE).all()
    expected = np.clip(values[there][known] / 0.02, 0, 1) * 254
    np.testing.assert_allclose(levels[back][known], expected, atol=0.5001)


def test_points_that_are_nowhere_are_left_out_with_their_colours() -> None:
    points = np.array([[0, 0, 0], [np.nan, 0, 0], [1, 1, 1], [0, np.inf, 0]], dtype=np.float32)
    colors = np.array([[1, 1, 1], [2, 2, 2], [3, 3, 3], [4, 4, 4]], dtype=np.uint8)
    found, tones, _ = unpacked(pack_points(points, colors))
    assert sorted(tones[:, 0]) == [1, 3]
    np.testing.assert_allclose(found[np.argsort(tones[:, 0])], [[0, 0, 0], [1, 1, 1]], atol=1e-4)
