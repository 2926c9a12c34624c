"""Feature tracks: matches of image pairs joined over images."""

from __future__ import annotations

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
    members = used[np.argsort(labels[used], kind="stable")]
    boundaries = np.flatnonzero(np.diff(labels[members])) + 1
    image_of = np.repeat(np.arange(len(counts)), counts)
    tracks = []
    for group in np.split(members, boundaries):
        images = image_of[group]
        unique, occurrences = np.unique(images, return_counts=True)
        single = group[np.isin(images, unique[occurrences == 1])]
        if len(single) >= 2:
            tracks.append(tuple((int(image_of[g]), int(g - offsets[image_of[g]])) for g in np.sort(single)))
    return sorted(tracks)
