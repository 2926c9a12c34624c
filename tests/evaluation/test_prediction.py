"""Predicted chamfer distances: the model that comes with fieldkit, and the rules of what it does not say."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.evaluation.prediction import (
    FLOORS,
    NO_CLOUD,
    NO_POSITIONS,
    NOTHING_METRIC,
    TOO_FEW,
    WORDS,
    FeatureFit,
    Guard,
    PredictionModel,
    plot_features,
    predict,
    prediction_model,
)
from fieldkit.reconstruction.evidence import Evidence
from fieldkit.results.evaluation import ReconstructionEntry

EVIDENCE = Evidence(noise_m=0.0008, leverage=0.5)
FIGURES = ReconstructionEntry(
    metric=True, pose_rms_m=0.016, points=60_000, points_per_plant_voxel=7.0, right=11, images=12, registered=11,
    pairs_verified=30, observations=9000, reprojection_px=0.5, seconds=1.0, cpu_seconds=1.0,
)  # fmt: skip
MODEL = PredictionModel(
    version=7,
    intercept=math.log(0.02),
    half_width=math.log(2.0),
    coverage=0.9,
    plots=20,
    scenes=("a", "b"),
    chamfer_range_m=(0.008, 0.08),
    features=(
        FeatureFit(name="noise_m", coefficient=0.5, mean=math.log(0.01), scale=1.0, low=0.004, high=0.05),
        FeatureFit(name="pose_rms_m", coefficient=0.2, mean=math.log(0.05), scale=0.5, low=0.01, high=0.3),
    ),
)


class TestModel:
    def test_of_the_package(self) -> None:
        model = prediction_model()
        assert {feature.name for feature in model.features} <= set(FLOORS)
        assert model.coverage == 0.9
        assert {limit.name for limit in (*model.features, *model.guards)} <= set(WORDS)
        assert 0.0 < model.half_width < 3.0
        for feature in model.features:
            assert FLOORS[feature.name] <= feature.low <= feature.high

    @given(st.floats(0.004, 0.05), st.floats(0.01, 0.3))
    def test_interval(self, place_m: float, lone: float) -> None:
        found = predict({"noise_m": place_m, "pose_rms_m": lone}, MODEL)
        assert found.low_m == pytest.approx(found.chamfer_m / 2)
        assert found.high_m == pytest.approx(found.chamfer_m * 2)
        expected = 0.02 * (place_m / 0.01) ** 0.5 * (lone / 0.05) ** 0.4
        assert found.chamfer_m == pytest.approx(expected)

    @pytest.mark.parametrize(("place_m", "told"), [(0.0032, True), (0.003, False), (0.06, True), (0.08, False)])
    def test_outside_of_the_fit(self, place_m: float, told: bool) -> None:
        found = predict({"noise_m": place_m, "pose_rms_m": 0.05}, MODEL)
        assert (found.chamfer_m is not None) == told
        if not told:
            assert found.reason == f"{WORDS['noise_m']} is {place_m:.3g}; plots of the fit have 0.004 to 0.05"
            assert (found.low_m, found.high_m) == (None, None)
        assert predict({"noise_m": math.nan, "pose_rms_m": 0.05}, MODEL).chamfer_m is None

    def test_guards(self) -> None:
        """They say nothing of the value, only of whether there is one."""
        model = MODEL.model_copy(update={"guards": (Guard(name="cameras", low=6.0, high=13.0),)})
        features = {"noise_m": 0.01, "pose_rms_m": 0.05}
        assert predict({**features, "cameras": 10.0}, model) == predict(features, MODEL)
        assert predict({**features, "cameras": 40.0}, model).reason == (
            "the number of photographs that count is 40; plots of the fit have 6 to 13"
        )


class TestFeatures:
    def test_all_candidates(self) -> None:
        found = plot_features(FIGURES, EVIDENCE)
        assert isinstance(found, dict)
        assert set(found) == set(FLOORS)
        assert found["spread_m"] == pytest.approx(math.hypot(0.016 * 0.5 * math.sqrt(33 / 26), 0.008))
        assert all(np.isfinite(value) for value in found.values())
        assert plot_features(FIGURES, None) == NO_CLOUD

    @pytest.mark.parametrize(
        ("change", "reason"),
        [
            ({"metric": False}, NOTHING_METRIC),
            ({"pose_rms_m": None}, NO_POSITIONS),
            ({"points": 0}, NO_CLOUD),
            ({"points_per_plant_voxel": None}, NO_CLOUD),
            ({"right": 2}, TOO_FEW),
            ({"reprojection_px": None}, TOO_FEW),
        ],
    )
    def test_reasons(self, change: dict[str, Any], reason: str) -> None:
        found = plot_features(FIGURES.model_copy(update=change), EVIDENCE)
        assert found == reason
        assert predict(found, MODEL).reason == reason
