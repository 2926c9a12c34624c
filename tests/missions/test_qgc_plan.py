"""QGroundControl's .plan: written, read back by fieldkit and by MAVSDK."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings

from benchmarks.mission_trips import difference, mavsdk_importer
from fieldkit.errors import MetadataError, MissionError, UsageError
from fieldkit.missions.autopilots import render
from fieldkit.missions.files.qgc_plan import read_plan
from fieldkit.missions.files.writing import FORMATS, mission_bytes
from fieldkit.missions.items import Command, same_item
from fieldkit.missions.mission import Fence, GeoPoint, Mission
from tests.missions.random_missions import missions
from tests.missions.vehicles import HOME, small_mission, vehicle

RING = ((50.8648, 6.4470), (50.8648, 6.4476), (50.8652, 6.4476), (50.8652, 6.4470))
HOLE = ((50.86495, 6.4475), (50.86495, 6.44755), (50.8650, 6.44755))


def written(mission: Mission, dialect: str = "ardupilot") -> dict[str, Any]:
    document: dict[str, Any] = json.loads(mission_bytes("plan", mission, vehicle(dialect)))  # type: ignore[arg-type]
    return document


def test_the_document_is_what_qgroundcontrol_expects() -> None:
    fenced = replace(small_mission(), fence=Fence((RING,), (HOLE,)), rally=(GeoPoint(50.8649, 6.4474, 5.0),))
    document = written(fenced)
    assert (document["fileType"], document["version"]) == ("Plan", 1)
    mission = document["mission"]
    assert (mission["version"], mission["firmwareType"], mission["vehicleType"]) == (2, 3, 2)
    assert mission["plannedHomePosition"] == [50.8649, 6.4473, 92.0]
    assert [item["doJumpId"] for item in mission["items"]] == list(range(1, len(mission["items"]) + 1))
    assert {item["type"] for item in mission["items"]} == {"SimpleItem"}
    assert mission["items"][0]["command"] == Command.NAV_TAKEOFF  # home is not among the items
    takeoff, action = mission["items"][0], mission["items"][1]
    assert (takeoff["Altitude"], takeoff["AltitudeMode"], takeoff["AMSLAltAboveTerrain"]) == (5.0, 1, None)
    assert "Altitude" not in action
    assert document["geoFence"]["version"] == document["rallyPoints"]["version"] == 2
    assert [p["inclusion"] for p in document["geoFence"]["polygons"]] == [True, False]
    assert document["rallyPoints"]["points"] == [[50.8649, 6.4474, 5.0]]
    assert written(fenced, "px4")["mission"]["firmwareType"] == 12


def test_nan_is_null_only_where_it_may_be() -> None:
    for dialect, nulls in (("ardupilot", 0), ("px4", 10)):
        items = written(small_mission(), dialect)["mission"]["items"]
        assert sum(value is None for item in items for value in item["params"]) == nulls
        captures = [item for item in items if item["command"] == Command.IMAGE_START_CAPTURE]
        assert [item["params"][3] for item in captures] == [0, 0, 0]


def test_read_back(tmp_path: Path) -> None:
    mission = replace(small_mission(), fence=Fence((RING,), (HOLE,)), rally=(GeoPoint(50.8649, 6.4474, 5.0),))
    for dialect in ("ardupilot", "px4"):
        (tmp_path / f"{dialect}.plan").write_bytes(mission_bytes("plan", mission, vehicle(dialect)))  # type: ignore[arg-type]
        read = read_plan(tmp_path / f"{dialect}.plan")
        items = render(mission, vehicle(dialect))  # type: ignore[arg-type]
        sent = read.upload_items(dialect)
        assert len(sent) == len(items)
        assert all(same_item(a, b) for a, b in zip(items, sent, strict=True))
        assert (read.home, read.fence, read.rally) == (HOME, mission.fence, mission.rally)
        assert (read.firmware, read.remarks) == (dialect, ())


def test_a_mission_that_is_not_taken_gives_no_bytes() -> None:
    with pytest.raises(MissionError):
        mission_bytes("plan", replace(small_mission(), takeoff_m=0.1), vehicle())
    with pytest.raises(UsageError, match="no such format"):
        mission_bytes("gpx", small_mission(), vehicle())


def test_every_format_gives_the_same_bytes_twice() -> None:
    for name in FORMATS:
        by = vehicle("dji" if name in ("wpml", "litchi") else "ardupilot")
        assert mission_bytes(name, small_mission(), by) == mission_bytes(name, small_mission(), by)


def test_another_programs_file_is_read(tmp_path: Path) -> None:
    """QGroundControl's own keys, a circle, a closed ring, a complex item, a home without altitude, a mark in front."""
    document = written(small_mission())
    document["mission"]["items"].insert(1, {"type": "ComplexItem", "complexItemType": "survey", "x": [1, {}]})
    document["mission"]["items"][0]["extra"] = {"deep": [1, 2]}
    document["mission"]["plannedHomePosition"] = [50.8649, 6.4473]
    document["geoFence"] = {
        "version": 2,
        "polygons": [{"inclusion": True, "polygon": [[50.8, 6.4], [50.8, 6.5], [50.9, 6.5], [50.8, 6.4]]}],
        "circles": [{"circle": {"center": [50.865, 6.4473], "radius": 100.0}, "inclusion": False}],
    }  # fmt: skip
    path = tmp_path / "other.plan"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(document, indent="\t").replace("\n", "\r\n").encode())
    read = read_plan(path)
    assert read.home is not None
    assert read.home.amsl_m is None
    assert {remark.code for remark in read.remarks} >= {"unknown-item", "fence-circles"}
    assert read.remarks[0].error
    assert read.fence is not None
    assert len(read.fence.inside[0]) == 3
    assert len(read.fence.outside[0]) == 64
    assert all(abs(a - 50.865) < 1e-3 and abs(b - 6.4473) < 2e-3 for a, b in read.fence.outside[0])


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["fileType"], "Mission", "is not a QGroundControl plan"),
        (["mission"], [], 'has no "mission"'),
        (["mission", "items", 0], 3, "is not an object"),
        (["mission", "items", 0, "command"], True, '"command"'),
        (["mission", "items", 0, "frame"], 3.5, '"frame"'),
        (["mission", "items", 0, "params"], [1, 2], "seven"),
        (["mission", "items", 0, "params"], [10**400, 0, 0, 0, 0, 0, 0], "seven"),
        (["mission", "items", 0, "autoContinue"], "yes", "autoContinue"),
        (["mission", "plannedHomePosition"], [95, 6, 1], "plannedHomePosition"),
        (["mission", "plannedHomePosition"], ["a", 6, 1], "plannedHomePosition"),
        (["geoFence", "polygons"], [{"polygon": [[1, 2]]}], "fewer than three"),
        (["geoFence", "polygons"], 7, "not a list"),
        (["geoFence", "circles"], [{"circle": {"center": [1, 2], "radius": -1}}], "radius"),
        (["rallyPoints", "points"], [[1]], "rally point"),
    ],
)
def test_errors(tmp_path: Path, path: list[Any], value: Any, message: str) -> None:
    document: Any = written(small_mission())
    here = document
    for key in path[:-1]:
        here = here[key]
    here[path[-1]] = value
    file = tmp_path / "bad.plan"
    file.write_text(json.dumps(document))
    with pytest.raises(MetadataError, match=message) as caught:
        read_plan(file)
    assert caught.value.path == file
    assert caught.value.remedy


@pytest.fixture(scope="module")
def importers() -> Iterator[dict[str, Any]]:
    with mavsdk_importer("ardupilot") as ardupilot, mavsdk_importer("px4") as px4:
        yield {"ardupilot": ardupilot, "px4": px4}


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mission=missions())
def test_mavsdk_and_fieldkit_read_what_was_written(importers: dict[str, Any], tmp_path: Path, mission: Mission) -> None:
    for dialect in ("ardupilot", "px4"):
        by = vehicle(dialect)  # type: ignore[arg-type]
        content = mission_bytes("plan", mission, by)
        path = tmp_path / "random.plan"
        path.write_bytes(content)
        assert not difference(mission, by, read_plan(path).upload_items(dialect), importers[dialect](content.decode()))
