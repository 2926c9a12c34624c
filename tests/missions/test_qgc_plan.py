"""QGroundControl's .plan: written, read back by fieldkit and by MAVSDK."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings

from benchmarks.mission_trips import difference, mavsdk_importer, upload_items
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.missions.check import check_mission
from fieldkit.missions.files.formats import mission_bytes
from fieldkit.missions.files.qgc_plan import read_plan
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import Command
from fieldkit.routing.mission import Fence, GeoPoint, Home, Mission
from tests.missions.random_missions import missions
from tests.missions.vehicles import HOME, small_mission, vehicle

RING = ((50.8648, 6.4470), (50.8648, 6.4476), (50.8652, 6.4476), (50.8652, 6.4470))
HOLE = ((50.86495, 6.4475), (50.86495, 6.44755), (50.8650, 6.44755))


def written(mission: Mission, dialect: str = "ardupilot") -> dict[str, Any]:
    document: dict[str, Any] = json.loads(mission_bytes("plan", mission, vehicle(dialect)))
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
    }
    path = tmp_path / "other.plan"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(document, indent="\t").replace("\n", "\r\n").encode())
    read = read_plan(path)
    assert read.home.amsl_m is None
    assert {remark.code for remark in read.remarks} >= {"unknown-item"}
    assert read.remarks[0].severity == "error"
    assert len(read.fence.inside[0]) == 3
    ring = shapely.Polygon(LocalFrame(50.865, 6.4473).to_local(*np.array(read.fence.outside[0]).T, 0.0)[:, :2])
    assert ring.exterior.distance(shapely.Point(0, 0)) == pytest.approx(100.0, abs=0.01)


def as_survey(items: list[dict[str, Any]], kind: str = "survey") -> dict[str, Any]:
    """A complex item as QGroundControl writes it, with its items."""
    carried = {"version": 2, "CameraShots": 2, "Items": items, "VisualTransectPoints": []}
    return {"type": "ComplexItem", "complexItemType": kind, "version": 5, "TransectStyleComplexItem": carried}


def with_survey(document: dict[str, Any], kind: str) -> dict[str, Any]:
    """The second to the sixth item as one complex item."""
    items = document["mission"]["items"]
    mission = document["mission"] | {"items": [items[0], as_survey(items[1:6], kind), *items[6:]]}
    return document | {"mission": mission}


def read_of(folder: Path, document: dict[str, Any]) -> ReadMission:
    path = folder / "some.plan"
    path.write_text(json.dumps(document))
    return read_plan(path)


@pytest.mark.parametrize("kind", ["survey", "CorridorScan"])
@pytest.mark.parametrize("dialect", ["ardupilot", "px4"])
def test_complex_items_stand_for_the_items_they_carry(tmp_path, importers, dialect, kind) -> None:
    simple = written(small_mission(), dialect)
    document = with_survey(simple, kind)
    read = read_of(tmp_path, document)
    assert read == read_of(tmp_path, simple)
    assert (read.firmware, read.remarks) == (dialect, ())
    if kind == "survey":  # MAVSDK takes no other
        assert len(importers[dialect](json.dumps(document))) == len(upload_items(read, dialect))


@pytest.mark.parametrize(
    "item",
    [
        {"type": "ComplexItem", "complexItemType": "StructureScan", "Altitude": 20, "Layers": 2},
        {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {"Items": []}},
        {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {"Items": [as_survey([])]}},
    ],
)
def test_a_complex_item_without_items_is_an_error_and_says_where(tmp_path: Path, item: dict[str, Any]) -> None:
    document = written(small_mission())
    document["mission"]["items"].insert(1, item)
    for later in document["mission"]["items"][2:]:  # as QGroundControl counts on
        later["doJumpId"] += 7
    (remark,) = read_of(tmp_path, document).remarks
    assert (remark.code, remark.severity, remark.item) == ("unknown-item", "error", 2)


@pytest.mark.parametrize(
    ("position", "home"),
    [
        *(([HOME.latitude_deg, HOME.longitude_deg, *above], replace(HOME, amsl_m=None)) for above in ([None], [], [0])),
        *((nowhere, None) for nowhere in (None, [None, None, None], [0, 0, 0], [0.0, 0.0])),
    ],
)
def test_home_without_an_altitude_and_none_at_all(tmp_path: Path, position: Any, home: Home | None) -> None:
    document = written(small_mission())
    document["mission"]["plannedHomePosition"] = position
    read = read_of(tmp_path, document)
    assert read.home == home
    assert [remark.code for remark in read.remarks] == ["no-home"] * (home is None)
    assert home is None or check_mission(read, vehicle()).findings == ()


def test_another_version_is_refused(tmp_path: Path) -> None:
    document = written(small_mission())
    for other, where in (({"version": 3}, "version: "), ({"mission": document["mission"] | {"version": 1}}, "mission")):
        with pytest.raises(MetadataError, match=where):
            read_of(tmp_path, document | other)


def test_fences_of_all_versions(tmp_path: Path) -> None:
    ring = [list(corner) for corner in RING]
    document = written(small_mission())
    with pytest.raises(MetadataError, match="fence is of version 1"):
        read_of(tmp_path, document | {"geoFence": {"version": 1, "polygon": ring, "breachReturn": [50.8, 6.4]}})
    assert read_of(tmp_path, document | {"geoFence": {"version": 1, "polygon": []}}).fence == Fence()
    with pytest.raises(MetadataError, match="fence is of version 3"):
        read_of(tmp_path, document | {"geoFence": {"version": 3, "polygons": [{"polygon": ring}]}})
    fence = Fence((RING,), (HOLE,))
    assert read_of(tmp_path, written(replace(small_mission(), fence=fence))).fence == fence


def test_jumps_lead_to_ids_not_to_places(tmp_path: Path) -> None:
    document = written(small_mission())
    items = document["mission"]["items"]
    for item in items:
        item["doJumpId"] += 10
    jump = items[1] | {"command": Command.DO_JUMP, "doJumpId": 99, "params": [12, 2, 0, 0, 0, 0, 0]}
    items.insert(5, jump)
    assert read_of(tmp_path, document).items[5].params[:2] == (2.0, 2.0)
    jump["params"] = [77, 2, 0, 0, 0, 0, 0]
    with pytest.raises(MetadataError, match="item 6: DO_JUMP leads to doJumpId 77, which no item has"):
        read_of(tmp_path, document)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["fileType"], "Mission", "fileType"),
        (["mission"], [], "mission: "),
        (["mission", "items", 0], 3, "mission.items.0: "),
        (["mission", "items", 0, "command"], True, "items.0.command"),
        (["mission", "items", 0, "params"], [1, 2], "seven"),
        (["mission", "items", 0, "autoContinue"], "yes", "autoContinue"),
        (["mission", "plannedHomePosition"], [95, 6, 1], "plannedHomePosition"),
        (["geoFence", "polygons"], [{"polygon": [[1, 2]]}], "at least 3 items"),
        (["geoFence", "circles"], [{"circle": {"center": [1, 2], "radius": -1}}], "radius"),
    ],
)
def test_errors(tmp_path: Path, path: list[Any], value: Any, message: str) -> None:
    document: Any = written(small_mission())
    here = document
    for key in path[:-1]:
        here = here[key]
    here[path[-1]] = value
    with pytest.raises(MetadataError, match=message) as caught:
        read_of(tmp_path, document)
    assert caught.value.path == tmp_path / "some.plan"
    assert caught.value.remedy


@pytest.fixture(scope="module")
def importers() -> Iterator[dict[str, Any]]:
    with mavsdk_importer("ardupilot") as ardupilot, mavsdk_importer("px4") as px4:
        yield {"ardupilot": ardupilot, "px4": px4}


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mission=missions())
def test_mavsdk_and_fieldkit_read_what_was_written(importers: dict[str, Any], tmp_path: Path, mission: Mission) -> None:
    for dialect in ("ardupilot", "px4"):
        by = vehicle(dialect)
        content = mission_bytes("plan", mission, by)
        path = tmp_path / "random.plan"
        path.write_bytes(content)
        assert not difference(mission, by, upload_items(read_plan(path), dialect), importers[dialect](content.decode()))
