"""The geometric score's weights, fitted to a kept run's evaluations."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fieldkit.cache import StageCache
from fieldkit.errors import UsageError
from fieldkit.planning.run.folder import read_log, read_settings, searched
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.planning.score.cost_model import DOUBT, LEAST_M, NOISE, WEIGHTS, CostModel, Weights, fit_slopes
from fieldkit.runtime.progress import Silent

LEAST = 8
"""Least number of measured sets for a fit."""


def weights_of_run(run: Path) -> Weights:
    """The weights of gap, noise and tie fitted to a run's search by `fit_slopes`, to four digits.

    They are pulled to `WEIGHTS`, less so with more evaluations. The constant that no term explains is left out, since
    it does not rank sets.

    Args:
        run: folder of a run on a scene or a reference, with commanded poses.

    Raises:
        MetadataError: ``run`` is not a run's folder, or is damaged.
        UsageError: fewer than `LEAST` sets were measured; the run chose among recorded photographs or used blind
            mapping; its source is gone or has changed; or no term explains its values.
        InputError: the run's source cannot be used.
    """
    settings = read_settings(run)
    if settings.source.kind == "captures":
        raise UsageError(
            "weights are fitted to a run on a plot, and this one chose among recorded photographs", path=run,
            remedy="Give a run that was made with --scene or --reference.",
        )  # fmt: skip
    if settings.blind:
        raise UsageError(
            "weights are fitted to a run with commanded poses: with blind mapping, registration dominates the values",
            path=run, remedy="Give a run that was made with --mapping prior.",
        )  # fmt: skip
    results = [entry.result for entry in searched(read_log(run)) if entry.measured]
    if len(results) < LEAST:
        raise UsageError(
            f"weights need {LEAST} evaluations of a search, and this run has {len(results)}", path=run,
            remedy="Give a longer run, or numbers: --weights GAP,NOISE,TIE.",
        )  # fmt: skip
    problem = set_up_run(settings, run, cache=StageCache(None), progress=Silent()).problem
    cost_model = CostModel(problem)
    terms = np.array([cost_model.terms(result.trial.cameras, result.trial.plot) for result in results])
    y = -np.log(np.maximum([result.value_m for result in results], LEAST_M))
    slopes, _ = fit_slopes(terms, y, WEIGHTS, doubt=DOUBT, noise=NOISE)
    if not slopes.any():
        raise UsageError(
            "no term of the geometric score explains this run's values", path=run,
            remedy="Give another run, or numbers: --weights GAP,NOISE,TIE.",
        )  # fmt: skip
    gap, noise, tie = (float(f"{slope:.4g}") for slope in slopes)
    return gap, noise, tie
