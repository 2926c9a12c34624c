"""DJI WPML archives: written, read back, and hostile ones refused."""

from __future__ import annotations

import io
import struct
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from fieldkit.errors import MetadataError, MissionError
from fieldkit.missions.formats import mission_bytes, write_mission
from fieldkit.missions.formats.wpml import TEMPLATE, WAYLINES, read_wpml
from fieldkit.missions.formats.xml_tree import parse
from fieldkit.missions.mission import Shot
from tests.missions.vehicles import small_mission, vehicle

DJI = vehicle("dji")


def test_the_archive_has_the_two_files_under_their_fixed_names() -> None:
    with zipfile.ZipFile(io.BytesIO(mission_bytes("wpml", small_mission(), DJI))) as archive:
        assert archive.namelist() == [TEMPLATE, WAYLINES]
        assert {info.date_time for info in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        template, waylines = (parse(archive.read(name)) for name in (TEMPLATE, WAYLINES))
    for root in (template, waylines):
        assert root.value("Document", "missionConfig", "droneInfo", "droneEnumValue") == "77"
        placemarks = list(root.all("Placemark"))
        assert [p.value("index") for p in placemarks] == [str(k) for k in range(6)]
        # Above home, three photographs and a place on the way, above the landing place.
        assert [len(list(p.all("action"))) for p in placemarks] == [0, 5, 5, 0, 5, 0]
    first = list(waylines.all("Placemark"))[1]
    assert first.value("Point", "coordinates") == "6.447300000,50.865022500"  # longitude first
    steps = [action.value("actionActuatorFunc") for action in first.all("action")]
    assert steps == ["rotateYaw", "gimbalRotate", "hover", "takePhoto", "hover"]
    assert first.value("waypointTurnParam", "waypointTurnMode") == "toPointAndStopWithDiscontinuityCurvature"
    assert waylines.child("Document").child("Folder").value("executeHeightMode") == "relativeToStartPoint"  # type: ignore[union-attr]


def test_read_back(tmp_path: Path) -> None:
    mission = small_mission()
    write_mission(tmp_path / "a.kmz", "wpml", mission, DJI)
    read = read_wpml(tmp_path / "a.kmz")
    photographed = [stop for stop in read.stops if stop.photographs]
    assert len(photographed) == len(mission.shots) == 3
    for shot, stop in zip(mission.shots, photographed, strict=True):
        assert stop.place.latitude_deg == pytest.approx(shot.place.latitude_deg, abs=1e-9)
        assert stop.place.longitude_deg == pytest.approx(shot.place.longitude_deg, abs=1e-9)
        assert stop.place.height_m == pytest.approx(shot.place.height_m, abs=1e-3)
        assert stop.yaw_deg == pytest.approx(shot.yaw_deg, abs=0.01)
        assert stop.pitch_deg == pytest.approx(shot.pitch_deg, abs=0.01)
        assert (stop.before_s, stop.after_s, stop.stops) == (4.0, 1.0, True)
    assert read.firmware == "dji"


def test_names_of_plots_cannot_break_the_xml(tmp_path: Path) -> None:
    mission = small_mission()
    stops = tuple(replace(s, plot='<&"\x00]]>') if isinstance(s, Shot) else s for s in mission.stops)
    write_mission(tmp_path / "a.kmz", "wpml", replace(mission, stops=stops, name="<!DOCTYPE x>\x01"), DJI)
    assert len(read_wpml(tmp_path / "a.kmz").stops) == 6
    for name in ("kml", "geojson"):
        assert mission_bytes(name, replace(mission, stops=stops, name="<!DOCTYPE x>\x01"), DJI)
    parse(mission_bytes("kml", replace(mission, stops=stops, name="<!DOCTYPE x>\x01"), DJI))


def test_only_models_that_wpml_has_a_number_for() -> None:
    with pytest.raises(MissionError, match="no DJI model") as caught:
        mission_bytes("wpml", small_mission(), vehicle("dji", title="Somebody's quad"))
    assert "litchi" in caught.value.remedy
    with pytest.raises(MissionError, match="does not fly DJI WPML"):
        mission_bytes("wpml", small_mission(), vehicle())


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
        (archive((WAYLINES, b"<kml/>"), ("../../evil", b"x")), "leads out"),
        (archive((WAYLINES, b"<kml/>"), ("/etc/evil", b"x")), "leads out"),
        (archive((WAYLINES, b"<kml/>"), compression=zipfile.ZIP_LZMA), "compressed in a way"),
        (archive(*((f"{k}", b"") for k in range(1100))), "far too many"),
    ],
    ids=range(15),
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
