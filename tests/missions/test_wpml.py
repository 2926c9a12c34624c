"""DJI WPML archives: written, read back, and hostile ones refused."""

import io
import struct
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import pytest

from fieldkit.documents.xml_tree import parse_local
from fieldkit.errors import MetadataError, MissionError
from fieldkit.missions.files.formats import mission_bytes
from fieldkit.missions.files.wpml import TEMPLATE, WAYLINES
from fieldkit.missions.files.wpml_reading import read_wpml
from fieldkit.routing.mission import Shot
from tests.missions.vehicles import small_mission, vehicle

DJI = vehicle("dji")


def test_the_archive_has_the_two_files_under_their_fixed_names() -> None:
    with zipfile.ZipFile(io.BytesIO(mission_bytes("wpml", small_mission(), DJI))) as archive:
        assert archive.namelist() == [TEMPLATE, WAYLINES]
        assert {info.date_time for info in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        template, waylines = (parse_local(archive.read(name)) for name in (TEMPLATE, WAYLINES))
    for root in (template, waylines):
        assert root.findtext("Document/missionConfig/droneInfo/droneEnumValue") == "77"
        placemarks = list(root.iter("Placemark"))
        assert [p.findtext("index") for p in placemarks] == [str(k) for k in range(6)]
        # Above home, three photographs and a place on the way, above the landing place.
        assert [len(list(p.iter("action"))) for p in placemarks] == [0, 5, 5, 0, 5, 0]
    first = list(waylines.iter("Placemark"))[1]
    assert first.findtext("Point/coordinates") == "6.447300000,50.865022500"  # longitude first
    steps = [action.findtext("actionActuatorFunc") for action in first.iter("action")]
    assert steps == ["rotateYaw", "gimbalRotate", "hover", "takePhoto", "hover"]
    assert first.findtext("waypointTurnParam/waypointTurnMode") == "toPointAndStopWithDiscontinuityCurvature"
    assert waylines.findtext("Document/Folder/executeHeightMode") == "relativeToStartPoint"


def test_names_of_plots_cannot_break_the_xml(tmp_path: Path) -> None:
    mission = small_mission()
    stops = tuple(replace(s, plot='<&"\x00]]>') if isinstance(s, Shot) else s for s in mission.stops)
    (tmp_path / "a.kmz").write_bytes(mission_bytes("wpml", replace(mission, stops=stops, name="<!DOCTYPE x>\x01"), DJI))
    assert len(read_wpml(tmp_path / "a.kmz").stops) == 6


def test_only_models_that_wpml_has_a_number_for() -> None:
    with pytest.raises(MissionError, match="no DJI model") as caught:
        mission_bytes("wpml", small_mission(), vehicle("dji", title="Somebody's quad"))
    assert "litchi" in caught.value.remedy
    with pytest.raises(MissionError, match="does not fly DJI WPML"):
        mission_bytes("wpml", small_mission(), vehicle())


def test_it_turns_on_the_short_way_and_groups_count_from_0() -> None:
    mission = small_mission()
    for root in contents(mission_bytes("wpml", mission, DJI)):
        groups = list(root.iter("actionGroup"))
        assert [g.findtext("actionGroupId") for g in groups] == ["0", "1", "2"]
        assert [g.findtext("actionGroupStartIndex") for g in groups] == ["1", "2", "4"]
        turns = [a for a in root.iter("action") if a.findtext("actionActuatorFunc") == "rotateYaw"]
        headings = [float(t.findtext("actionActuatorFuncParam/aircraftHeading") or "nan") for t in turns]
        assert all(-180.0 <= heading <= 180.0 for heading in headings)
        ways = [t.findtext("actionActuatorFuncParam/aircraftPathMode") for t in turns]
    # From above home already 180°; 55° to the right; then turned on the way, over the place between.
    assert ways == ["clockwise", "clockwise", "clockwise"]
    west = replace(mission, stops=tuple(replace(s, yaw_deg=350.0 - 20.0 * k) for k, s in enumerate(mission.shots)))
    for root in contents(mission_bytes("wpml", west, DJI)):
        turns = [a for a in root.iter("action") if a.findtext("actionActuatorFunc") == "rotateYaw"]
        ways = [t.findtext("actionActuatorFuncParam/aircraftPathMode") for t in turns]
        assert ways == ["clockwise", "counterClockwise", "counterClockwise"]


def contents(data: bytes) -> list[Element]:
    with zipfile.ZipFile(io.BytesIO(data)) as opened:
        return [parse_local(opened.read(name)) for name in (TEMPLATE, WAYLINES)]


def archive(*members: tuple[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as made:
        for name, content in members:
            made.writestr(name, content)
    return buffer.getvalue()


BOMB = b'<!DOCTYPE kml [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><kml><Folder>&b;</Folder></kml>'
OUTSIDE = b'<?xml version="1.0"?><!DOCTYPE k SYSTEM "file:///etc/passwd"><k/>'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not a zip"),
        (b"PK\x03\x04 no archive", "not a zip"),
        (archive(("other.txt", b"")), "no DJI mission"),
        (archive((WAYLINES, BOMB)), "document type"),
        (archive((WAYLINES, OUTSIDE)), "document type"),
        (archive((WAYLINES, b"<kml><Folder></kml>")), "not well-formed"),
        (archive((WAYLINES, b'<?xml version="1.0" encoding="no-such"?><kml/>')), "not well-formed"),
        (archive((WAYLINES, b"<kml/>")), "no Folder"),
        (archive((WAYLINES, b"<kml><Folder><Placemark/></Folder></kml>")), "waypoint 0 has no coordinates"),
        (archive((WAYLINES, b"<a>" * 100_000)), "too many elements"),
        (archive((WAYLINES, bytes(40 << 20))), "would unpack"),
    ],
    ids=range(11),
)
def test_hostile_archives_are_refused_and_nothing_is_written(tmp_path: Path, content: bytes, message: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "a.kmz").write_bytes(content)
    with pytest.raises(MetadataError, match=message) as caught:
        read_wpml(folder / "a.kmz")
    assert caught.value.path == folder / "a.kmz"
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["a.kmz", "in"]


def test_a_member_that_is_larger_than_it_says_is_refused(tmp_path: Path) -> None:
    data = bytearray(archive((WAYLINES, bytes(40 << 20))))
    real = struct.pack("<I", 40 << 20)
    small = struct.pack("<I", 100)
    (tmp_path / "a.kmz").write_bytes(bytes(data).replace(real, small))
    with pytest.raises(MetadataError):
        read_wpml(tmp_path / "a.kmz")
