"""Shortest tours and paths over places whose distances are given: exact for few, PyVRP's heuristic for many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvrp
from numpy.typing import ArrayLike
from pyvrp.stop import MaxIterations

from fieldkit.arrays import FloatArray
from fieldkit.errors import MissionError
from fieldkit.runtime.kernels import kernel

EXACT_PLACES = 13
"""Places between a start and an end that are put in order exactly: 2¹³ subsets."""

_UNITS = 10_000_000
"""Length of the longest way in PyVRP's whole numbers."""
_ITERATIONS_A_PLACE = 10
"""Iterations of the search for every place."""
_FEWEST_ITERATIONS = 1000
"""Least iterations of the search."""


def shortest_tour(
    distances: ArrayLike, *, start: int | None = None, end: int | None = None, closed: bool = True, seed: int = 0
) -> tuple[int, ...]:
    """The shortest order in which to visit every place once.

    Up to `EXACT_PLACES` places beside start and end it is exact (Held and Karp 1962), in ties the same every time. With
    more it is PyVRP's iterated local search (Wouda, Lan and Kool 2024) for a number of iterations that only depends on
    the number of places, so that a seed gives the same order on every machine. Gives the n places in order.

    Args:
        distances: (n, n), not negative, from row to column; not necessarily symmetric. Infinite where there is no way.
        start: place that comes first; of a closed tour 0 unless given, of an open one any unless given.
        end: place that comes last, of an open tour.
        closed: return from the last place to the first.
    """
    matrix = _checked(distances)
    n = len(matrix)
    for name, place in (("start", start), ("end", end)):
        if place is not None and not 0 <= place < n:
            raise ValueError(f"the {name} {place} is not one of {n} places")
    if closed and end is not None:
        raise ValueError("a closed tour ends where it starts")
    if not closed and start is not None and start == end and n > 1:
        raise ValueError("an open tour cannot end where it starts")
    if n <= 1:
        return tuple(range(n))
    if closed:
        start = end = start or 0
    middle = np.array([k for k in range(n) if k not in (start, end)])
    if not len(middle):
        order = (0, 1) if start == 0 or end == 1 else (1, 0)
        if np.isinf(matrix[order]):
            raise _no_tour()
        return order
    none = np.zeros(len(middle))
    first = none if start is None else matrix[start, middle]
    last = none if end is None else matrix[middle, end]
    inner = ordered(first, matrix[np.ix_(middle, middle)], last, seed=seed)
    head = () if start is None else (start,)
    tail = () if end is None or closed else (end,)
    return (*head, *(int(middle[k]) for k in inner), *tail)


def ordered(first: FloatArray, between: FloatArray, last: FloatArray, *, seed: int = 0) -> tuple[int, ...]:
    """The order of m places with the least sum of distances, from a start and to an end.

    Args:
        first: (m,) from the start to each place.
        between: (m, m) from row to column.
        last: (m,) from each place to the end.
    """
    order = _held_karp(first, between, last) if len(first) <= EXACT_PLACES else _searched(first, between, last, seed)
    steps = between[list(order[:-1]), list(order[1:])].sum()
    if not np.isfinite(first[order[0]] + steps + last[order[-1]]):
        raise _no_tour()
    return order


def shortest_paths(distances: ArrayLike) -> FloatArray:
    """(n, n) lengths of the shortest paths that visit every place once, from row to column; n ≤ `EXACT_PLACES`.

    Infinite where there is none, as on the diagonal; of one place 0.
    """
    matrix = _checked(distances)
    if len(matrix) > EXACT_PLACES:
        raise ValueError(f"{len(matrix)} places are more than {EXACT_PLACES}")
    table: FloatArray = _path_table(matrix)
    return table


