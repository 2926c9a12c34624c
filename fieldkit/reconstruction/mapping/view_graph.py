"""The view graph: which pairs hold a model together, and what it may use of the others.

Two photographs far apart share few right matches, while a narrow band gives every pair some by chance. Such pairs pull
cameras away by centimetres: they are as many as the good ones, and a point of two views only contradicts no other. What
can be trusted of them touches a point of a good pair, for three views must agree about it, or is without a rival in a
much wider band, where chance matches hardly pass the ratio test.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fieldkit.reconstruction.guided import Band, PosedFeatures, epipolar_distances, match_guided
from fieldkit.wording import by_key

Pair = tuple[int, int]
Matches = dict[Pair, NDArray[np.uint32]]
EDGE_FACTOR = 3.0
"""Factor between an edge's matches and those of the null model, a wrong geometry."""
EDGE_MATCHES = 20
"""Least matches of an edge of the view graph."""
_SHIFT = 15.0
"""Displacement of the null model's band, in its half widths."""
_CLEARLY = 1.5
"""Factor by which one displaced band must tell an edge for the other not to be asked."""
_RIVALS = 4.0
"""Width of the band in which a match may have no rival, in widths of its own."""


def null_model_matches(a: PosedFeatures, b: PosedFeatures, band: Band) -> float:
    """How many matches a wrong epipolar geometry gives: the mean over two displaced bands."""
    return float(np.mean([_displaced(a, b, side, band) for side in (-1, 1)]))


def is_edge(a: PosedFeatures, b: PosedFeatures, found: int, band: Band, *, least: int = EDGE_MATCHES) -> bool:
    """Whether ``found`` matches are far above the null model's, which one displaced band tells where it is clear."""
    if found < least:
        return False
    chance = _displaced(a, b, -1, band)
    if not found / _CLEARLY < EDGE_FACTOR * chance < found * _CLEARLY:
        return found >= EDGE_FACTOR * chance
    chance += _displaced(a, b, 1, band)
    return found >= EDGE_FACTOR * chance / 2.0


def rivalless_matches(a: PosedFeatures, b: PosedFeatures, band: Band) -> NDArray[np.uint32]:
    """(k, 2) those of the band's matches that pass the ratio test in a band four times as wide, too."""
    wide = match_guided(a, b, replace(band, px=_RIVALS * band.px))
    return wide[epipolar_distances(a, b, wide) <= band.px]


def usable_matches(
    counts: Sequence[int],
    matches: Mapping[Pair, NDArray[np.uint32]],
    edges: Collection[Pair],
    rivalless: Callable[[int, int], NDArray[np.uint32]],
    *,
    least: int = EDGE_MATCHES,
) -> Matches:
    """What a model is made of: all matches of the view graph's edges, and of the other pairs what is missing.

    Args:
        matches: (k, 2) feature indices per pair (i, j) of image indices.
        rivalless: those of a pair's matches that have no rival in a wider band.
        least: features in edges below which an image lacks them.

    Returns:
        Of another pair, those matches that touch a feature of an edge or have no rival, if one of its images lacks
        edges or no chain of edges joins the two; all of them if both lack edges.
    """
    connected = [np.zeros(count, np.bool_) for count in counts]
    for i, j in edges:
        connected[i][matches[i, j][:, 0]] = True
        connected[j][matches[i, j][:, 1]] = True
    lacking = [int(each.sum()) < least for each in connected]
    part = _labels(len(counts), edges)
    used = {}
    for (i, j), found in matches.items():
        if (i, j) in edges or (lacking[i] and lacking[j]):
            used[i, j] = found
        elif lacking[i] or lacking[j] or part[i] != part[j]:
            alone = np.isin(found[:, 0], rivalless(i, j)[:, 0])  # a feature has one match in a pair
            used[i, j] = found[connected[i][found[:, 0]] | connected[j][found[:, 1]] | alone]
    return used


def connected_parts(nodes: Sequence[int], pairs: Collection[Pair]) -> list[list[int]]:
    """The nodes (of photographs, or stations) of each connected part of the graph; pairs with others join nothing."""
    place = {node: k for k, node in enumerate(nodes)}
    labels = _labels(len(place), [(place[a], place[b]) for a, b in pairs if a in place and b in place])
    return list(by_key(zip(labels.tolist(), place, strict=True)).values())


def _labels(count: int, pairs: Collection[Pair]) -> NDArray[np.int32]:
    """(count,) which connected part each image is in."""
    ends = np.array(sorted(pairs), np.int64).reshape(-1, 2)
    graph = coo_matrix((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(count, count))
    labels: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return labels


def _displaced(a: PosedFeatures, b: PosedFeatures, side: int, band: Band) -> int:
    return len(match_guided(a, b, band, shift_px=side * _SHIFT * band.px))
