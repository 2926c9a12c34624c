"""Orthographic pictures of clouds."""

import numpy as np
import pytest

from fieldkit.pictures.projection import FRONT, SIDE, TOP, Window, draw_points, eye_dome_shade

WINDOW = Window(-1.0, 1.0, -0.5, 0.5, 200, 100)
RED, BLUE = (200, 0, 0), (0, 0, 200)


def draw(points: list[tuple[float, float, float]], colors: list[tuple[int, int, int]], direction=FRONT) -> np.ndarray:
    return draw_points(np.array(points, dtype=float), np.array(colors, dtype=np.uint8), direction, WINDOW)


def test_a_point_lies_where_it_should() -> None:
    picture = draw([(0.5, 7.0, 0.25)], [RED])
    assert picture.shape == (100, 200, 4)
    rows, columns = np.nonzero(picture[..., 3])
    assert (rows.mean(), columns.mean()) == (25, 150)
    assert tuple(picture[25, 150]) == (*RED, 255)


@pytest.mark.parametrize(
    ("direction", "near", "far"),
    [(FRONT, (0, -1, 0), (0, 1, 0)), (SIDE, (1, 0, 0), (-1, 0, 0)), (TOP, (0, 0, 1), (0, 0, -1))],
)
@pytest.mark.parametrize("swap", [False, True])
def test_the_nearer_point_hides_the_other(direction, near, far, swap: bool) -> None:
    points, colors = ([far, near], [BLUE, RED]) if swap else ([near, far], [RED, BLUE])
    picture = draw(points, colors, direction)
    assert tuple(picture[50, 100, :3]) == RED


def test_points_outside_are_left_out() -> None:
    assert not draw([(1.5, 0, 0), (0, 0, -0.6)], [RED, RED])[..., 3].any()
    assert draw([(-1.0, 0, 0.4999)], [RED])[0, 0, 3] == 255


def test_no_points() -> None:
    assert not draw_points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), TOP, WINDOW).any()


def test_dense_clouds_get_smaller_discs() -> None:
    one = np.count_nonzero(draw([(0, 0, 0)], [RED])[..., 3])
    many = np.count_nonzero(draw([(0, 0, 0)] * 9, [RED] * 9)[..., 3])
    assert many < one


class TestShade:
    def test_flat_is_bright(self) -> None:
        assert (eye_dome_shade(np.zeros((9, 9)))[2:-2, 2:-2] == 1).all()

    def test_behind_an_edge_is_dark(self) -> None:
        nearness = np.zeros((9, 10))
        nearness[:, 5:] = 1.0
        shade = eye_dome_shade(nearness)
        assert (shade[:, 4] < 0.9).all()
        assert (shade[:, 5:] == 1).all()
        assert (shade[:, :3] == 1).all()

    def test_nothing(self) -> None:
        assert (eye_dome_shade(np.full((3, 3), -np.inf)) == 1).all()
