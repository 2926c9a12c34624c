import numpy as np
import pytest
from hypothesis import given

from fieldkit.clouds import Cloud, concatenate
from tests.clouds.examples import clouds


def test_shapes_types_and_finiteness_are_checked() -> None:
    with pytest.raises(ValueError, match=r"shape \(n, 3\)"):
        Cloud(np.zeros((4, 2)))
    with pytest.raises(ValueError, match="finite"):
        Cloud(np.array([[0.0, np.nan, 0.0]]))
    with pytest.raises(ValueError, match="3 colors for 4 points"):
        Cloud(np.zeros((4, 3)), colors=np.zeros((3, 3), np.uint8))
    with pytest.raises(ValueError, match="uint8"):
        Cloud(np.zeros((4, 3)), colors=np.zeros((4, 3)))
    with pytest.raises(ValueError, match="normals"):
        Cloud(np.zeros((4, 3)), normals=np.zeros((4, 4)))
    with pytest.raises(ValueError, match="filled"):
        Cloud(np.zeros((4, 3)), filled=np.zeros(3, np.bool_))


@given(clouds())
def test_selecting_by_mask_and_by_index_agree(cloud: Cloud) -> None:
    mask = np.arange(len(cloud)) % 2 == 0
    by_mask, by_index = cloud.select(mask), cloud.select(np.flatnonzero(mask).tolist())
    np.testing.assert_array_equal(by_mask.points, by_index.points)
    assert (by_mask.colors is None) == (cloud.colors is None)
    assert (by_mask.normals is None) == (cloud.normals is None)


def test_concatenation_keeps_what_all_have() -> None:
    plain, colored = Cloud(np.zeros((2, 3))), Cloud(np.ones((1, 3)), np.full((1, 3), 7, np.uint8))
    assert concatenate([colored, Cloud.empty(), colored]).colors is not None
    both = concatenate([plain, colored])
    assert len(both) == 3
    assert both.colors is None
    assert len(concatenate([])) == 0
