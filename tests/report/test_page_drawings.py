"""Charts and maps: where their marks lie."""

import math
import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fieldkit.figures.content import Curve, LineChart, MappedPlot, Measure, PlotMap
from fieldkit.figures.style import DISTANCE_RAMP
from fieldkit.report.html.drawings import HEIGHT, WIDTH, draw, draw_map, ramp_color, round_ticks

FINITE = st.floats(-1e9, 1e9)


def chart(*series: Curve) -> LineChart:
    return LineChart("t", "d", "x", "y", series, ())


def numbers(path: str) -> list[float]:
    return [float(n) for n in re.findall(r"-?[\d.]+", path)]


def test_a_line_goes_through_its_points() -> None:
    drawing = draw(chart(Curve("a", ((0, 0.0), (5, 10.0), (8, 5.0), (10, 0.0)))))
    (line,) = drawing.series
    assert line.path.count("M") == 1
    left, right, top, bottom = (float(v) for v in (drawing.left, drawing.right, drawing.top, drawing.bottom))
    assert numbers(line.path) == pytest.approx(
        [left, bottom, (left + right) / 2, top, left + 0.8 * (right - left), (top + bottom) / 2, right, bottom], abs=0.1
    )


@given(st.lists(st.tuples(FINITE, FINITE), min_size=1, max_size=20), st.sampled_from(["line", "band"]))
@example([(0.0, 5e-324)], "line")
@example([(0.0, 1.0), (5e-324, 2.0)], "line")
def test_everything_lies_in_the_drawing(points: list[tuple[float, float]], style: str) -> None:
    drawing = draw(chart(Curve("a", tuple(points), style)))
    path = drawing.series[0].path
    spots = [(float(a), float(b)) for a, b in re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", path)]
    assert all(0 <= x <= WIDTH and 0 <= y <= HEIGHT for x, y in spots)
    assert len(drawing.y_ticks) <= 6


@given(FINITE, st.floats(1e-6, 1e9), st.integers(2, 9))
def test_ticks_are_round_few_and_inside(low: float, size: float, most: int) -> None:
    high = low + size
    if high <= low:
        return
    ticks = round_ticks(low, high, most)
    assert 1 <= len(ticks) <= most
    if len(ticks) > 1:
        step = ticks[1] - ticks[0]
        slack = 1e-6 * max(abs(low), abs(high), step)
        assert all(low - slack <= tick <= high + slack for tick in ticks)


def test_not_finite_is_an_error() -> None:
    with pytest.raises(ValueError, match="finite"):
        draw(chart(Curve("a", ((0.0, math.nan),))))
    with pytest.raises(ValueError, match="finite"):
        draw_map(PlotMap("t", (MappedPlot("a", ((math.inf, 0.0),)),), ()))
    with pytest.raises(ValueError, match="plots"):
        draw_map(PlotMap("t", (), ()))


def test_a_map_keeps_shape_direction_and_scale() -> None:
    wide = MappedPlot("wide", ((0.0, 0.0), (40.0, 0.0), (40.0, 10.0), (0.0, 10.0)))
    north = MappedPlot("north", ((0.0, 20.0), (10.0, 20.0), (10.0, 30.0), (0.0, 30.0)))
    height = Measure("height", "m", {"d1": {"wide": 1.0}})
    distance = Measure("quality", "mm", {"d1": {"wide": 5.0, "north": 9.0}})
    drawn = draw_map(PlotMap("t", (wide, north), (height, distance), {"wide": "plot-1"}))
    measure = drawn.measures[1]
    ((_, (first, second)),) = measure.dates
    assert (first.anchor, second.anchor) == ("plot-1", "")
    a, b = numbers(first.path), numbers(second.path)
    width, tall = max(a[::2]) - min(a[::2]), max(a[1::2]) - min(a[1::2])
    assert width == pytest.approx(4 * tall, abs=0.5)
    assert max(b[1::2]) < min(a[1::2])  # north is up
    assert float(drawn.bar[0]) == pytest.approx(width / 40 * float(drawn.bar[1].removesuffix(" m")), abs=0.2)
    assert (first.fill, second.fill) == (DISTANCE_RAMP[0], DISTANCE_RAMP[-1])
    assert first.text == "wide, d1, quality: 5 mm"
    assert (measure.low, measure.high) == ("5", "9")


def test_plots_without_a_value_say_why() -> None:
    plot = MappedPlot("a", ((0.0, 0.0),))
    drawn = draw_map(PlotMap("t", (plot,), (Measure("quality", "mm", {"d": {}}, {"d": {"a": "no photographs"}}),)))
    shape = drawn.measures[0].dates[0][1][0]
    assert (shape.fill, shape.text) == ("", "a, d, quality: no photographs")


@given(st.floats(0, 1))
def test_ramp(share: float) -> None:
    assert re.fullmatch(r"#[0-9a-f]{6}", ramp_color(share))
    assert [ramp_color(k / 4) for k in range(5)] == list(DISTANCE_RAMP)
