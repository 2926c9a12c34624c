"""What a plot's chamfer distance is likely to be where it has no reference: a fit to simulated plots. Pure functions.

docs/traits.md has the figures it is made from, how it was fitted and checked, and where it fails.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, PositiveFloat

from fieldkit.results.evaluation import Prediction, ReconstructionEntry
from fieldkit.results.fields import Ordinal, Strict

if TYPE_CHECKING:
    from fieldkit.reconstruction.evidence import Evidence

MODEL_FILE = "prediction.json"
NOTHING_METRIC = "the reconstruction has no metric scale"
NOT_TIED = "no matches tie the photographs together, so nothing tells how good their poses are"
NO_POSITIONS = "the photographs carry no positions, so nothing says how well the plot is placed"
NO_CLOUD = "too little was reconstructed"
LEAST_IMAGES = 3
"""Least number of photographs that count for a prediction."""
TOO_FEW = f"fewer than {LEAST_IMAGES} photographs count"
_MARGIN = 0.10
"""Width beyond the fitted range of a feature within which a prediction holds, as a share."""

RESTING_M = 0.008
"""What the best few-view captures of maize come to, however well their cameras are placed."""
FLOORS: dict[str, float] = {
    "spread_m": RESTING_M,
    "pose_rms_m": 0.0005,
    "noise_m": 0.0001,
    "cameras": 2.0,
}
"""Every figure by name with the least value that counts: logarithms are taken."""


WORDS: dict[str, str] = {
    "spread_m": "how far the plants may be from their place, in metres,",
    "pose_rms_m": "the residuals of the photographs' positions, in metres,",
    "noise_m": "the noise of depths that distances and angles of the views let expect, in metres,",
    "cameras": "the number of photographs that count",
}
"""Figures as reasons call them."""


class Guard(Strict):
    """Range of a figure in the fit; it may take no part in the sum."""

    name: str
    low: PositiveFloat
    high: PositiveFloat


class FeatureFit(Guard):
    """One figure of the sum."""

    coefficient: float
    """Of the logarithm's distance from ``mean``, in units of ``scale``."""
    mean: float
    scale: PositiveFloat


class PredictionModel(Strict):
    """prediction.json: log chamfer distance, linear in logarithms of figures."""

    kind: Literal["prediction"] = "prediction"
    version: Ordinal
    intercept: float
    """Mean of log(chamfer_m) in the fit."""
    features: Annotated[tuple[FeatureFit, ...], Field(min_length=1)]
    guards: tuple[Guard, ...] = ()
    half_width: PositiveFloat
    """Of the interval, in log(chamfer_m): conformal, from the errors of scenes left out one at a time."""
    coverage: Annotated[float, Field(gt=0, lt=1)]
    """That the interval is made for."""
    plots: Ordinal
    scenes: tuple[str, ...]
    chamfer_range_m: tuple[float, float]
    """Least and greatest of the fit."""


@cache
def prediction_model() -> PredictionModel:
    """The fit that comes with fieldkit."""
    text = files("fieldkit.evaluation").joinpath(MODEL_FILE).read_text(encoding="utf-8")
    return PredictionModel.model_validate_json(text)


def plot_features(found: ReconstructionEntry, supported: Evidence | None) -> dict[str, float] | str:
    """The figures that predictions are made from, or why there are none."""
    if not found.metric:
        return NOTHING_METRIC
    if any(image.stated for image in found.image_reports):
        return NOT_TIED
    if found.pose_rms_m is None:
        return NO_POSITIONS
    if supported is None or not found.points or found.points_per_plant_voxel is None:
        return NO_CLOUD
    right = found.right
    if right < LEAST_IMAGES or found.reprojection_px is None:
        return TOO_FEW
    # A similarity takes 7 of the 3n residuals' degrees of freedom.
    free = (3 * right / (3 * right - 7)) ** 0.5
    place = found.pose_rms_m * free * supported.leverage
    return {
        "spread_m": float(np.hypot(place, RESTING_M)),
        "pose_rms_m": found.pose_rms_m,
        "noise_m": supported.noise_m,
        "cameras": float(right),
    }


def predict(features: Mapping[str, float] | str, model: PredictionModel | None = None) -> Prediction:
    """The chamfer distance that a plot's figures let expect, with its interval.

    Nothing is said where a figure of the sum or a guard lies outside of the fit's range, by more than 10 % of that in
    logarithms. ``model`` is fieldkit's own where not given.
    """
    model = prediction_model() if model is None else model
    if isinstance(features, str):
        return _refused(features, model)
    for limit in (*model.features, *model.guards):
        raw = features[limit.name]
        if not np.isfinite(raw):
            return _refused(f"{limit.name} is not a number", model)
        low, place, high = (logarithm(limit.name, v) for v in (limit.low, raw, limit.high))
        slack = _MARGIN * (high - low) + 1e-9
        if not low - slack <= place <= high + slack:
            fit = f"plots of the fit have {limit.low:.3g} to {limit.high:.3g}"
            return _refused(f"{WORDS.get(limit.name, limit.name)} is {raw:.3g}; {fit}", model)
    return extrapolated(features, model)


def extrapolated(features: Mapping[str, float], model: PredictionModel) -> Prediction:
    """As `predict` of figures that are numbers, without regard to the fit's range."""
    value = model.intercept + sum(
        f.coefficient * (logarithm(f.name, features[f.name]) - f.mean) / f.scale for f in model.features
    )
    middle, wide = float(np.exp(value)), float(np.exp(model.half_width))
    return Prediction(chamfer_m=middle, low_m=middle / wide, high_m=middle * wide, reason="", model=model.version)


def _refused(reason: str, model: PredictionModel) -> Prediction:
    return Prediction(chamfer_m=None, low_m=None, high_m=None, reason=reason, model=model.version)


def logarithm(name: str, value: float) -> float:
    """Natural logarithm of a figure, or of the least that counts (`FLOORS`)."""
    return float(np.log(max(value, FLOORS[name])))
