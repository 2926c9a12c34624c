"""One iteration of Algorithm 1: the feasible set of largest expected improvement (eq. `EGP_EI`)."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from botorch.acquisition.analytic import LogExpectedImprovement
from botorch.models.model import Model
from botorch.optim.optimize import optimize_acqf
from linear_operator.utils.warnings import NumericalWarning  # type: ignore[import-untyped]

from fieldkit.planning.space.cameras import Array
from fieldkit.planning.surrogate.ensemble import fit_ensemble
from fieldkit.planning.surrogate.fit import words
from fieldkit.runtime.threads import one_torch_thread

_SAME = 1e-9
_SAMPLES = 48
_NEAR, _BEST = 16, 4
_KEPT = 6
_STARTS, _ITERATIONS = 2, 30


class SearchSpace(Protocol):
    """A feasible set within the unit cube."""

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """``count`` random feasible points (n, d); all of them if there are not many more."""
        ...

    def around(self, x: Array, count: int, rng: np.random.Generator) -> Array:
        """``count`` random points (n, d) of the unit cube near the point x (d,); they need not be feasible."""
        ...

    def repair(self, x: Array) -> Array:
        """The feasible point (d,) near a point (d,) of the unit cube; a feasible point is returned unchanged."""
        ...


@dataclass(frozen=True, eq=False)
class Suggestion:
    """The point to evaluate next, and its origin."""

    x: Array | None
    """(d,) feasible; None if every feasible point found is known already."""
    model: str
    """Name of m_t."""
    weights: Mapping[str, float]
    """W_t by name."""
    remarks: tuple[str, ...]
    """Numerical problems on the way."""


@one_torch_thread()
def suggest(
    x: Array,
    y: Array,
    space: SearchSpace,
    rng: np.random.Generator,
    *,
    pending: Array | None = None,
    avoid: Array | None = None,
    least_noise: float = 0.0,
) -> Suggestion:
    """Fit, weigh, draw a model, maximise its expected improvement over max(y).

    Pending points count as observed at the drawn model's posterior mean (the "kriging believer" of Ginsbourger et al.
    2010), so that trials evaluated at the same time differ; they change neither hyperparameters nor weights.

    Args:
        x: (t, d) evaluated, t ≥ 1.
        y: (t,) their values, to be maximised.
        rng: of the fits' second starts, then of m_t, then of candidates.
        pending: (p, d) being evaluated.
        avoid: (a, d) further points not to suggest, without known values.
        least_noise: see `fit_ensemble`.
    """
    ensemble = fit_ensemble(x, y, int(rng.integers(2**31)), least_noise=least_noise)
    name = ensemble.draw(rng)
    fitted = ensemble.models[name]
    model: Model = fitted
    best = float(y.max())
    if pending is not None:
        waiting = torch.from_numpy(pending)
        with torch.no_grad():
            believed = fitted.posterior(waiting).mean
            model = fitted.condition_on_observations(waiting, believed)
        best = max(best, float(believed.max()))
    known = np.vstack([x, *(points for points in (pending, avoid) if points is not None)])
    found, remarks = _maximise(LogExpectedImprovement(model, best_f=best), x, y, space, rng, known)
    remarks = tuple(f"expected improvement of {name}: {text}" for text in remarks)
    return Suggestion(found, name, ensemble.named_weights(), ensemble.remarks + remarks)


def _maximise(
    acquisition: LogExpectedImprovement, x: Array, y: Array, space: SearchSpace, rng: np.random.Generator, known: Array
) -> tuple[Array | None, tuple[str, ...]]:
    """The unknown feasible point (d,) of the largest expected improvement found, and remarks.

    Random feasible points and points near the best data are compared. L-BFGS climbs from the best of both kinds within
    the unit cube. The points reached and the best starts are made feasible, and the best one is taken.
    """
    sampled = space.sample(_SAMPLES, rng)
    near = np.vstack([space.around(x[i], _NEAR, rng) for i in np.argsort(-y, kind="stable")[:_BEST]])
    raw = np.vstack([sampled, near])
    order = np.argsort(-_values(acquisition, raw), kind="stable")
    first = [i for i in order if i < len(sampled)][:_STARTS]
    second = [i for i in order if i >= len(sampled)][:_STARTS]
    climbed, remarks = _climb(acquisition, raw[[*first, *second]])
    candidates: list[Array] = []
    for i in order:
        if len(candidates) < _KEPT and not _known(repaired := space.repair(raw[i]), known):
            candidates.append(repaired)
    candidates += [row for row in map(space.repair, climbed) if not _known(row, known)]
    if not candidates:
        return None, remarks
    return candidates[int(np.argmax(_values(acquisition, np.array(candidates))))], remarks


def _known(x: Array, data: Array) -> bool:
    return bool((np.abs(data - x).max(axis=1) <= _SAME).any())


def _values(acquisition: LogExpectedImprovement, x: Array) -> Array:
    with torch.no_grad(), warnings.catch_warnings():
        # At a known point the variance is 0 up to rounding; GPyTorch raises it to 1e-10 where the sum is negative.
        warnings.filterwarnings("ignore", "Negative variance values", NumericalWarning)
        values: Array = acquisition(torch.from_numpy(x)[:, None]).numpy()
    return values


def _climb(acquisition: LogExpectedImprovement, starts: Array) -> tuple[Array, tuple[str, ...]]:
    """The points that L-BFGS reaches from each start (n, d) within the unit cube, and remarks."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        reached, _ = optimize_acqf(
            acquisition,
            bounds=torch.tensor([[0.0], [1.0]], dtype=torch.float64).expand(2, starts.shape[1]),
            q=1,
            num_restarts=len(starts),
            batch_initial_conditions=torch.from_numpy(starts)[:, None],
            options={"maxiter": _ITERATIONS},
            return_best_only=False,
            retry_on_optimization_warning=False,
        )
    points: Array = reached.detach().reshape(len(starts), -1).numpy()
    return np.clip(points[np.isfinite(points).all(axis=1)], 0.0, 1.0), words(caught)
