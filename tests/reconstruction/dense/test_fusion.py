"""The rule by which depths become points, on depth maps made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from fieldkit.clouds.volume import Volume
from fieldkit.reconstruction.dense import DepthMap, View, fuse, fusion
from fieldkit.reconstruction.dense.fusion import (
    MAX_RELATIVE_DEPTH,
    MAX_REPROJECTION_PX,
    WIDEST_PX,
    Stack,
    fusion_rule,
    tolerances,
)
from fieldkit.results.frame import Plane as Ground
from tests.reconstruction.dense.planes import VOLUME, Plane, ring, scene_views

Made = tuple[list[View], list[DepthMap]]


def made(count: int) -> Made:
    """Views of the plane z = 0 with exact depth maps."""
    views, depths = scene_views([Plane()], ring(count))
    maps = []
    for view, depth in zip(views, depths, strict=True):
        normal = np.zeros((*depth.shape, 3), dtype=np.float32)
        normal[..., 2] = 1.0
        maps.append(DepthMap(view.name, depth.astype(np.float32), normal, np.zeros(depth.shape, dtype=np.float32)))
    return views, maps


@pytest.fixture(scope="module")
def perfect() -> Made:
    return made(4)


@pytest.fixture(scope="module")
def eight() -> Made:
    return made(8)


def scaled(depth_map: DepthMap, factor: float) -> DepthMap:
    return replace(depth_map, depth=(depth_map.depth * np.float32(factor)).astype(np.float32))


def test_exact_depths_give_points_on_the_plane(perfect):
    cloud = Stack.of(*perfect, VOLUME).agreeing_points()
    assert len(cloud) > 20_000
    # Agreeing pixels are up to 1.5 pixels apart, which on a plane seen at 16° moves the mean depth a little.
    assert np.abs(cloud.points[:, 2]).max() < 0.004
    assert np.abs(cloud.points[:, 2]).mean() < 0.001
    assert cloud.normals is not None
    assert np.allclose(cloud.normals, [0, 0, 1])


def test_a_pixel_is_used_once(perfect):
    views, maps = perfect
    pixels = sum((m.depth > 0).sum() for m in maps)
    assert len(Stack.of(views, maps, VOLUME).agreeing_points()) < 0.6 * pixels


@pytest.mark.parametrize(("needed", "wrong", "kept"), [(1, 2, True), (2, 1, True), (2, 2, False), (3, 1, False)])
def test_enough_views_have_to_agree(perfect, needed, wrong, kept):
    views, maps = perfect
    maps = [scaled(m, 1.0 + 0.05 * (i + 1)) if i < wrong else m for i, m in enumerate(maps)]
    on_plane = np.abs(Stack.of(views, maps, VOLUME).agreeing_points(needed).points[:, 2]) < 0.01
    assert bool(np.count_nonzero(on_plane) > 1000) is kept


@pytest.mark.parametrize(("factor", "kept"), [(1.008, True), (1.016, False)])
def test_depths_agree_within_a_relative_difference(perfect, factor, kept, monkeypatch):
    views, maps = perfect
    two = ([views[0], views[1]], [maps[0], scaled(maps[1], factor)])
    monkeypatch.setattr(fusion, "MAX_REPROJECTION_PX", 10.0)
    assert (len(Stack.of(*two, VOLUME).agreeing_points(1)) > 1000) is kept


def test_depths_from_afar_agree_within_widths_of_a_pixel(perfect, monkeypatch):
    views, maps = perfect
    two = ([views[0], views[1]], [maps[0], scaled(maps[1], 1.008)])
    assert len(Stack.of(*two, VOLUME).agreeing_points(1)) > 1000
    monkeypatch.setattr(fusion, "MAX_DEPTH_PX", 0.004 * views[0].intrinsics.fx)
    assert len(Stack.of(*two, VOLUME).agreeing_points(1)) < 1000


def test_depths_agree_within_a_round_trip(perfect, monkeypatch):
    views, maps = perfect
    two = ([views[0], views[1]], [maps[0], scaled(maps[1], 1.01)])
    counts = []
    for limit in (0.2, 1.0, 4.0):
        monkeypatch.setattr(fusion, "MAX_REPROJECTION_PX", limit)
        counts.append(len(Stack.of(*two, VOLUME).agreeing_points(1)))
    assert counts[0] < counts[1] < counts[2]


def swaying(eight: Made, share: float) -> Made:
    """Depths before and behind the plane, of two views each at four places."""
    views, maps = eight
    return views, [scaled(m, 1.0 + share * (i % 4 - 1.5)) for i, m in enumerate(maps)]


def test_depths_of_what_stands_still_hardly_scatter(eight):
    assert Stack.of(*eight, VOLUME).scatter_px() < 0.2
    two = eight[0][:2], eight[1][:2]
    assert Stack.of(*two, VOLUME).scatter_px() == 0.0  # no second view


def test_depths_scatter_with_what_sways(eight):
    little, much = (Stack.of(*swaying(eight, share), VOLUME).scatter_px() for share in (0.01, 0.04))
    assert 0.2 < little < 0.5 * much


@pytest.mark.parametrize(("depth_m", "counts"), [(0.06, True), (0.04, False)])
def test_what_lies_on_the_ground_scatters_for_nothing(eight, depth_m, counts):
    views, maps = swaying(eight, 0.0)
    ground = Ground(normal=(0.6, 0.0, 0.8), offset_m=-depth_m, rms_m=0.0, inlier_share=1.0, tolerance_m=0.01)
    level = replace(ground, normal=(0.0, 0.0, 1.0))
    expected = Stack.of(views, maps, VOLUME).scatter_px() if counts else 0.0
    assert Stack.of(views, maps, VOLUME).scatter_px(ground=level) == expected
    assert Stack.of(views, maps, VOLUME).scatter_px(ground=ground) > 0.0  # a slope, on whose one side the plane stands


def test_tolerances_are_wider_where_depths_scatter_only():
    still = MAX_RELATIVE_DEPTH, MAX_REPROJECTION_PX
    assert tolerances(0.0) == tolerances(1.05) == still
    relative, pixels = tolerances(2.6)
    assert pixels == pytest.approx(6.0)
    assert relative == pytest.approx(4 * MAX_RELATIVE_DEPTH)
    assert tolerances(9.0)[1] == WIDEST_PX
    assert "depths within 1.2 % and 8 widths of a pixel, reprojection < 1.5 px" in fusion_rule(2, 0.9)
    assert "depths within 4.8 % and 32 widths of a pixel, reprojection < 6 px" in fusion_rule(2, 2.6)


def test_a_surface_that_every_view_shows_elsewhere_is_fused_at_its_mean_place(eight):
    given = swaying(eight, 0.008)
    strict, wide = (Stack.of(*given, VOLUME).agreeing_points(2, scatter_px) for scatter_px in (0.0, 3.0))
    off = [np.abs(cloud.points[:, 2]).mean() for cloud in (strict, wide)]
    assert off[1] < 0.5 * off[0]
    assert len(wide) < len(strict)  # one layer, not two


def test_wide_tolerances_let_no_depth_pass_that_views_see_through(eight):
    views, maps = disputed(eight, 5)
    assert len(Stack.of(views, maps, VOLUME).agreeing_points(2, 4.0)) < 0.05 * len(
        Stack.of(*eight, VOLUME).agreeing_points(2, 4.0)
    )


def test_colours_are_the_mean_of_the_agreeing_pixels(perfect):
    views, maps = perfect
    painted = []
    for i, view in enumerate(views):
        painted.append(replace(view, image=np.full_like(view.image, 10 + 20 * i)))
    cloud = Stack.of(painted, maps, VOLUME).agreeing_points()
    all_four = (cloud.colors == 40).all(axis=1)
    assert all_four.mean() > 0.3
    assert cloud.colors.min() >= 10
    assert cloud.colors.max() <= 70


def disputed(full: Made, through: int) -> Made:
    """Depths in the first three views only; the last ``through`` views show background."""
    views, maps = full
    shape = views[0].image.shape[:2]
    masked = [replace(v, mask=np.full(shape, i < len(views) - through)) for i, v in enumerate(views)]
    return masked, [m if i < 3 else replace(m, depth=np.zeros_like(m.depth)) for i, m in enumerate(maps)]


def found_on_the_plane(given: Made) -> bool:
    """Whether the fused cloud has points of the plane z = 0 where all views see it."""
    cloud = Stack.of(*given, VOLUME).agreeing_points()
    middle = (np.abs(cloud.points[:, :2]) < 0.2).all(axis=1) & (np.abs(cloud.points[:, 2]) < 0.01)
    count = int(np.count_nonzero(middle))
    assert count == 0 or count > 1000
    return count > 0


@pytest.mark.parametrize(("through", "kept"), [(0, True), (1, True), (2, False), (5, False)])
def test_a_point_that_other_views_show_background_behind_is_dropped(eight, through, kept):
    # Three views agree, and two more have to than see through.
    assert found_on_the_plane(disputed(eight, through)) is kept


def test_unknown_depths_and_pixels_outside_of_the_photograph_are_no_background(eight):
    views, maps = disputed(eight, 5)
    outside = [replace(v, inside=v.mask) for v in views]
    assert (
        len(Stack.of(outside, maps, VOLUME).agreeing_points())
        == len(Stack.of(*disputed(eight, 0), VOLUME).agreeing_points())
        > 1000
    )


def test_a_point_in_front_of_what_other_views_show_is_dropped(eight):
    views, maps = eight
    behind = [m if i < 3 else scaled(m, 1.2) for i, m in enumerate(maps)]
    dear = [m if i < 3 else replace(m, cost=np.full_like(m.cost, 0.6)) for i, m in enumerate(behind)]
    assert found_on_the_plane((views, dear))
    assert not found_on_the_plane((views, behind))


def test_background_within_two_pixels_of_a_plant_proves_nothing(eight):
    views, maps = disputed(eight, 2)
    stripes = np.zeros(views[0].image.shape[:2], dtype=np.bool_)
    stripes[:, ::5] = True
    thin = [v if v.mask is None or v.mask.all() else replace(v, mask=stripes) for v in views]
    assert found_on_the_plane((thin, maps))
    assert not found_on_the_plane((views, maps))
    most = [v if i < 3 else replace(v, mask=np.roll(stripes, i, axis=1)) for i, v in enumerate(views)]
    assert len(Stack.of(most, maps, VOLUME).agreeing_points()) < 0.2 * len(
        Stack.of(thin, maps, VOLUME).agreeing_points()
    ), "but of many masks"


@pytest.mark.parametrize(("through", "filled"), [(0, True), (1, False)])
def test_a_hole_is_filled_from_one_view_where_all_masks_show_plants(eight, through, filled):
    views, maps = disputed(eight, through)
    alone = [m if i < 1 else replace(m, depth=np.zeros_like(m.depth)) for i, m in enumerate(maps)]
    assert found_on_the_plane((views, alone)) is filled
    cloud, _ = fuse(views, alone, VOLUME)
    assert cloud.filled is not None
    assert cloud.filled.all()
    assert not found_on_the_plane((eight[0], alone)), "without masks"
    assert not found_on_the_plane((views[:4], alone[:4])), "with four masks"


@pytest.mark.parametrize(("edge_px", "agreeing", "kept"), [(7, 2, False), (7, 3, True), (12, 2, True)])
def test_a_scrap_takes_one_view_more(eight, edge_px, agreeing, kept):
    views, maps = eight
    rows, columns = np.indices(maps[0].depth.shape)
    squares = (rows % (edge_px + 1) < edge_px) & (columns % (edge_px + 1) < edge_px)
    torn = [replace(maps[0], depth=np.where(squares, maps[0].depth, np.float32(0.0)))]
    empty = np.zeros_like(maps[0].depth)
    full = [m if i < agreeing else replace(m, depth=empty) for i, m in enumerate(maps[1:])]
    assert found_on_the_plane((views, torn + [replace(m, depth=m.depth * squares) for m in full])) is kept


@pytest.mark.parametrize(("edge_px", "filled"), [(10, False), (14, True)])
def test_a_scrap_fills_no_hole(eight, edge_px, filled):
    views, maps = disputed(eight, 0)
    rows, columns = np.indices(maps[0].depth.shape)
    squares = (rows % (edge_px + 1) < edge_px) & (columns % (edge_px + 1) < edge_px)
    alone = [replace(m, depth=m.depth * (squares & (i < 1))) for i, m in enumerate(maps)]
    assert found_on_the_plane((views, alone)) is filled


def test_points_outside_the_volume_are_dropped(perfect):
    small = Volume((-0.1, -0.2, -0.1), (0.1, 0.2, 0.1))
    cloud = Stack.of(*perfect, small).agreeing_points()
    assert len(cloud) > 100
    assert small.contains(cloud.points).all()
