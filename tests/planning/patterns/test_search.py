"""The search for patterns: all that it proposes can be flown in time, and evaluations lead it."""

import numpy as np
import pytest

from fieldkit.errors import UsageError
from fieldkit.planning.patterns.search import PatternSearch
from fieldkit.planning.patterns.space import PatternSpace
from fieldkit.results.pattern import Pattern
from fieldkit.vehicles.vehicle_file import load_vehicle

SPACE = PatternSpace(load_vehicle("ardupilot-pitch"), 1.4)


def low(pattern: Pattern) -> bool:
    return pattern.height_m < 9.0


def sparse(pattern: Pattern) -> tuple[float, float]:
    """The score takes patterns for the better, the closer their lines."""
    return 0.002 * pattern.between_m, 0.004


def truth_m(pattern: Pattern) -> float:
    """It is height that counts, too."""
    return 0.006 + 0.002 * pattern.between_m + 0.001 * abs(pattern.height_m - 6.0)


@pytest.mark.parametrize("method", ["field", "bosfm"])
def test_what_is_proposed_is_allowed_and_improves(method: str) -> None:
    search, found = PatternSearch(SPACE, low, sparse), []
    for number in range(8):
        code = search.propose(method)
        pattern = SPACE.decode(code)
        assert low(pattern)
        found.append(truth_m(pattern))
        search.tell(code, number % 2, found[-1])
    assert min(found) < np.quantile(
        [truth_m(SPACE.decode(code)) for code in search.sample(128, np.random.default_rng(1))], 0.1
    )
    assert search.expected_m(search.codes) == pytest.approx(found, rel=0.3)


def test_minutes_that_allow_nothing_are_refused() -> None:
    with pytest.raises(UsageError, match="hardly any pattern"):
        PatternSearch(SPACE, lambda pattern: pattern.height_m < 1.0, sparse).propose("field")
