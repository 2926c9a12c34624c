"""The demo's verdict: a planned pattern against an app's grid, by the truth."""

import pytest

from fieldkit.report.sections.demo import demo_errors, demo_statement, demo_traits
from fieldkit.results.demo import DemoFlight, DemoReport
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.traits import TraitsEntry


def report(height_m: float, cover: float) -> DemoReport:
    """The grid off by 4 cm and 5 %; the planned pattern as given."""
    flights = [
        DemoFlight(name=name, minutes=1.3, photographs=14, errors=errors, held=7, known=8)
        for name, errors in (
            ("planned", {"height_p95_m": height_m, "cover_percent": cover}),
            ("grid", {"height_p95_m": 0.04, "cover_percent": 5.0}),
        )
    ]
    truth = {"r1c1": TraitsEntry(height_p95_m=0.801, cover_percent=5.3)}
    return DemoReport(seed=0, pose_noise=(0.02, 1.0), wind_m=0.01, vehicle_kg=1.0, flights=tuple(flights), truth=truth)


def test_measured_traits_stand_beside_true_ones() -> None:
    known = TraitsEntry(height_p95_m=0.82, height_p95_error_m=0.03, unknown={"cover_percent": "why"})
    plot = PlotEvaluation(name="r1c1", images=10, seconds=1.0, cpu_seconds=1.0, traits=known)
    table = demo_traits(report(0.02, 2.0), {"grid": [plot]})
    assert [column.label for column in table.columns][2:] == [
        "height, 95 %, m",
        "true height, 95 %, m",
        "true cover, %",
    ]
    assert table.rows == (("r1c1", "app's grid", "0.82 ± 0.03", "0.80", "5.3"),)
    errors = demo_errors(report(0.02, 2.0))
    assert errors.rows[0] == ("planned pattern", "1.3", "14", "0.020", "2.00", "7 of 8")


@pytest.mark.parametrize(
    ("height_m", "cover", "level", "said"),
    [
        (0.01, 1.0, "good", "2 with smaller errors than the app's grid and 0 with larger"),
        (0.01, 19.0, "fact", "1 with smaller errors than the app's grid and 1 with larger"),
        (0.04, 4.0, "fact", "0 with smaller errors than the app's grid and 0 with larger"),
        (0.19, 5.0, "problem", "0 with smaller errors than the app's grid and 1 with larger"),
    ],
)
def test_the_verdict_claims_no_more_than_four_plots_tell(height_m: float, cover: float, level: str, said: str) -> None:
    found = demo_statement(report(height_m, cover))
    assert found.level == level
    assert said in found.text
    assert f"{height_m:.3f} against 0.040 m" in found.text
