"""Findings about results that are hardly those of the plot."""

from dataclasses import replace

import numpy as np
import pytest

from fieldkit.cli.reconstruction_options import parse_bounds
from fieldkit.clouds import Cloud, Volume
from fieldkit.geometry import Pose
from fieldkit.reconstruction.quality_flags import quality_flags
from fieldkit.reconstruction.result import MetricFrame
from fieldkit.results.frame import Plane
from tests.evaluation.examples import reconstruction
from tests.reconstruction.synthetic import ring

VOLUME = Volume((-1.0, -1.0, 0.0), (1.0, 1.0, 1.5))
GROUND = Plane((0.0, 0.0, 1.0), 0.0, 0.004, 0.3, 0.01)
PLANTS = Cloud(np.random.default_rng(0).uniform((-0.4, -0.4, 0.05), (0.4, 0.4, 0.9), (2000, 3)))


def frame(ground: Plane | None) -> MetricFrame:
    return replace(reconstruction().sparse.frame, ground=ground)


def codes(
    plants: Cloud = PLANTS, ground: Plane | None = GROUND, roll_deg: float = 0.0, *, own: bool = True
) -> set[str]:
    poses = {}
    for k, pose in enumerate(ring(6)):
        yaw, pitch, _ = pose.yaw_pitch_roll_deg()
        poses[f"{k}.jpg"] = Pose.from_yaw_pitch(pose.center, yaw, pitch, roll_deg)
    return {f.code for f in quality_flags("plot", plants, VOLUME, 0.001, frame(ground), poses, own_ground=own)}


def test_nothing_is_said_of_a_plot_on_level_ground() -> None:
    assert codes() == set()
    assert codes(roll_deg=90.0) == set()  # photographs in portrait format
    assert codes(ground=None, own=False) == set()


@pytest.mark.parametrize(
    ("changed", "code"),
    [
        ({"plants": PLANTS.select(np.arange(12))}, "few-plant-points"),
        ({"ground": None}, "no-ground"),
        ({"ground": replace(GROUND, offset_m=170.0)}, "volume-below-ground"),
        ({"roll_deg": 29.0}, "cameras-off-level"),
        ({"roll_deg": -61.0}, "cameras-off-level"),
    ],
)
def test_what_is_hardly_the_plots_is_said(changed: dict[str, object], code: str) -> None:
    assert code in codes(**changed)


def test_a_references_ground_is_not_doubted() -> None:
    assert codes(ground=replace(GROUND, inlier_share=0.01), roll_deg=29.0, own=False) == set()


@pytest.mark.parametrize(("apart_m", "told"), [(5.6, True), (1.0, False)])
def test_two_plots_in_one_folder_are_told(apart_m: float, told: bool) -> None:
    shift = np.array([apart_m, 0.0, 0.0])
    poses = {f"{k}": pose for k, pose in enumerate(ring(6, 2.0, 1.5, (0.0, 0.0, 0.45)))}
    poses |= {f"{k} of the other": Pose(pose.rotation, pose.center + shift) for k, pose in poses.items()}
    found = quality_flags("plot", PLANTS, VOLUME, 0.001, frame(GROUND), poses, own_ground=True, own_volume=True)
    assert [f.code for f in found] == ["plots-together"] * told
    assert all("2 places, 5.6 m apart" in f.message for f in found)


def test_weeds_far_from_the_stand_are_said_with_the_bounds_without_them() -> None:
    weed = Cloud(np.random.default_rng(1).uniform((0.9, 0.9, 0.0), (0.94, 0.94, 0.05), (50, 3)))
    both = Cloud(np.concatenate([PLANTS.points, weed.points]))
    found = quality_flags("plot", both, VOLUME, 0.001, frame(GROUND), {}, own_ground=False, own_volume=True)
    assert [f.code for f in found] == ["plants-apart"]
    bounds = parse_bounds(found[0].message.rpartition("--bounds ")[2])
    assert Volume(bounds[:3], bounds[3:]).contains(PLANTS.points).all()
    assert not Volume(bounds[:3], bounds[3:]).contains(weed.points).any()
    assert not quality_flags("plot", PLANTS, VOLUME, 0.001, frame(GROUND), {}, own_ground=False, own_volume=True)
    assert "plants-apart" not in codes(both)  # bounds were given
