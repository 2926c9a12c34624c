"""The pictures of searches show what they were given."""

from __future__ import annotations

import numpy as np

from benchmarks.curves import draw_regret


def test_a_set_without_a_cloud_does_not_hide_the_rest() -> None:
    seeds = [(0.2, None, 0.004), (0.2, 0.2, 0.003), (0.006, 0.006, 0.006)]
    axes = draw_regret({"plot": {"field": seeds, "circle": [(0.007,) * 3]}}).axes[0]
    (field,) = (line for line in axes.lines if line.get_label() == "field")
    np.testing.assert_allclose(np.array(field.get_ydata(), dtype=float), [200, 103, 4])  # the median of the seeds
    low, high = axes.get_ylim()
    heights = axes.transData.transform([(1.0, 200.0), (1.0, 6.0), (1.0, 4.0)])[:, 1] / axes.bbox.height
    assert low < 4.0 < 200.0 < high
    assert heights[1] - heights[2] > 0.05  # told apart, though one value is fifty times the other
