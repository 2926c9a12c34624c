"""`surrogate`: how well the field method's model, and others in its place, foretell the trials of finished runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import spearmanr

from fieldkit.benchmarks.result import Cell, ResultTable
from fieldkit.planning.cameras import Array
from fieldkit.planning.methods.field import Field, FieldSettings
from fieldkit.planning.methods.space import CameraSpace
from fieldkit.planning.search import Problem, Result
from fieldkit.planning.surrogates.ensemble import Ensemble, fit_ensemble
from fieldkit.planning.surrogates.kernels import PAPER_KERNELS
from fieldkit.planning.surrogates.sets import SET_KERNELS

_FIRST, _EVERY, _AHEAD = 20, 8, 12
Fit = Callable[[Sequence[Result], Sequence[Result]], tuple[Ensemble, Array]]
"""From results to learn from and results to foretell: the ensemble, and the inputs of the latter."""


@dataclass(frozen=True)
class Foretold:
    """How a model foretold the next trials of a run, means over its stages.

    Attributes:
        rmse: root mean squared error of ln(value).
        rank: Spearman correlation with what came.
        density: mean log predictive density of ln(value), the evaluations' noise included.
    """

    rmse: float
    rank: float
    density: float


def variants(problem: Problem) -> dict[str, Fit]:
    """The field method's surrogate first, then others that differ in one thing, then the paper's."""
    chosen = FieldSettings()
    settings = {
        "field": chosen,
        "RBF only": replace(chosen, kernels=SET_KERNELS[:1]),
        "Matérn 5/2 only": replace(chosen, kernels=SET_KERNELS[1:]),
        "no geometric score": replace(chosen, geometry=False),
        "noise free": replace(chosen, noise=0.0),
        "noise of 2.5 % at least": replace(chosen, noise=0.025),
        "noise of 10 % at least": replace(chosen, noise=0.1),
        "reach half as long": replace(chosen, reach=0.5 * chosen.reach),
        "reach twice as long": replace(chosen, reach=2.0 * chosen.reach),
    }
    return {name: _field(Field(problem, each)) for name, each in settings.items()} | {
        "paper's kernels on ln(value), cameras in order": _ordered(problem, 0.0),
        "the same with noise of 5 % at least": _ordered(problem, chosen.noise),
    }


def foretell(results: Sequence[Result], fit: Fit) -> Foretold:
    """Learn from the first 20, 28, 36 … results of a run and foretell the 12 after them.

    Args:
        results: of one run by number; more than 24 of them measured.
        fit: the model.
    """
    measured = [result for result in results if result.measured]
    found = []
    for count in range(_FIRST, len(measured) - 4, _EVERY):
        ahead = measured[count : count + _AHEAD]
        ensemble, inputs = fit(measured[:count], ahead)
        mean, deviation = ensemble.posterior(inputs)
        noise = sum(w * m.noise * m.scale**2 for w, m in zip(ensemble.weights, ensemble.models, strict=True))
        variance = deviation**2 + noise
        off = mean + np.log([result.value_m for result in ahead])
        density = -0.5 * (np.log(2.0 * np.pi * variance) + off**2 / variance)
        rank = float(spearmanr(mean, [-result.value_m for result in ahead]).statistic)
        found.append((float(np.sqrt((off**2).mean())), rank, float(density.mean())))
    rmse, rank, density = np.nanmean(np.array(found), axis=0)
    return Foretold(float(rmse), float(rank), float(density))


def foretell_all(problem: Problem, results: Sequence[Result]) -> dict[str, Foretold]:
    """Every model's figures on one run; see `foretell`."""
    return {name: foretell(results, fit) for name, fit in variants(problem).items()}


def surrogate_table(found: Mapping[str, Mapping[str, Foretold]]) -> ResultTable:
    """A row per model, its figures averaged over runs.

    Args:
        found: by run and model.
    """
    models = list(dict.fromkeys(name for each in found.values() for name in each))
    rows: list[tuple[Cell, ...]] = []
    for name in models:
        figures = [(f.rmse, f.rank, f.density) for each in found.values() if (f := each.get(name)) is not None]
        rmse, rank, density = np.mean(np.array(figures), axis=0)
        rows.append((name, f"{rmse:.3f}", f"{rank:.2f}", f"{density:.2f}"))
    columns = ("model", "error of ln(value)>", "Spearman>", "log density>")
    return ResultTable(f"The next {_AHEAD} trials foretold, means over {len(found)} runs", columns, tuple(rows))


def _field(field: Field) -> Fit:
    def fit(known: Sequence[Result], ahead: Sequence[Result]) -> tuple[Ensemble, Array]:
        return field.learn(known).ensemble, field.inputs([result.trial.cameras for result in ahead])

    return fit


def _ordered(problem: Problem, noise: float) -> Fit:
    space = CameraSpace(problem)

    def fit(known: Sequence[Result], ahead: Sequence[Result]) -> tuple[Ensemble, Array]:
        x, inputs = (np.array([space.encode(r.trial.cameras) for r in group]) for group in (known, ahead))
        y = -np.log([result.value_m for result in known])
        return fit_ensemble(x, y, PAPER_KERNELS, least_noise=noise), inputs

    return fit
