"""plan.json."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.results.pattern import Look, Pattern
from fieldkit.results.plan import Plan, PlanMethod, PlanSource, Station
from fieldkit.results.plan_file import load_plan, plan_from_poses, save_plan
from fieldkit_sim.simulation import ring

CAMERA = Intrinsics.pinhole(2000, 1500, 1700.0)
POSES = ring(5, 1.4, 1.1)


def test_round_trip(tmp_path: Path) -> None:
    plan = plan_from_poses(
        POSES,
        CAMERA,
        row_heading_deg=70.0,
        source=PlanSource(kind="scene", name="case-1", sha256=64 * "a"),
        method=PlanMethod(name="bosfm", seed=3, evaluations=50, chamfer_m=0.012, chamfer_spread_m=0.001, repeats=5),
    )
    save_plan(tmp_path / "plan.json", plan)
    assert load_plan(tmp_path) == load_plan(tmp_path / "plan.json") == plan
    assert plan.camera is not None
    assert plan.camera == CAMERA
    for station, pose in zip(plan.stations, POSES, strict=True):
        np.testing.assert_allclose(station.pose.center, pose.center)
        assert rotation_angle_deg(station.pose.rotation, pose.rotation) < 1e-6


@given(
    st.lists(
        st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(0, 9), st.floats(-360, 360), st.floats(-90, 90)),
        min_size=1,
        max_size=5,
    )
)
def test_stations_read_back_exactly(rows: list[tuple[float, float, float, float, float]]) -> None:
    stations = tuple(Station(position_m=row[:3], yaw_deg=row[3], pitch_deg=row[4]) for row in rows)
    plan = Plan(fieldkit="0", stations=stations)
    assert Plan.model_validate_json(plan.model_dump_json()) == plan


def test_a_pattern_is_read_where_it_is_expected(tmp_path: Path) -> None:
    plan = Plan(fieldkit="0", pattern=Pattern((Look(0.0, -60.0), Look(180.0, -60.0)), 8.0, 2.1, 2.2), camera=CAMERA)
    save_plan(tmp_path / "plan.json", plan)
    assert load_plan(tmp_path, patterns=True) == plan
    with pytest.raises(MetadataError, match="pattern of passes"):
        load_plan(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "mission"}, "is not a fieldkit plan"),
        ({"stations": []}, "stations: "),
        ({"x": 1}, "x: "),
        ({"stations": [{"position_m": [0, 0, 1], "yaw_deg": 0, "pitch_deg": 91}]}, "stations.0.pitch_deg"),
        ({"camera": {"model": "FISHY", "width": 1, "height": 1, "params": [1.0]}}, "camera model 'FISHY'"),
    ],
)
def test_errors(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    document = json.loads(plan_from_poses(POSES).model_dump_json()) | change
    (tmp_path / "plan.json").write_text(json.dumps(document))
    with pytest.raises(MetadataError, match=message) as caught:
        load_plan(tmp_path)
    assert caught.value.path == tmp_path / "plan.json"
    assert caught.value.remedy
