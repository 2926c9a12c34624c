"""Fitting predictions: recovers a law, leaves scenes out whole, and intervals hold what they say."""

import numpy as np
import pytest

from benchmarks.score_prediction import CANDIDATES, Plot, checked, fit, left_out, names
from benchmarks.scored_captures import FITTED, HELD_OUT, designs
from fieldkit.evaluation.prediction import FLOORS


def law(scenes: int, each: int, seed: int, noise: float = 0.2) -> list[Plot]:
    """Plots whose chamfer distance goes with the root of spread_m, and a little with cameras."""
    rng = np.random.default_rng(seed)
    plots = []
    for k in range(scenes * each):
        features = {name: float(FLOORS[name] * np.exp(rng.uniform(0.5, 2.5))) for name in FLOORS}
        features["spread_m"] = float(np.exp(rng.uniform(np.log(0.009), np.log(0.06))))
        other = (features["cameras"] / 0.4) ** 0.2
        value = 0.2 * features["spread_m"] ** 0.5 * other * np.exp(rng.normal(0, noise))
        plots.append(Plot(f"p{k}", f"scene-{k % scenes}", float(value), features))
    return plots


class TestFit:
    def test_finds_the_law(self) -> None:
        model, tried = fit(law(6, 6, seed=1, noise=0.1))
        assert "spread_m" in names(model)
        place = next(f for f in model.features if f.name == "spread_m")
        assert place.coefficient / place.scale == pytest.approx(0.5, abs=0.08)
        assert tried[names(model)] < 0.2
        assert set(names(model)) <= set(CANDIDATES)

    def test_intervals_hold_nine_in_ten_of_new_plots(self) -> None:
        known, new = law(12, 10, seed=2), law(20, 10, seed=3)
        model, _ = fit(known)
        held = np.mean([check.held for check in checked(new, model) if not check.reason])
        assert 0.8 <= held <= 1.0
        assert np.mean([check.held for check in left_out(known, names(model))]) >= 0.8


class TestDesigns:
    def test_balanced_and_distinct(self) -> None:
        wanted = designs(3, 2)
        assert len({design.name for design in wanted}) == 3 * len(FITTED) + 2 * len(HELD_OUT)
        assert {design.scene for design in wanted} == {*FITTED, *HELD_OUT}
        assert {design.kind for design in wanted} >= {"ring", "arc", "chain", "random", "spiral", "circle"}
        assert all(10 <= design.cameras <= 13 for design in wanted)
