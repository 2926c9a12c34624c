"""What of a moved cloud can be the plot's plants."""

from dataclasses import replace

import numpy as np

from fieldkit.clouds import Cloud, Volume
from fieldkit.geometry import Similarity
from fieldkit.results.frame import Plane
from tests.evaluation.examples import reconstruction


def test_a_cloud_is_cropped_where_it_is_moved_to() -> None:
    """Weeds at 1 cm that poses have put at 4 cm are left out again, and feet that were put too low come back."""
    ground = Plane((0.0, 0.0, 1.0), 0.0, 0.002, 0.8, 0.006)
    nearby = Cloud(np.array([[0.0, 0.0, z] for z in (-0.02, 0.01, 0.04, 0.3)] + [[0.32, 0.0, 0.3]]))
    found = replace(reconstruction(), nearby=nearby, volume=Volume((-0.3, -0.3, 0.0), (0.3, 0.3, 0.5)))
    found = replace(found, sparse=replace(found.sparse, frame=replace(found.sparse.frame, ground=ground)))
    for shift, kept in (
        ((0.0, 0.0, 0.0), [0.01, 0.04, 0.3]),
        ((0.0, 0.0, -0.03), [0.01, 0.27]),
        ((0.0, 0.0, 0.03), [0.01, 0.04, 0.07, 0.33]),
        ((-0.03, 0.0, 0.0), [0.01, 0.04, 0.3, 0.3]),
    ):
        there = found.moved_plants(Similarity(1.0, np.eye(3), np.array(shift)))
        np.testing.assert_allclose(there.points[:, 2], kept, atol=1e-12)
