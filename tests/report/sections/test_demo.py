"""The demo's verdict: planned views against the circle, by both judges."""

import pytest

from fieldkit.report.sections.in_short import MEASURED, demo_statements, demo_traits
from fieldkit.results.demo import DemoEntry, DemoReport
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.traits import TraitsEntry


def report(**planned_mm: float) -> DemoReport:
    """The circle at 4 mm everywhere; planned views as given to the true plants, by plot."""
    entries = [
        DemoEntry(plot=plot, views=views, images=10, right=10, to_reference_m=0.003, to_true_plants_m=value / 1000)
        for plot, value_mm in planned_mm.items()
        for views, value in (("circle", 4.0), ("planned", value_mm))
    ]
    return DemoReport(
        seed=0,
        pose_noise=(0.02, 1.0),
        wind_m=0.01,
        vehicle_kg=1.5,
        reference_to_true_plants_m=0.004,
        scores=tuple(entries),
        truth={},
    )


def test_measured_traits_stand_beside_true_ones() -> None:
    truth = TraitsEntry(height_m=0.801, cover_percent=5.3, covered_area_m2=0.081)
    told = report(seen=3.6).model_copy(update={"truth": {"seen": truth}})
    known = TraitsEntry(height_m=0.82, height_error_m=0.03, covered_area_m2=0.078, unknown={"cover_percent": "why"})
    plot = PlotEvaluation(name="planned", images=10, seconds=1.0, cpu_seconds=1.0, traits=known)
    table = demo_traits(told, {"seen": [plot]})
    assert [column.label for column in table.columns][2:] == [
        "height, m",
        "true, m",
        "true, %",
        "covered area, m²",
        "true, m²",
    ]
    assert table.rows == (("the plot that was planned on", "planned", "0.82 ± 0.03", "0.80", "5.3", "0.078", "0.081"),)


@pytest.mark.parametrize(
    ("seen", "unseen", "level", "said"),
    [
        (3.6, 3.4, "good", "10 % nearer on the plot that was planned on and 15 % nearer on a plot never seen"),
        (3.6, 4.1, "fact", "10 % nearer on the plot that was planned on and level (2 % farther) on a plot never seen"),
        (4.0, 4.0, "fact", "level with the circle on the plot that was planned on and level with"),
        (4.4, 4.8, "problem", "10 % farther on the plot that was planned on and 20 % farther on a plot never seen"),
    ],
)
def test_the_verdict_claims_no_more_than_a_flight_can_tell(seen: float, unseen: float, level: str, said: str) -> None:
    many, drawn = demo_statements(report(seen=seen, unseen=unseen))
    assert many.text == MEASURED
    assert drawn.level == level
    assert said in drawn.text
