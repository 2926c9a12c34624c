"""Descriptor matching against brute force."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.matching import match_features
from tests.reconstruction.synthetic import noisy, random_descriptors


def features(descriptors: np.ndarray) -> Features:
    return Features(np.zeros((len(descriptors), 4), np.float32), descriptors.astype(np.uint8))


def related(rng: np.random.Generator, n: int, m: int, shared: int, noise: float = 20.0) -> tuple[Features, Features]:
    """Two sets of descriptors that share some, with noise, in different orders."""
    a = random_descriptors(rng, n)
    b = np.concatenate([noisy(rng, a[rng.permutation(n)[:shared]], noise), random_descriptors(rng, m - shared)])
    return features(a), features(b[rng.permutation(m)])


def brute_force(a: Features, b: Features, ratio: float) -> list[list[int]]:
    def unit(f: Features) -> np.ndarray:
        values = f.descriptors.astype(np.float64)
        return values / np.linalg.norm(values, axis=1, keepdims=True)

    distance = np.maximum(np.linalg.norm(unit(a)[:, None] - unit(b)[None], axis=2), 1e-3)

    def best(row: np.ndarray) -> int:
        order = np.argsort(row, kind="stable")
        runner_up = row[order[1]] if len(row) > 1 else np.inf
        return int(order[0]) if np.isfinite(row[order[0]]) and row[order[0]] <= ratio * runner_up else -1

    forth = [best(row) for row in distance]
    back = [best(column) for column in distance.T]
    return [[i, j] for i, j in enumerate(forth) if j >= 0 and back[j] == i]


@given(
    seed=st.integers(0, 2**31),
    n=st.integers(1, 40),
    m=st.integers(1, 40),
    ratio=st.sampled_from([0.6, 0.8, 0.95, 1.0]),
)
def test_brute_force_finds_the_same(seed: int, n: int, m: int, ratio: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = related(rng, n, m, min(n, m) // 2)
    found = match_features(a, b, ratio=ratio)
    assert found.dtype == np.uint32
    assert found.tolist() == brute_force(a, b, ratio)
