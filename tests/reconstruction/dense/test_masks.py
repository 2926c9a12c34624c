"""Which pixels count as plants."""

import numpy as np
import pytest

from fieldkit.errors import UsageError
from fieldkit.reconstruction.dense.masks import excess_green, inner_colors, plant_mask

SOIL, LEAF, DARK_GREEN, GREY = (120, 100, 80), (90, 140, 60), (10, 30, 12), (128, 128, 128)


def field(size: int = 40) -> np.ndarray:
    return np.full((size, size, 3), SOIL, dtype=np.uint8)


def test_excess_green_is_the_published_index():
    image = np.array([[LEAF, GREY, SOIL]], dtype=np.uint8)
    r, g, b = (channel / sum(LEAF) for channel in LEAF)
    assert excess_green(image)[0] == pytest.approx([2 * g - r - b, 0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(("rows", "added"), [(4, 1), (5, 0), (10, 0)])
def test_thin_parts_are_found_with_the_mixed_pixels_around_them_and_wide_ones_without(rows, added):
    image = field()
    image[10 : 10 + rows, 10:30] = LEAF
    mask = plant_mask(image)
    assert mask is not None
    expected = np.zeros((40, 40), dtype=bool)
    expected[10 - added : 10 + rows + added, 10 - added : 30 + added] = True
    assert np.array_equal(mask, expected)


def test_a_stem_of_one_pixel_is_kept_and_a_speck_is_not():
    image = field()
    image[5:35, 20] = LEAF
    image[3, 3] = LEAF
    mask = plant_mask(image)
    assert mask[5:35, 20].all()
    assert not mask[:6, :6].any()


def test_dark_pixels_beside_a_leaf_are_background():
    image = np.full((20, 20, 3), 8, dtype=np.uint8)
    image[5:15, 8:10] = LEAF
    image[5:15, 10] = DARK_GREEN
    mask = plant_mask(image)
    assert mask.sum() == 20


def test_edges_have_the_colours_of_the_pixels_farther_in():
    image = field()
    image[10:20, 10:30] = LEAF
    mask = np.zeros((40, 40), dtype=bool)
    mask[9:21, 9:31] = True
    shown = inner_colors(image, mask)
    assert (shown[mask] == LEAF).all()
    assert np.array_equal(shown[~mask], image[~mask])
    assert (image[9, 9:31] == SOIL).all()  # the photograph itself is left alone


def test_a_file_is_taken_as_it_is():
    given = np.zeros((40, 40), dtype=np.uint8)
    given[3, 4] = 7
    mask = plant_mask(field(), "file", given)
    assert mask.sum() == 1
    assert mask[3, 4]


@pytest.mark.parametrize("given", [None, np.ones((39, 40))])
def test_a_file_of_another_shape_is_refused(given):
    with pytest.raises(UsageError, match="needs a mask image"):
        plant_mask(field(), "file", given)
