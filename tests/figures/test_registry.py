"""Every figure is described once, and reads the same of an evaluation and of a visit."""

import pytest

from fieldkit.figures.registry import FIGURES, TRENDS, f_score, figures_of
from fieldkit.results.evaluation import Prediction
from fieldkit.results.traits import TRAITS as TRAIT_KEYS
from fieldkit.results.traits import TraitsEntry
from fieldkit.results.visit import Visit
from tests.figures.terminal.test_results import TRAITS, scored


def test_evaluations_and_visits_have_the_same_figures() -> None:
    told = Prediction(chamfer_m=0.012, low_m=0.006, high_m=0.024, reason="", model=1)
    plot = scored("a").model_copy(update={"traits": TRAITS, "prediction": told})
    visit = Visit.of_evaluation(plot, plot="a", date="2026-06-30")
    for each in (
        *figures_of("distance"),
        f_score("0.005"),
        *figures_of("prediction"),
        *figures_of("trait"),
        FIGURES["pose_rms_m"],
    ):
        assert each.value(plot) == each.value(visit) is not None
        assert each.error(plot) == each.error(visit)
    assert FIGURES["predicted_chamfer_m"].error(visit) == pytest.approx(0.009)
    assert FIGURES["height_m"].with_error(visit) == "0.81 ± 0.03"
    traits = TraitsEntry(height_m=0.81, height_error_m=0.12, height_error_below_m=0.03)
    swayed = Visit(plot="a", date="2026-07-01", traits=traits)
    assert FIGURES["height_m"].with_error(swayed) == "0.81 +0.12 −0.03"
    potted = Visit(
        plot="a", date="2026-07-01", traits=TraitsEntry(canopy_volume_m3=0.00126, canopy_volume_error_m3=8e-5)
    )
    assert FIGURES["canopy_volume_m3"].with_error(potted) == "0.0013 ± 0.0001"
    assert FIGURES["cover_percent"].amount(16.04) == "16.0 %"
    assert FIGURES["right_share"].shown(plot) == 75.0


def test_order_and_keys() -> None:
    assert [each.key for each in figures_of("distance")] == ["chamfer_m", "accuracy_m", "completeness_m"]
    assert [each.key for each in figures_of("trait")] == list(TRAIT_KEYS)
    assert [each.key for each in TRENDS] == [
        "chamfer_m",
        "predicted_chamfer_m",
        "height_m",
        "height_p95_m",
        "cover_percent",
        "canopy_volume_m3",
        "lai",
        "plants",
    ]
    assert len({each.label for each in FIGURES.values()}) == len(FIGURES)
    assert f_score("0.010").label == "F‑score at 10 mm"


def test_lengths_without_a_scale_are_not_compared() -> None:
    plot = scored("a").model_copy(update={"metric": False})
    assert FIGURES["gsd_m"].value(plot) is None
    assert FIGURES["reprojection_px"].value(plot) == plot.reprojection_px
