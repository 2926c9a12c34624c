"""The quickest level ways around obstacles: a visibility graph that grows by what its ways still meet."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from fieldkit.routing.flight_time import level_time_s
from fieldkit.routing.obstacles import Obstacles
from fieldkit.vehicles.vehicle import Speeds

Array = NDArray[np.float64]
_TINY_S = 1e-9  # zero would be no edge


def ways_around(a: Array, b: Array, height_m: float, obstacles: Obstacles, speeds: Speeds) -> list[Array | None]:
    """The quickest way in the plan from a to b around everything that is higher than a height.

    Nodes are the places and the corners of the solids met so far, edges what is clear of these solids; solids that the
    quickest ways meet join, until the ways meet none. As no edge comes back between nodes that were there
    before, the last ways are the quickest past all solids.

    Args:
        a, b: (n, 2) metres east and north.
        height_m: solids whose top is not above it are flown over.
        obstacles: to be clear of.
        speeds: the vehicle stops at every corner.

    Returns:
        Per pair (k, 2) places from a to b; None where there is no way.
    """
    if not len(a):
        return []
    ends, where = np.unique(np.vstack([a, b]), axis=0, return_inverse=True)
    where = where.reshape(-1)
    starts, stops = where[: len(a)], where[len(a) :]
    known = _met(a, b, height_m, obstacles)
    while True:
        nodes = np.vstack([ends, obstacles.corners(known)])
        routes = _quickest(nodes, starts, stops, height_m, known, obstacles, speeds)
        steps = np.array([step for route in routes if route for step in pairwise(route)])
        if not len(steps):
            break
        steps = np.unique(steps, axis=0)
        met = _met(nodes[steps[:, 0]], nodes[steps[:, 1]], height_m, obstacles)
        if not (met & ~known).any():
            break
        known = known | met
    return [nodes[route] if route else None for route in routes]


def _quickest(
    nodes: Array, starts: NDArray[np.intp], stops: NDArray[np.intp], height_m: float, known: NDArray[np.bool_],
    obstacles: Obstacles, speeds: Speeds,
) -> list[list[int]]:  # fmt: skip
    """Per pair the nodes of its quickest way past the known solids; empty where there is none."""
    one, other = np.triu_indices(len(nodes), 1)
    clear = ~obstacles.prisms.blocked(_at(nodes[one], height_m), _at(nodes[other], height_m), known)
    one, other = one[clear], other[clear]
    graph = np.zeros((len(nodes), len(nodes)))
    graph[one, other] = level_time_s(np.linalg.norm(nodes[one] - nodes[other], axis=1), speeds) + _TINY_S
    sources, row = np.unique(starts, return_inverse=True)
    _, before = dijkstra(graph, directed=False, indices=sources, return_predecessors=True)
    routes = []
    for start, stop, source in zip(starts.tolist(), stops.tolist(), row.tolist(), strict=True):
        route = [stop]
        while route[-1] != start and before[source, route[-1]] >= 0:
            route.append(int(before[source, route[-1]]))
        routes.append(route[::-1] if route[-1] == start else [])
    return routes


def _met(a: Array, b: Array, height_m: float, obstacles: Obstacles) -> NDArray[np.bool_]:
    """(count,) whether any of the level stretches meets each solid."""
    return obstacles.prisms.met(_at(a, height_m), _at(b, height_m))


def _at(places: Array, height_m: float) -> Array:
    return np.column_stack([places, np.full(len(places), height_m)])
