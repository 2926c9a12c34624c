"""Descriptor matching: mutual best with the ratio test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, Float32Array, IntArray
from fieldkit.reconstruction.features import Features

_CHUNK_ROWS = 1024  # of the similarity matrix: 32 MB against 8192 features
_EXACT = 1e-6  # squared distance below which descriptors are the same, so that twins at distance 0 are ambiguous too


@dataclass
class _BestTwo:
    """The two highest similarities seen per entry and the index of the highest."""

    index: IntArray
    first: Float32Array
    second: Float32Array

    @classmethod
    def empty(cls, n: int) -> _BestTwo:
        return cls(np.full(n, -1), np.full(n, -np.inf, np.float32), np.full(n, -np.inf, np.float32))


def match_features(a: Features, b: Features, *, ratio: float = 0.8) -> NDArray[np.uint32]:
    """Mutual nearest neighbours that pass Lowe's ratio test in both directions.

    ``ratio`` is the largest of the best to the second best descriptor distance (Lowe 2004). Gives (k, 2) indices into
    ``a`` and ``b``, sorted by the first.
    """
    if len(a) == 0 or len(b) == 0:
        return np.zeros((0, 2), np.uint32)
    left, right = _unit(a), _unit(b)
    rows, columns = _BestTwo.empty(len(a)), _BestTwo.empty(len(b))
    for start in range(0, len(a), _CHUNK_ROWS):
        part = slice(start, min(start + _CHUNK_ROWS, len(a)))
        similarity = left[part] @ right.T
        _update_columns(columns, similarity, start)
        here = np.arange(len(similarity))
        best = similarity.argmax(axis=1)
        rows.index[part], rows.first[part] = best, similarity[here, best]
        similarity[here, best] = -np.inf
        rows.second[part] = similarity.max(axis=1)
    good_rows, good_columns = _passes_ratio(rows, ratio), _passes_ratio(columns, ratio)
    candidates = np.flatnonzero(good_rows)
    partners = rows.index[candidates]
    mutual = (columns.index[partners] == candidates) & good_columns[partners]
    return np.stack([candidates[mutual], partners[mutual]], axis=1).astype(np.uint32)


def _unit(features: Features) -> Float32Array:
    descriptors = features.descriptors.astype(np.float32)
    unit: Float32Array = descriptors / np.maximum(np.linalg.norm(descriptors, axis=1, keepdims=True), 1e-12)
    return unit


def _update_columns(columns: _BestTwo, similarity: Float32Array, start: int) -> None:
    here = np.arange(similarity.shape[1])
    first = similarity.max(axis=0)
    # Not argmax(axis=0), which transposes the matrix first and so takes several times as long as all of this.
    hits = np.flatnonzero(similarity == np.where(np.isfinite(first), first, np.nan))[::-1]
    best = np.zeros(len(here), np.int64)
    best[hits % len(here)] = hits // len(here)  # of equals the first, which is written last
    similarity[best, here] = -np.inf
    second = similarity.max(axis=0)
    similarity[best, here] = first
    better = first > columns.first
    columns.second = np.maximum(np.minimum(first, columns.first), np.maximum(second, columns.second))
    columns.index = np.where(better, best + start, columns.index)
    columns.first = np.maximum(first, columns.first)


def _passes_ratio(best: _BestTwo, ratio: float) -> BoolArray:
    """Distances of unit vectors are √(2 − 2 cos); no second candidate passes, no first does not."""
    nearest = np.sqrt(np.maximum(2.0 - 2.0 * best.first, _EXACT))
    runner_up = np.sqrt(np.maximum(2.0 - 2.0 * best.second, _EXACT))
    passes: BoolArray = np.isfinite(best.first) & (nearest <= ratio * runner_up)
    return passes
