"""Expected improvement, its maximum in a feasible set, and Algorithm 1 on functions whose optimum is known."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
import torch
from botorch.acquisition.analytic import LogExpectedImprovement

from fieldkit.planning.methods.bosfm import moved
from fieldkit.planning.surrogate.ensemble import fit_ensemble, suggest

Function = Callable[[np.ndarray], float]


@dataclass
class Box:
    """The whole unit cube."""

    dimension: int

    def sample(self, count: int, rng: np.random.Generator) -> np.ndarray:
        return np.asarray([self.repair(row) for row in rng.random((count, self.dimension))])

    def around(self, x: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        return moved(x, count, rng)

    def repair(self, x: np.ndarray) -> np.ndarray:
        return x


class Shell(Box):
    """Outside a ball about the middle."""

    def repair(self, x: np.ndarray) -> np.ndarray:
        away = x - 0.5
        distance = np.linalg.norm(away)
        if distance >= 0.4:
            return x
        away = away if distance > 0 else np.eye(len(x))[0]
        return np.asarray(0.5 + 0.4000001 * away / np.linalg.norm(away))


@dataclass
class Points(Box):
    """Nothing but some points."""

    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))

    def around(self, x: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        return np.asarray(self.points[rng.integers(len(self.points), size=count)])

    def repair(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(self.points[np.linalg.norm(self.points - x, axis=1).argmin()])


def bowl(x: np.ndarray) -> float:
    return -float(((x - 0.5) ** 2).sum())


def evaluated(function: Function, count: int, dimension: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    x = np.random.default_rng(seed).random((count, dimension))
    return x, np.array([function(row) for row in x])


@pytest.mark.parametrize("kind", [Box, Shell])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_suggestion_is_feasible_new_and_of_large_improvement(kind: type[Box], seed: int) -> None:
    space = kind(3)
    x, y = evaluated(bowl, 12, 3, seed)
    x = np.array([space.repair(row) for row in x])
    found = suggest(x, y, space, np.random.default_rng(seed))
    assert found.remarks == ()
    assert ((found.x >= 0) & (found.x <= 1)).all()
    np.testing.assert_array_equal(space.repair(found.x), found.x)
    assert np.abs(x - found.x).max(axis=1).min() > 1e-9
    random = np.array([space.repair(row) for row in np.random.default_rng(9).random((2000, 3))])
    ensemble = fit_ensemble(x, y, int(np.random.default_rng(seed).integers(2**31)))
    improvement = LogExpectedImprovement(ensemble.models[found.model], best_f=float(y.max()))
    with torch.no_grad():
        values = improvement(torch.from_numpy(np.vstack([found.x, random]))[:, None])
    # Climbs do not know the feasible set, but 2,000 random points find hardly anything better.
    assert values[0] >= (values[1:].max() - 1e-3 if kind is Box else values[1:].quantile(0.995))


def test_what_is_known_or_to_be_avoided_is_left_out() -> None:
    points = np.random.default_rng(1).random((12, 2))
    y = np.array([bowl(row) for row in points])
    found = suggest(points[:10], y[:10], Points(2, points), np.random.default_rng(0), avoid=points[11:])
    assert found.x is not None
    np.testing.assert_array_equal(found.x, points[10])
    nothing = suggest(points[:10], y[:10], Points(2, points), np.random.default_rng(0), avoid=points[10:])
    assert nothing.x is None


def test_pending_trials_are_kept_away_from() -> None:
    x, y = evaluated(bowl, 8, 2)
    first = suggest(x, y, Box(2), np.random.default_rng(3))
    again = suggest(x, y, Box(2), np.random.default_rng(3), pending=first.x[None])
    assert np.linalg.norm(again.x - first.x) > 1e-3
    assert again.weights == first.weights
    assert again.model == first.model


def test_a_suggestion_depends_on_its_input_alone() -> None:
    x, y = evaluated(bowl, 10, 4)
    torch.manual_seed(0)
    first = suggest(x, y, Shell(4), np.random.default_rng([1, 2]))
    torch.manual_seed(1)
    np.random.seed(1)  # noqa: NPY002 - a global state that must not matter
    second = suggest(x, y, Shell(4), np.random.default_rng([1, 2]))
    assert first.x.tobytes() == second.x.tobytes()
    assert (first.model, first.weights, first.remarks) == (second.model, second.weights, second.remarks)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_it_starts_from_nearly_nothing(count: int) -> None:
    x, y = evaluated(bowl, count, 5)
    found = suggest(x, y, Box(5), np.random.default_rng(0))
    assert found.x is not None
    assert sum(found.weights.values()) == pytest.approx(1.0)
    flat = suggest(np.repeat(x, 3, axis=0), np.zeros(3 * count), Box(5), np.random.default_rng(0))
    assert flat.x is not None
    assert np.isfinite(flat.x).all()


def branin(u: np.ndarray) -> float:
    """Maximum −0.398 at three places."""
    a, b = 15 * u[0] - 5, 15 * u[1]
    bend = b - 5.1 / (4 * np.pi**2) * a * a + 5 / np.pi * a - 6
    return -float(bend**2 + 10 * (1 - 1 / (8 * np.pi)) * np.cos(a) + 10)


def hartmann(u: np.ndarray) -> float:
    """Maximum 3.322."""
    weights = np.array([1.0, 1.2, 3.0, 3.2])
    scales = np.array(
        [[10, 3, 17, 3.5, 1.7, 8], [0.05, 10, 17, 0.1, 8, 14], [3, 3.5, 1.7, 10, 17, 8], [17, 8, 0.05, 10, 0.1, 14]]
    )
    centers = 1e-4 * np.array(
        [
            [1312, 1696, 5569, 124, 8283, 5886],
            [2329, 4135, 8307, 3736, 1004, 9991],
            [2348, 1451, 3522, 2883, 3047, 6650],
            [4047, 8828, 8732, 5743, 1091, 381],
        ]
    )
    return float(weights @ np.exp(-(scales * (u - centers) ** 2).sum(axis=1)))


@pytest.mark.parametrize(
    ("function", "dimension", "initial", "steps", "reached"),
    [(branin, 2, 8, 16, -0.7), (hartmann, 6, 12, 16, 2.8)],
    ids=["branin", "hartmann-6"],
)
def test_a_planted_optimum_is_found(function, dimension, initial, steps, reached) -> None:
    x, y = evaluated(function, initial, dimension, seed=3)
    for step in range(steps):
        found = suggest(x, y, Box(dimension), np.random.default_rng([3, step])).x
        assert found is not None
        x, y = np.vstack([x, found]), np.append(y, function(found))
    assert y.max() > reached
    # Random search needs more than twice the evaluations.
    _, random = evaluated(function, 2 * (initial + steps), dimension, seed=12)
    assert random.max() < reached
