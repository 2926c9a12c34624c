import numpy as np
import pytest

from fieldkit.clouds import Volume


def test_contains_its_faces_and_its_corners() -> None:
    volume = Volume((-1, -2, 0), (1, 2, 3))
    assert volume.contains(volume.corners()).all()
    assert not volume.contains(volume.grown(0.001).corners()).any()
    assert volume.contains(volume.center[None]).all()
    np.testing.assert_allclose(volume.size, [2, 4, 3])
    assert volume.diagonal == pytest.approx(np.sqrt(4 + 16 + 9))
    assert volume.corners().shape == (8, 3)


def test_impossible_boxes_are_refused() -> None:
    for lower, upper in [((0, 0, 0), (1, 1, 0)), ((0, 0, np.nan), (1, 1, 1)), ((0, 0), (1, 1))]:
        with pytest.raises(ValueError):
            Volume(lower, upper)
    with pytest.raises(ValueError, match="no points"):
        Volume.around(np.zeros((0, 3)))
