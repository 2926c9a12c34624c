"""Tours: exact for few places, near the optimum for many."""

from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.mission_routes import OPTIMA, distances
from fieldkit.arrays import FloatArray
from fieldkit.errors import MissionError
from fieldkit.routing.tour import EXACT_PLACES, grouped_routes, shortest_paths, shortest_tour


def length(matrix: FloatArray, order: tuple[int, ...], *, closed: bool) -> float:
    steps = [*pairwise(order), *([(order[-1], order[0])] if closed and len(order) > 1 else [])]
    return float(sum(matrix[step] for step in steps))


def any_matrix(seed: int, n: int, holes: float = 0.0) -> FloatArray:
    rng = np.random.default_rng(seed)
    matrix: FloatArray = rng.uniform(0, 10, (n, n))
    matrix[rng.uniform(size=(n, n)) < holes] = np.inf
    np.fill_diagonal(matrix, 0.0)
    return matrix


@given(st.integers(0, 10**6), st.integers(1, 7), st.booleans(), st.integers(-1, 6), st.integers(-1, 6), st.booleans())
def test_is_the_best_of_all_orders(seed: int, n: int, closed: bool, first: int, last: int, holes: bool) -> None:
    matrix = any_matrix(seed, n, 0.3 if holes else 0.0)
    start = first if 0 <= first < n else None
    end = last if 0 <= last < n and (last != start or n == 1) and not closed else None
    orders = [
        order
        for order in permutations(range(n))
        if (start is None or order[0] == start)
        and (end is None or order[-1] == end)
        and (not closed or start is not None or order[0] == 0)
    ]
    best = min(length(matrix, order, closed=closed) for order in orders)
    if np.isinf(best):
        with pytest.raises(MissionError):
            shortest_tour(matrix, start=start, end=end, closed=closed)
        return
    found = shortest_tour(matrix, start=start, end=end, closed=closed)
    assert found in orders
    assert length(matrix, found, closed=closed) == pytest.approx(best)


@given(st.integers(0, 10**6), st.integers(1, 6), st.booleans())
def test_path_lengths_between_all_ends(seed: int, n: int, holes: bool) -> None:
    matrix = any_matrix(seed, n, 0.2 if holes else 0.0)
    table = shortest_paths(matrix)
    for first in range(n):
        for last in range(n):
            inner = [k for k in range(n) if k not in (first, last)]
            ways = [] if first == last and n > 1 else [(first, *order, last) for order in permutations(inner)]
            ways = [(0,)] if n == 1 else ways
            assert table[first, last] == pytest.approx(
                min((length(matrix, way, closed=False) for way in ways), default=np.inf)
            )


@pytest.mark.parametrize("name", OPTIMA)
def test_known_optima(name: str) -> None:
    matrix = distances(name)
    order = shortest_tour(matrix)
    assert sorted(order) == list(range(len(matrix)))
    assert order[0] == 0
    found = length(matrix, order, closed=True)
    assert OPTIMA[name] <= found <= 1.02 * OPTIMA[name]


def test_many_places_with_fixed_ends_and_one_way_distances() -> None:
    matrix = any_matrix(3, 30)
    order = shortest_tour(matrix, start=4, end=9, closed=False, seed=5)
    assert sorted(order) == list(range(30))
    assert (order[0], order[-1]) == (4, 9)
    assert order == shortest_tour(matrix, start=4, end=9, closed=False, seed=5)
    # As good as what exact search finds for a part of it.
    part = list(order[: EXACT_PLACES + 2])
    again = shortest_tour(matrix[np.ix_(part, part)], start=0, end=len(part) - 1, closed=False)
    exact = length(matrix[np.ix_(part, part)], again, closed=False)
    assert length(matrix, tuple(part), closed=False) <= 1.1 * exact


def test_routes_share_out_all_places_under_the_limit() -> None:
    places = np.random.default_rng(2).uniform(0, 100, (25, 2))
    matrix = np.linalg.norm(places[:, None] - places[None], axis=2)
    routes = grouped_routes(matrix, [20.0] * 25, 500.0)
    assert sorted(place for route in routes for place in route) == list(range(1, 25))
    for route in routes:
        assert length(matrix, (0, *route), closed=True) + 20.0 * len(route) <= 500.0
