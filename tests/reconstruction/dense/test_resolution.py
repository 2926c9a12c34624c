"""Sizes of views by the ground sampling distance at the plants."""

import numpy as np
import pytest

from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense.resolution import MOST_PIXELS, plant_depth_m, resolution, steps_finer
from fieldkit_sim.simulation import ring

CAMERA = Intrinsics.pinhole(2000, 1500, 1700.0)
PLOT = Volume((-0.7, -0.6, 0.0), (0.7, 0.6, 1.2))


def above(height_m: float, x: float = 0.0) -> Pose:
    return Pose(np.diag([1.0, -1.0, -1.0]), np.array([x, 0.0, height_m]))


def of(fidelity: str, pose: Pose, camera: Intrinsics = CAMERA, volume: Volume = PLOT, *, metric: bool = True):
    return resolution((camera.width, camera.height), camera, pose, volume, fidelity, metric=metric)


@pytest.mark.parametrize(("fidelity", "gsd_m"), [("draft", 0.004), ("standard", 0.002), ("fine", 0.0012)])
@pytest.mark.parametrize("factor", [1, 2])
def test_the_plants_have_the_wanted_gsd_whatever_distance_and_camera(fidelity, gsd_m, factor):
    camera = CAMERA.scaled(2000 * factor, 1500 * factor)
    for pose in (above(2.4), above(3.0), ring(1, 1.4, 1.9)[0]):
        own = plant_depth_m(camera, pose, PLOT) / camera.fx
        found = of(fidelity, pose, camera)
        assert found.gsd_m == pytest.approx(max(own, gsd_m), rel=0.045)
        assert found.size[0] == pytest.approx(camera.width * own / found.gsd_m, abs=1)
        assert found.size[0] * 0.75 == pytest.approx(found.size[1], abs=1)


def test_a_photograph_reduced_by_another_program_has_a_gsd_of_its_own():
    small = resolution((1000, 750), CAMERA, above(3.0), PLOT, "full")
    assert small.gsd_m == pytest.approx(2 * of("full", above(3.0)).gsd_m)


def test_pixels_are_capped():
    large = CAMERA.scaled(8000, 6000)
    assert not of("standard", above(2.5), large).capped
    for fidelity, height_m in (("full", 3.0), ("fine", 8.0), ("standard", 8.0), ("draft", 8.0)):
        found = of(fidelity, above(height_m), large)
        assert found.capped
        assert 0.8 * MOST_PIXELS[fidelity] < found.size[0] * found.size[1] <= 1.001 * MOST_PIXELS[fidelity]


def test_the_depth_of_a_long_plot_is_that_of_what_fills_the_picture():
    long = Volume((-10.0, -0.5, 0.0), (10.0, 0.5, 1.0))
    assert plant_depth_m(CAMERA, above(3.0, x=-9.0), long) == pytest.approx(2.5, abs=0.1)
    assert plant_depth_m(CAMERA, above(3.0, x=-30.0), long) == pytest.approx(30.1, abs=0.1), "no ray meets it"


def test_small_plants_are_taken_more_finely():
    pot = Volume((-0.1, -0.1, 0.0), (0.1, 0.1, 0.2))
    camera = CAMERA.scaled(4000, 3000)
    assert of("standard", above(0.9), camera, pot).gsd_m == pytest.approx(0.002 * pot.diagonal, rel=0.05)


@pytest.mark.parametrize(("share", "plants"), [(0.01, 25_000), (0.003, 48e6 / 10 * 0.003), (0.2, None), (0.0, None)])
def test_plants_that_fill_few_pixels_are_taken_more_finely(share, plants):
    camera = CAMERA.scaled(8000, 6000)
    plain = of("standard", above(3.0), camera).size
    finer = steps_finer([share], [plain] * 10, "standard")
    width, height = resolution((8000, 6000), camera, above(3.0), PLOT, "standard", finer=finer).size
    assert 0.8 * plants < share * width * height <= 1.01 * plants if plants else (width, height) == plain


def test_without_a_scale_sizes_are_those_of_photographs_that_cover_two_metres():
    assert of("draft", above(9.0), metric=False).size == (500, 375)
    assert of("standard", above(1.0), metric=False).size == (1000, 750)
