"""The pictures of a planning run show what they were given."""

from __future__ import annotations

import numpy as np

from fieldkit.clouds import Cloud
from fieldkit.pictures.search import draw_plan, draw_regret, draw_search

PLANTS = Cloud(np.random.default_rng(0).uniform(0, 0.5, (50, 3)))


def test_a_plan_shows_its_cameras_and_the_views_that_were_left() -> None:
    positions = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.2], [-1.0, 0.0, 0.8]])
    others = np.array([[0.5, 2.0, 1.0], [-2.0, 0.3, 1.0]])
    figure = draw_plan("plan", positions, -positions / np.linalg.norm(positions, axis=1)[:, None], PLANTS, others)
    above = figure.axes[0]
    assert [text.get_text() for text in above.texts if text.get_text().isdigit()] == ["1", "2", "3"]
    drawn = [np.array(line.get_xydata()) for line in above.lines]
    assert any(np.allclose(points, others[:, :2]) for points in drawn if points.shape == (2, 2))
    low, high = above.get_xlim()
    assert low < -2.0 < 1.0 < high


def test_curves_have_gaps_where_nothing_was_measured() -> None:
    figure = draw_search([None, 0.02, 0.01], [None, 0.02, 0.01], {"rbf": [None, None, 0.4]}, 0.012)
    lines = [np.array(line.get_ydata(), dtype=float) for axes in figure.axes for line in axes.lines]
    assert any(len(y) == 3 and np.isnan(y[0]) and np.allclose(y[1:], [20, 10]) for y in lines)
    compared = draw_regret({"plot": {"field": [(0.02, 0.01), (0.03, 0.02)], "random": [(0.04,)]}})
    assert {text.get_text().split(" ")[0] for text in compared.axes[0].get_legend().get_texts()} == {"field", "random"}
    markers = {str(line.get_label()): line.get_marker() for line in compared.axes[0].lines}
    assert markers == {"field": "", "random": "o"}  # a line of one point would not be seen


def test_a_set_without_a_cloud_does_not_hide_the_rest() -> None:
    seeds = [(0.2, 0.005, 0.004), (0.2, 0.2, 0.003), (0.006, 0.006, 0.006)]
    axes = draw_regret({"plot": {"field": seeds, "circle": [(0.007,) * 3]}}).axes[0]
    (field,) = (line for line in axes.lines if line.get_label() == "field")
    np.testing.assert_allclose(np.array(field.get_ydata(), dtype=float), [200, 6, 4])  # the median of the seeds
    low, high = axes.get_ylim()
    heights = axes.transData.transform([(1.0, 200.0), (1.0, 6.0), (1.0, 4.0)])[:, 1] / axes.bbox.height
    assert low < 4.0 < 200.0 < high
    assert heights[1] - heights[2] > 0.05  # told apart, though one value is fifty times the other
