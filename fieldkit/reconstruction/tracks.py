"""Feature tracks: matches of image pairs joined over images."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

Track = tuple[tuple[int, int], ...]
"""((image index, feature index), …), sorted, at most one feature per image."""


def build_tracks(counts: list[int], matches: Mapping[tuple[int, int], NDArray[np.uint32]]) -> list[Track]:
    """Join matches into tracks.

    Args:
        counts: features per image.
        matches: (k, 2) feature indices per pair (i, j) of image indices.

    Returns:
        Tracks of at least two images, in the order of their first observation. Where a track holds several
        features of an image (some match in it is wrong), that image's observations are dropped from it.
    """
    offsets = np.concatenate([[0], np.cumsum(counts)])
    left = [offsets[i] + m[:, 0].astype(np.int64) for (i, _), m in matches.items() if len(m)]
    right = [offsets[j] + m[:, 1].astype(np.int64) for (_, j), m in matches.items() if len(m)]
    if not left:
        return []
    rows, columns = np.concatenate(left), np.concatenate(right)
    total = int(offsets[-1])
    graph = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(total, total))
    _, labels = connected_components(graph, directed=False)
    used = np.unique(np.concatenate([rows, columns]))
    images = np.repeat(np.arange(len(counts)), counts)[used]
    _, at, occurrences = np.unique(labels[used] * len(counts) + images, return_inverse=True, return_counts=True)
    single = occurrences[at] == 1
    used, images = used[single], images[single]
    by_track = np.argsort(labels[used], kind="stable")
    ends = np.flatnonzero(np.diff(labels[used[by_track]])) + 1
    elements = list(zip(images[by_track].tolist(), (used - offsets[images])[by_track].tolist(), strict=True))
    starts = [0, *ends.tolist(), len(elements)]
    return sorted(tuple(elements[a:b]) for a, b in itertools.pairwise(starts) if b - a >= 2)
