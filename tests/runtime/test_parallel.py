from __future__ import annotations

import math

import pytest

from fieldkit.runtime.parallel import map_parallel, map_threads


@pytest.mark.parametrize("mapper", [map_parallel, map_threads])
@pytest.mark.parametrize("workers", [1, 2, 5])
def test_results_keep_the_order_of_the_items_whatever_the_workers(mapper, workers) -> None:
    advanced: list[int] = []
    assert mapper(math.factorial, [5, 1, 3], workers=workers, advance=advanced.append) == [120, 1, 6]
    assert advanced == [1, 1, 1]


@pytest.mark.parametrize("mapper", [map_parallel, map_threads])
def test_an_error_of_an_item_is_raised(mapper) -> None:
    with pytest.raises(ValueError, match="factorial"):
        mapper(math.factorial, [3, -1, 4], workers=2)


def test_no_items_give_no_results() -> None:
    assert map_threads(math.factorial, [], workers=3) == []
