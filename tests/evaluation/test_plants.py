"""Plants one by one, of a simulated row whose plants are known."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fieldkit.clouds.canopy import Outline, rectangle
from fieldkit.evaluation.traits import plants_one_by_one
from fieldkit.results.traits import PlantEntry, Trait
from tests.evaluation.examples import ORIGIN, reconstruction
from tests.scenes.conftest import make_row

Counted = tuple[tuple[PlantEntry, ...], dict[str, int], dict[Trait, str]]
FRAME = replace(reconstruction().sparse.frame, origin=ORIGIN)
ROW = rectangle((-0.6, -0.5), (0.6, 0.5))


@cache
def counted(outline: Outline | None = ROW, slope: float = 0.0, *, seen: bool = True) -> Counted:
    """The row 0.25 m apart along x, on ground that rises to the east."""
    row, ground = make_row(), FRAME.ground
    assert ground is not None
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    ground = replace(ground, normal=tuple(normal.tolist()), offset_m=0.0)
    points = row.cloud.points + slope * row.cloud.points[:, :1] * (0.0, 0.0, 1.0)
    return plants_one_by_one(
        replace(row.cloud, points=points), ground, FRAME, outline, (0.004, 0.0, 1.25), lambda *_: seen
    )


def test_each_plant_stands_where_it_is_and_is_as_high() -> None:
    found, counts, unknown = counted()
    row = make_row()
    assert counts == {"plants": 3}
    assert unknown == {"row_gaps": unknown["row_gaps"]}
    assert "fewer than 4" in unknown["row_gaps"]
    for number, plant in enumerate(found, 1):
        own = row.cloud.points[row.plants == number]
        assert (plant.plant, plant.row, plant.in_row) == (number, None, None)
        assert (plant.x_m, plant.y_m) == pytest.approx((0.25 * (number - 2), 0.0), abs=0.02)
        assert plant.height_m == pytest.approx(own[:, 2].max(), abs=0.02)
        assert 0.01 < plant.area_m2 < 0.2
    assert found[1].touching > found[0].touching > 0.0  # it has neighbours on both sides


def test_places_on_earth() -> None:
    plant = counted()[0][0]
    assert plant.latitude_deg is not None
    assert plant.longitude_deg is not None
    there = ORIGIN.to_local(plant.latitude_deg, plant.longitude_deg, ORIGIN.altitude_m)
    foot = FRAME.plot_from_source.apply(there)
    assert np.ravel(foot)[:2] == pytest.approx((plant.x_m, plant.y_m), abs=0.01)


def test_on_a_slope() -> None:
    level, steep = counted()[0], counted(slope=0.15)[0]
    assert len(steep) == 3
    assert [plant.height_m for plant in steep] == pytest.approx([plant.height_m for plant in level], rel=0.03)


def test_neighbours_beyond_the_outline_do_not_count() -> None:
    found, counts, _ = counted(rectangle((-0.6, -0.5), (0.12, 0.5)))
    assert counts["plants"] == len(found) == 2
    assert max(plant.x_m for plant in found) < 0.12
