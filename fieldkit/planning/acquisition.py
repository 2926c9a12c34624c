"""Expected improvement, and where in the feasible set it is largest (eq. `EGP_EI`)."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from botorch.acquisition.acquisition import AcquisitionFunction
from botorch.acquisition.analytic import _log_ei_helper
from botorch.exceptions.warnings import OptimizationWarning
from botorch.optim.optimize import optimize_acqf
from torch import Tensor

from fieldkit.planning.cameras import Array
from fieldkit.planning.surrogates.ensemble import fit_ensemble
from fieldkit.planning.surrogates.gp import ITERATIONS, FittedGP
from fieldkit.planning.surrogates.kernels import PAPER_KERNELS, KernelSpec
from fieldkit.threads import one_torch_thread

_SAME = 1e-9


class Space(Protocol):
    """A feasible set within the unit cube, as the search sees it."""

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """``count`` random feasible points (n, d); or all there are, where those are not many more."""
        ...

    def around(self, x: Array, count: int, rng: np.random.Generator) -> Array:
        """``count`` random points (n, d) of the unit cube near the point x (d,); they need not be feasible."""
        ...

    def repair(self, x: Array) -> Array:
        """The feasible point (d,) that stands for a point (d,) of the unit cube; a feasible one stands for itself."""
        ...


@dataclass(frozen=True)
class Search:
    """How hard the maximum of the acquisition function is looked for.

    Attributes:
        samples: random feasible points.
        near: points near each of the best data.
        best: how many of the best data.
        kept: points of either kind, the best by their values, that are candidates as they are.
        starts: of the gradient ascent.
        iterations: of the gradient ascent, at most.
    """

    samples: int = 48
    near: int = 16
    best: int = 4
    kept: int = 6
    starts: int = 4
    iterations: int = 30


@dataclass(frozen=True, eq=False)
class Suggestion:
    """Where to evaluate next, and why.

    Attributes:
        x: (d,) feasible; None where every feasible point found is known already.
        model: name of m_t.
        weights: w_t by name.
        remarks: numerical events on the way.
    """

    x: Array | None
    model: str
    weights: Mapping[str, float]
    remarks: tuple[str, ...]


def suggest(
    x: Array,
    y: Array,
    space: Space,
    rng: np.random.Generator,
    *,
    pending: Array | None = None,
    avoid: Array | None = None,
    kernels: Sequence[KernelSpec] = PAPER_KERNELS,
    search: Search | None = None,
    iterations: int = ITERATIONS,
) -> Suggestion:
    """One iteration of Algorithm 1: fit, weigh, draw a model, maximise its expected improvement.

    Pending points count as observed at the drawn model's posterior mean ("kriging believer"), so that trials evaluated
    at the same time differ; they change neither hyperparameters nor weights. The incumbent is max(y), or the largest
    believed value where that is larger.

    Args:
        x: (t, d) evaluated, t ≥ 1.
        y: (t,) their values, to be made large.
        space: the feasible set.
        rng: draws first m_t, then candidates.
        pending: (p, d) being evaluated.
        avoid: (a, d) not to be suggested either; of no known value.
        kernels: of the ensemble.
        search: how hard to look.
        iterations: of each fit, at most.
    """
    waiting = np.zeros((0, x.shape[1])) if pending is None else pending
    ensemble = fit_ensemble(x, y, kernels, iterations=iterations)
    model = ensemble.draw(rng)
    remarks = [text for other in ensemble.models if other is not model for text in other.remarks]
    if len(waiting):
        model = model.believing(waiting)
    found, events = maximise(model, float(model.y.max()), space, rng, search or Search(), avoid)
    return Suggestion(found, model.name, ensemble.named_weights(), (*remarks, *model.remarks, *events))


def log_expected_improvement(mean: Array, deviation: Array, best: float) -> Array:
    """Ln EI (n,) of Gaussians with those means (n,) and standard deviations (n,) over an incumbent.

    Accurate where EI itself underflows (Ament et al. 2023, "Unexpected improvements to expected improvement").
    """
    value = _log_ei(torch.from_numpy(np.asarray(mean)), torch.from_numpy(np.asarray(deviation)), best)
    return value.numpy()


@one_torch_thread()
def maximise(
    model: FittedGP,
    best: float,
    space: Space,
    rng: np.random.Generator,
    search: Search,
    avoid: Array | None = None,
) -> tuple[Array | None, tuple[str, ...]]:
    """The feasible point with the largest expected improvement that was found, and remarks.

    Random feasible points and points near the best data are compared; from the best of both kinds L-BFGS climbs within
    the unit cube; what it reaches and the best of the first ones are made feasible, and the best after that is taken.
    So the answer is feasible and no worse than any feasible candidate compared. Points of the
    data are never returned. Where the model has a prior mean, whose gradient is not known, nothing climbs.

    Args:
        model: its own data are what is known, believed values included.
        best: the incumbent, in y's units.
        space: the feasible set.
        rng: of the candidates.
        search: how many of them.
        avoid: (a, d) never to be returned either.

    Returns:
        (d,), or None where all points found are known; and remarks.
    """
    known = model.x if avoid is None else np.vstack([model.x, avoid])
    order = np.argsort(-model.y, kind="stable")[: search.best]
    sampled = space.sample(search.samples, rng)
    near = np.vstack([space.around(model.x[i], search.near, rng) for i in order])
    raw = np.vstack([sampled, near])
    values = _values(model, raw, best)

    candidates: list[Array] = []
    for i in np.argsort(-values, kind="stable"):
        if len(candidates) == search.kept:
            break
        repaired = space.repair(raw[i])
        if not _known(repaired, known):
            candidates.append(repaired)

    remarks: tuple[str, ...] = ()
    if model.prior_mean is None and search.starts:
        half = (search.starts + 1) // 2
        split = len(sampled)
        first = np.argsort(-values[:split], kind="stable")[:half]
        second = split + np.argsort(-values[split:], kind="stable")[: search.starts - half]
        climbed, remarks = _climb(model, best, raw[np.concatenate([first, second])], search.iterations)
        candidates += [row for row in map(space.repair, climbed) if not _known(row, known)]
    if not candidates:
        return None, remarks
    return candidates[int(np.argmax(_values(model, np.array(candidates), best)))], remarks


def _known(x: Array, data: Array) -> bool:
    return bool((np.abs(data - x).max(axis=1) <= _SAME).any())


def _values(model: FittedGP, x: Array, best: float) -> Array:
    return log_expected_improvement(*model.posterior(x), best)


def _climb(model: FittedGP, best: float, starts: Array, iterations: int) -> tuple[Array, tuple[str, ...]]:
    """Where L-BFGS gets to from each start (n, d) within the unit cube, and remarks."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        reached, _ = optimize_acqf(
            _LogExpectedImprovement(model, best),
            bounds=torch.tensor([[0.0], [1.0]], dtype=torch.float64).expand(2, starts.shape[1]),
            q=1,
            num_restarts=len(starts),
            batch_initial_conditions=torch.from_numpy(starts)[:, None],
            options={"maxiter": iterations},
            return_best_only=False,
            retry_on_optimization_warning=False,
        )
    remarks = []
    for warning in caught:
        if issubclass(warning.category, OptimizationWarning):
            remarks.append(f"{model.name}, expected improvement: {' '.join(str(warning.message).split())}")
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    points: Array = reached.detach().reshape(len(starts), -1).numpy()
    # A climb that broke leads nowhere; its start is a candidate already.
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        remarks.append(f"{model.name}, expected improvement: {int((~finite).sum())} climbs broke")
    return np.clip(points[finite], 0.0, 1.0), tuple(remarks)


class _LogExpectedImprovement(AcquisitionFunction):
    """For BoTorch's optimiser: BoTorch's formula on `FittedGP.moments`, so that both ways give the same values."""

    def __init__(self, gp: FittedGP, best: float) -> None:
        torch.nn.Module.__init__(self)
        self._gp, self._best = gp, gp.standardised(best)

    def forward(self, X: Tensor) -> Tensor:
        mean, variance = self._gp.moments(X.squeeze(-2))
        return _log_ei(mean, variance.sqrt(), self._best)


def _log_ei(mean: Tensor, deviation: Tensor, best: float) -> Tensor:
    return _log_ei_helper((mean - best) / deviation) + deviation.log()
