"""The paper's tables: ratios to the best baseline, and depth images of points."""

import numpy as np
import pytest

from benchmarks.depth_images import depth_image, depth_mae, pooled_depth_error
from benchmarks.paper import Plans, distance_table
from benchmarks.planner_transfer import Carried
from fieldkit.geometry import Intrinsics, Pose
from tests.benchmarks.test_planner_studies import ran


def test_ratios_are_to_the_best_baseline_of_the_plot() -> None:
    field = ran("field", 0, [5.0], 3.0)
    carried = [Carried(field, field.cameras, 0.003, 0.001, 0.002, 10.0, 0.0)]
    home: Plans = {
        "circle": [ran("circle", 0, [6.0], 5.0), ran("circle", 1, [6.0], 3.0)],
        "bosfm": [ran("bosfm", 0, [], 2.0)],
    }
    there: Plans = {"field, carried": carried, "circle, optimised there": [ran("circle", 0, [3.0], 2.5)]}
    table = distance_table("CD × 100", {"case-1": home, "test-case-1": there})
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["circle"] == ("0.400 (0.300–0.500)", "1.00", None, None)
    assert rows["bosfm"][1] == "0.50"  # it is no baseline here
    assert rows["field, carried"] == (None, None, "0.300", "1.20")
    assert rows["the paper's BOSfM"] == (None, "0.84", None, "0.87")


def test_a_pixel_has_the_depth_of_its_nearest_point() -> None:
    camera, pose = Intrinsics.pinhole(8, 6, 10.0), Pose.from_yaw_pitch((0.0, 0.0, 2.0), 30.0, -90.0)
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-2.0, 2.0, (400, 2)), rng.uniform(0.0, 3.0, 400)])
    found = depth_image(points, pose, camera)
    seen = pose.to_camera(points)
    seen = seen[seen[:, 2] > 0.0]
    pixels = np.floor(camera.project(seen)).astype(int)
    for row in range(6):
        for column in range(8):
            there = seen[(pixels == (column, row)).all(axis=1), 2]
            assert found[row, column] == (pytest.approx(there.min()) if len(there) else 0.0)
    assert not depth_image(np.zeros((0, 3)), pose, camera).any()


def test_both_countings_by_hand() -> None:
    reference = np.array([[2.0, 2.0], [4.0, 0.0]])
    estimate = np.array([[2.1, np.nan], [3.8, 1.0]])
    error = depth_mae(reference, estimate)
    assert error.mae_common_m == pytest.approx((0.1 + 0.2) / 2)
    assert error.mae_whole_m == pytest.approx((0.1 + 2.0 + 0.2 + 1.0) / 4)
    assert (error.pixels, error.reference_pixels, error.common_pixels) == (4, 3, 2)


def test_pooling_equals_measuring_at_once() -> None:
    rng = np.random.default_rng(0)
    reference, estimate = rng.uniform(1, 2, (2, 4, 8, 9))
    estimate[rng.random(estimate.shape) < 0.3] = 0
    estimate[2] = 0
    at_once = depth_mae(reference, estimate)
    pooled = pooled_depth_error([depth_mae(r, e) for r, e in zip(reference, estimate, strict=True)])
    assert pooled.mae_common_m == pytest.approx(at_once.mae_common_m)
    assert pooled.mae_whole_m == pytest.approx(at_once.mae_whole_m)
    assert pooled.common_pixels == at_once.common_pixels
