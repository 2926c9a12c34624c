"""A pattern for a trial, by those that come with fieldkit."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from fieldkit.errors import UsageError
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.planning.patterns.plan import FRONT_FILE, plan_trial, shipped_patterns
from fieldkit.planning.plan_settings import TrialSettings
from fieldkit.results.plan_file import load_plan
from fieldkit.vehicles.vehicle_file import load_vehicle

VEHICLE = "dji-mavic-3-enterprise"


@pytest.fixture(scope="module")
def plots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty plots of 4 × 1.5 m with rows to the east."""
    frame, features = LocalFrame(52.3, 10.4), []
    for number in range(40):
        x, y = 5.0 * (number // 10), 1.5 * (number % 10)
        corners = [(x, y), (x + 4, y), (x + 4, y + 1.5), (x, y + 1.5), (x, y)]
        ring = [[float(v[0]) for v in frame.to_geodetic([(a, b, 0.0)])[1::-1]] for a, b in corners]
        polygon = {"type": "Polygon", "coordinates": [ring]}
        features.append({"type": "Feature", "properties": {"plot_id": f"p{number}"}, "geometry": polygon})
    file = tmp_path_factory.mktemp("trial") / "plots.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return file


def asked(plots: Path, **more: object) -> TrialSettings:
    return TrialSettings.model_validate({"trial": plots, "stage": "V10", **more})


def test_the_plan_is_the_fastest_pattern_of_the_front_that_is_as_good_as_any_in_the_minutes(
    plots: Path, tmp_path: Path
) -> None:
    made = plan_trial(tmp_path / "plan", asked(plots, minutes=5.0), VEHICLE)
    within = [each for each in made.front if each.minutes <= 5.0]
    assert made.plots == 40
    assert 1 < len(made.front) <= 12
    least_m = min(each.errors_m for each in within)
    assert made.chosen is next(each for each in made.front if each.errors_m <= 1.1 * least_m)
    assert load_plan(tmp_path / "plan", patterns=True).pattern == made.chosen.worth.pattern
    with (tmp_path / "plan" / FRONT_FILE).open() as lines:
        assert len(list(csv.DictReader(lines))) == len(made.front)


def test_the_plan_is_the_fastest_pattern_with_errors_as_wanted(plots: Path, tmp_path: Path) -> None:
    made = plan_trial(tmp_path / "plan", asked(plots, height_error_m=0.04), VEHICLE)
    assert made.chosen is next(each for each in made.front if each.height_m <= 0.04)
    with pytest.raises(UsageError, match=r"no pattern is expected to measure heights to 1 cm"):
        plan_trial(tmp_path / "better", asked(plots, height_error_m=0.01), VEHICLE)


def test_what_cannot_be_is_refused(plots: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"the fastest takes"):
        plan_trial(tmp_path / "plan", asked(plots, minutes=0.2), VEHICLE)
    with pytest.raises(UsageError, match=r"how high are the plants"):
        plan_trial(tmp_path / "plan", asked(plots, stage=None), VEHICLE)


@pytest.mark.parametrize("vehicle", ["dji-mavic-3-enterprise", "ardupilot-pan"])
def test_patterns_over_other_plants_and_by_other_lenses_keep_pixels_and_angles(vehicle: str) -> None:
    def told(name: str, plants_m: float) -> list[tuple[float, float, float]]:
        flyer = load_vehicle(name)
        patterns = [worth.pattern for worth in shipped_patterns("V10", plants_m, flyer).patterns]
        above = [pattern.height_m - (plants_m or 1.33) for pattern in patterns]
        return [
            (1000.0 * a / flyer.camera.fx, pattern.along_m / a, pattern.between_m / a)
            for pattern, a in zip(patterns, above, strict=True)
        ]

    np.testing.assert_allclose(told(vehicle, 1.8), told("ardupilot-pitch", 0.0), rtol=0.02)
