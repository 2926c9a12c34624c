"""The match graph of the small plot's eight photographs."""

from pathlib import Path

import numpy as np

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.planning.objective.objective import FIDELITIES
from fieldkit.planning.objective.recorded import RecordedSource, match_graph
from fieldkit.planning.space.cameras import view_angles_deg
from fieldkit.runtime.context import Context
from tests.planning.objective.test_recorded import PLOT, RANDOM_CLOUD, SMALL_PLOT

FEATURES = FIDELITIES["draft"].features


def test_neighbours_match_and_strangers_do_not(tmp_path: Path) -> None:
    source = RecordedSource(read_capture(SMALL_PLOT), PLOT, RANDOM_CLOUD, cache=StageCache(tmp_path))
    counted = match_graph(source, FEATURES, Context())
    np.testing.assert_array_equal(counted, counted.T)
    assert not np.diag(counted).any()
    centers = np.array([view.pose.center for view in source.views])
    angles = view_angles_deg(centers, np.array(PLOT.volume.center))
    assert not counted[angles > 60.0].any()
    neighbours = counted[angles < 40.0][counted[angles < 40.0] > 0]
    assert len(neighbours) == 2 * len(counted)
    assert np.median(neighbours) > 50
    elsewhere = RecordedSource(source.capture, PLOT, RANDOM_CLOUD, cache=StageCache(tmp_path / "other"))
    np.testing.assert_array_equal(match_graph(elsewhere, FEATURES, Context(workers=2)), counted)
