"""Which pairs hold a model together, on simulated photographs and on small graphs of matches."""

import numpy as np
import pytest

from fieldkit.geometry import Pose
from fieldkit.reconstruction.guided import Band, GuidedSettings, Region, match_guided
from fieldkit.reconstruction.mapping.view_graph import (
    Pair,
    is_edge,
    null_model_matches,
    rivalless_matches,
    usable_matches,
)
from tests.reconstruction.synthetic import feature_scene, posed, ring

REGION = Region((0.0, 0.0, 0.0), 0.3)
BAND = Band(4.0, REGION, REGION)
LOOSE = GuidedSettings(ratio=0.95, max_rotation_deg=180.0, max_scale_octaves=1e9)
LEAST = 4


@pytest.mark.parametrize(
    "other", [(0.9, 0.4, 0.5), (1.0, 0.0, 0.9), (0.6, 0.0, 0.35)], ids=["beside", "above", "in front"]
)
def test_a_displaced_band_gives_what_chance_gives(other: tuple[float, float, float]) -> None:
    """Also where the epipolar lines are upright, as between cameras above each other."""
    poses = [Pose.look_at((1.0, 0.0, 0.5), (0, 0, 0)), Pose.look_at(other, (0, 0, 0))]
    scene = feature_scene(poses, clutter=500)
    a, b = posed(scene, 0), posed(scene, 1)
    found = match_guided(a, b, BAND)
    chance = null_model_matches(a, b, BAND)
    assert len(found) > 100
    assert chance < 0.1 * len(found)


def crowded() -> tuple[list[int], dict[Pair, np.ndarray]]:
    """Images 0 to 2 hang together by good pairs, 3 and 4 too, 5 and 6 have none; weak pairs go between them."""
    counts = [40] * 7
    row = np.arange(5)
    return counts, {
        (0, 1): np.stack([row, row], axis=1).astype(np.uint32),
        (1, 2): np.stack([row + 2, row], axis=1).astype(np.uint32),
        (0, 2): np.array([[0, 0], [20, 21]], np.uint32),
        (3, 4): np.stack([row, row], axis=1).astype(np.uint32),
        (2, 3): np.array([[4, 30], [31, 32]], np.uint32),
        (2, 5): np.array([[4, 7], [33, 8], [3, 9]], np.uint32),
        (5, 6): np.array([[7, 7], [10, 10]], np.uint32),
    }


def nothing(i: int, j: int) -> np.ndarray:
    return np.zeros((0, 2), np.uint32)


EDGES = {(0, 1), (1, 2), (3, 4)}


def test_weak_pairs_inside_a_part_that_holds_are_left_out() -> None:
    assert (0, 2) not in usable_matches(*crowded(), EDGES, nothing, least=LEAST)


def test_weak_pairs_between_parts_add_what_three_views_can_check() -> None:
    assert usable_matches(*crowded(), EDGES, nothing, least=LEAST)[2, 3].tolist() == [[4, 30]]


def test_matches_without_a_rival_are_added() -> None:
    def second(i: int, j: int) -> np.ndarray:
        return crowded()[1][i, j][1:2]

    used = usable_matches(*crowded(), EDGES, second, least=LEAST)
    assert used[2, 3].tolist() == [[4, 30], [31, 32]]
    assert used[2, 5].tolist() == [[4, 7], [33, 8], [3, 9]]
    assert (0, 2) not in used


def test_matches_without_a_rival_are_right_where_the_band_is_crowded() -> None:
    """And are some of the band's."""
    scene = feature_scene(ring(16)[:2], clutter=3000, points=100)
    a, b = posed(scene, 0), posed(scene, 1)
    band = Band(20.0, REGION, rule=LOOSE)
    found, alone = match_guided(a, b, band), rivalless_matches(a, b, band)

    def right(matches: np.ndarray) -> int:
        shows = scene.point_of[0][matches[:, 0]]
        return int(((shows == scene.point_of[1][matches[:, 1]]) & (shows >= 0)).sum())

    assert {tuple(row) for row in alone.tolist()} <= {tuple(row) for row in found.tolist()}
    assert right(alone) > 0.9 * right(found)
    assert len(alone) - right(alone) < 0.6 * (len(found) - right(found))


def test_an_image_that_lacks_ties_gets_what_touches_a_good_pair() -> None:
    assert usable_matches(*crowded(), EDGES, nothing, least=LEAST)[2, 5].tolist() == [[4, 7], [3, 9]]


@pytest.mark.parametrize("factor", [0.2, 0.7, 0.9, 1.1, 1.4, 5.0])
def test_one_band_decides_as_two_where_it_is_clear(factor: float) -> None:
    """And where it is not, the mean of both does."""
    scene = feature_scene(ring(16)[:2], clutter=2000, points=50)
    a, b = posed(scene, 0), posed(scene, 1)
    band = Band(40.0, REGION, rule=LOOSE)
    chance = null_model_matches(a, b, band)
    assert chance > 20
    found = round(factor * 3.0 * chance)
    assert is_edge(a, b, found, band, least=1) == (found >= 3.0 * chance)