def grouped_routes(distances: ArrayLike, service: Sequence[float], limit: float, *, seed: int = 0) -> list[list[int]]:
    """Places shared out to routes from place 0 and back, none longer than a limit, by PyVRP's iterated local search.

    The sum of the routes' lengths is minimised, after their number as far as a fixed cost of one limit a route does.

    Args:
        distances: (n, n) finite, from row to column; place 0 is the depot.
        service: (n,) spent at each place; the depot's is not counted.
        limit: of distances and service in a route.

    Returns:
        Per route its places in order, without the depot. Routes may be over the limit where the search found none
        that keep it.
    """
    matrix = _checked(distances)
    n = len(matrix)
    scale = _UNITS / max(limit, float(matrix.max()), 1e-9)
    steps: Any = np.ceil(matrix * scale).astype(np.int64)
    data = pyvrp.ProblemData(
        [pyvrp.Location(0.0, 0.0)] * n,
        [pyvrp.Client(k, service_duration=int(np.ceil(service[k] * scale))) for k in range(1, n)],
        [pyvrp.Depot(0)],
        [pyvrp.VehicleType(n, shift_duration=int(limit * scale), fixed_cost=int(limit * scale))],
        [steps],
        [steps],
    )
    best = _search(data, n, seed)
    return [[data.client(step.idx).location for step in route if step.is_client()] for route in best.routes()]


def _checked(distances: ArrayLike) -> FloatArray:
    matrix = np.asarray(distances, dtype=np.float64)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ValueError(f"distances of shape {matrix.shape} are not n × n")
    if np.isnan(matrix).any() or (matrix < 0).any():
        raise ValueError("a distance is negative or not a number")
    return matrix


def _no_tour() -> MissionError:
    return MissionError(
        "no tour over all stations is free of obstacles",
        remedy="Move the stations that cannot be reached, or raise the ceiling.",
    )


def _searched(first: FloatArray, between: FloatArray, last: FloatArray, seed: int) -> tuple[int, ...]:
    """PyVRP's order, with start and end as one depot; an infinite distance is longer than any tour without."""
    m = len(first)
    matrix = np.zeros((m + 1, m + 1))
    matrix[0, 1:], matrix[1:, 1:], matrix[1:, 0] = first, between, last
    np.fill_diagonal(matrix, 0.0)
    finite = np.isfinite(matrix)
    longest = float(matrix[finite].max())
    scale = _UNITS / longest if longest > 0 else 1.0
    steps: Any = np.full(matrix.shape, (m + 2) * _UNITS, dtype=np.int64)
    steps[finite] = np.rint(matrix[finite] * scale).astype(np.int64)
    data = pyvrp.ProblemData(
        [pyvrp.Location(0.0, 0.0)] * (m + 1),
        [pyvrp.Client(k) for k in range(1, m + 1)],
        [pyvrp.Depot(0)],
        [pyvrp.VehicleType()],
        [steps],
        [np.zeros_like(steps)],
    )
    (route,) = _search(data, m + 1, seed).routes()
    return tuple(data.client(step.idx).location - 1 for step in route if step.is_client())


def _search(data: pyvrp.ProblemData, places: int, seed: int) -> pyvrp.Solution:
    stop = MaxIterations(max(_FEWEST_ITERATIONS, _ITERATIONS_A_PLACE * places))
    return pyvrp.solve(data, stop, seed=seed % 2**32, collect_stats=False, display=False).best


def _held_karp(first: FloatArray, between: FloatArray, last: FloatArray) -> tuple[int, ...]:
    costs: FloatArray = _subset_costs(first, between)
    members = len(costs) - 1
    whole = costs[members] + last
    place = int(np.argmin(whole))
    if np.isinf(whole[place]):
        raise _no_tour()
    order = [place]
    while members := members & ~(1 << place):
        place = int(np.argmin(costs[members] + between[:, place]))
        order.append(place)
    return tuple(reversed(order))


@kernel
def _subset_costs(first: FloatArray, between: FloatArray) -> FloatArray:
    """(2^m, m) length of the shortest path over a subset (bits) that ends at a place; infinite where it is not in it.

    Held and Karp's recursion: to a subset and its last place one more is added.
    """
    m = len(first)
    onto = between.T.copy()
    costs = np.full((1 << m, m), np.inf)
    for place in range(m):
        costs[1 << place, place] = first[place]
    for members in range(1, 1 << m):
        for place in range(m):
            before = members ^ (1 << place)
            if members >> place & 1 and before:
                least = np.inf
                for k in range(m):
                    least = min(least, costs[before, k] + onto[place, k])
                costs[members, place] = least
    return costs


@kernel
def _path_table(between: FloatArray) -> FloatArray:
    n = len(between)
    table = np.empty((n, n))
    for start in range(n):
        first = np.full(n, np.inf)
        first[start] = 0.0
        table[start] = _subset_costs(first, between)[-1]
    return table
