"""`surrogate`: how well the model of `field`, and others, predict the trials of finished runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from benchmarks.planners.random_sets import CylindricalSpace
from benchmarks.result import Cell, ResultTable
from fieldkit.planning.methods.encoded_space import EncodedSpace
from fieldkit.planning.methods.field import Field, FieldSettings
from fieldkit.planning.problem import PlanningProblem, Result
from fieldkit.planning.space.cameras import Array
from fieldkit.planning.surrogate.ensemble import fit_ensemble
from fieldkit.planning.surrogate.fit import moments
from fieldkit.planning.surrogate.set_process import fit_sets

_FIRST, _EVERY, _AHEAD = 20, 8, 12
Fit = Callable[[Sequence[Result], Sequence[Result]], tuple[Array, Array]]
"""From results to learn from and results to predict: mean and variance of the latter's −ln(value), noise included."""


@dataclass(frozen=True)
class PredictionErrors:
    """A model's predictions of the next trials of a run, means over its stages.

    Attributes:
        rmse: root mean squared error of ln(value).
        rank: Spearman correlation with the results.
        density: mean log predictive density of ln(value), including the evaluations' noise.
    """

    rmse: float
    rank: float
    density: float


def variants(problem: PlanningProblem) -> dict[str, Fit]:
    """The surrogate of `field` first, then others that differ in one setting, then the paper's."""
    settings = {
        "field": FieldSettings(),
        "noise of 1 % at least": FieldSettings(noise=0.01),
        "noise of 2.5 % at least": FieldSettings(noise=0.025),
        "noise of 10 % at least": FieldSettings(noise=0.1),
    }
    fields = {name: Field(problem, each) for name, each in settings.items()}
    return {name: _field(field) for name, field in fields.items()} | {
        "no geometric score": _without_score(fields["field"]),
        "paper's kernels on ln(value), cameras in order": _ensemble(EncodedSpace(problem), 0.0),
        "the same with noise of 5 % at least": _ensemble(EncodedSpace(problem), 0.05),
        "the same, cameras sorted by azimuth": _ensemble(CylindricalSpace(problem), 0.05),
    }


def prediction_errors(results: Sequence[Result], fit: Fit) -> PredictionErrors:
    """Learn from the first 20, 28, 36 … results of a run and predict the next 12.

    Args:
        results: of one run by number; more than 24 of them measured.
        fit: the model.
    """
    measured = [result for result in results if result.measured]
    found = []
    for count in range(_FIRST, len(measured) - 4, _EVERY):
        ahead = measured[count : count + _AHEAD]
        mean, variance = fit(measured[:count], ahead)
        off = mean + np.log([result.value_m for result in ahead])
        density = -0.5 * (np.log(2.0 * np.pi * variance) + off**2 / variance)
        rank = float(spearmanr(mean, [-result.value_m for result in ahead]).statistic)
        found.append((float(np.sqrt((off**2).mean())), rank, float(density.mean())))
    rmse, rank, density = np.nanmean(np.array(found), axis=0)
    return PredictionErrors(float(rmse), float(rank), float(density))


def prediction_errors_of_all(problem: PlanningProblem, results: Sequence[Result]) -> dict[str, PredictionErrors]:
    """The figures of every model on one run; see `prediction_errors`."""
    return {name: prediction_errors(results, fit) for name, fit in variants(problem).items()}


def surrogate_table(found: Mapping[str, Mapping[str, PredictionErrors]]) -> ResultTable:
    """A row per model, averaged over runs.

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
    def fit(known: Sequence[Result], ahead: Sequence[Result]) -> tuple[Array, Array]:
        inputs = field.inputs([result.trial.cameras for result in ahead])
        return _foretold(field.learn(known).process.moments(inputs, noise=True))

    return fit


def _without_score(field: Field) -> Fit:
    def fit(known: Sequence[Result], ahead: Sequence[Result]) -> tuple[Array, Array]:
        x, inputs = (field.inputs([r.trial.cameras for r in group]) for group in (known, ahead))
        y = _logarithms(known)
        constant_m = float(np.exp(-y.mean()))  # the prior mean
        return _foretold(fit_sets(x, y, np.zeros(3), constant_m, field.settings.noise).moments(inputs, noise=True))

    return fit


def _ensemble(space: EncodedSpace, noise: float) -> Fit:
    def fit(known: Sequence[Result], ahead: Sequence[Result]) -> tuple[Array, Array]:
        x, inputs = (np.array([space.encode(r.trial.cameras) for r in group]) for group in (known, ahead))
        ensemble = fit_ensemble(x, _logarithms(known), 0, least_noise=noise)
        means, variances = np.array(
            [_foretold(moments(m, inputs, noise=True)) for m in ensemble.models.values()]
        ).swapaxes(0, 1)
        mean = ensemble.weights @ means
        return mean, ensemble.weights @ (variances + (means - mean) ** 2)  # eq. `EGP_post`

    return fit


def _foretold(moments: tuple[Array, Array]) -> tuple[Array, Array]:
    mean, deviation = moments
    return mean, deviation**2


def _logarithms(results: Sequence[Result]) -> Array:
    return -np.log([result.value_m for result in results])
