"""QGC WPL 110 files: written, read back by fieldkit and by pymavlink."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from benchmarks.mission_trips import by_pymavlink, difference, random_mission, upload_items
from fieldkit.errors import MetadataError
from fieldkit.missions.files.formats import mission_bytes
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.files.waypoints import read_waypoints
from fieldkit.missions.items import Command
from fieldkit.routing.mission import Mission, Shot
from tests.missions.random_missions import missions
from tests.missions.vehicles import HOME, small_mission, vehicle


def test_rows_and_columns() -> None:
    lines = mission_bytes("waypoints", small_mission(), vehicle()).decode().splitlines()
    assert lines[0] == "QGC WPL 110"
    rows = [line.split("\t") for line in lines[1:]]
    assert {len(row) for row in rows} == {12}
    assert [row[0] for row in rows] == [str(k) for k in range(len(rows))]
    assert rows[0][1:4] == ["1", "0", "16"]
    assert [float(v) for v in rows[0][8:11]] == [50.8649, 6.4473, 92.0]  # latitude first
    for row in rows:
        assert len(row[8].partition(".")[2]) >= 7
        assert len(row[9].partition(".")[2]) >= 7
    assert rows[1][3] == str(int(Command.NAV_TAKEOFF))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mission=missions())
def test_pymavlink_and_fieldkit_read_what_was_written(tmp_path: Path, mission: Mission) -> None:
    path = tmp_path / "random.waypoints"
    for dialect in ("ardupilot", "px4"):
        by = vehicle(dialect)
        path.write_bytes(mission_bytes("waypoints", mission, by))
        own, others = read_waypoints(path), by_pymavlink(path)
        assert own.home is not None
        others = others if dialect == "ardupilot" else others[1:]  # row 0 is home also where PX4 has none
        assert not difference(mission, by, upload_items(own, dialect), others, "waypoints")


def test_no_number_is_missing_and_no_place_turns_the_vehicle_north() -> None:
    for mission in (small_mission(), random_mission(np.random.default_rng(5))):
        text = mission_bytes("waypoints", mission, vehicle("px4")).decode()
        assert "nan" not in text.lower()
        rows = [[float(cell) for cell in line.split("\t")] for line in text.splitlines()[2:]]
        headings = [row[7] for row in rows if int(row[3]) in (16, 21, 22)]
        stops = [shot.yaw_deg if isinstance(shot, Shot) else None for shot in mission.stops]
        wanted = [None, *stops, None, None]  # take-off, over the landing place, landing
        for at, heading in enumerate(headings):
            following = [yaw for yaw in wanted[at:] if yaw is not None]
            assert heading == pytest.approx((following or [mission.shots[-1].yaw_deg])[0], abs=1e-3)
        rates = [row[6:8] for row in rows if int(row[3]) == Command.DO_GIMBAL_MANAGER_PITCHYAW]
        assert rates == [[0.0, 0.0]] * len(mission.shots)


def test_files_of_other_programs(tmp_path: Path) -> None:
    text = mission_bytes("waypoints", small_mission(), vehicle()).decode()
    expected = read_of(tmp_path, text.encode())
    assert expected.home == HOME
    assert expected.first_number == 1
    for variant in (
        text.replace("\t", "   "),
        text.replace("\n", "\r\n"),
        "\ufeff" + text,
        text.replace("\n", "\n\n"),
        text.replace("QGC WPL 110\n", "QGC WPL 110\n# a comment\n"),
    ):
        assert read_of(tmp_path, variant.encode()) == expected


def test_without_a_home_row_the_first_item_is_kept_and_numbered_0(tmp_path: Path) -> None:
    lines = mission_bytes("waypoints", small_mission(), vehicle()).decode().splitlines()
    rows = [line.split("\t", 1)[1] for line in lines[2:]]
    read = read_of(tmp_path, "\n".join(["QGC WPL 110", *(f"{k}\t{row}" for k, row in enumerate(rows))]).encode())
    assert read.home is None
    assert read.first_number == 0
    assert read.items[0].command == Command.NAV_TAKEOFF


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "begins with ''"),
        (b"QGC WPL 120\n", "QGC WPL 120"),
        (b"QGC WPL 110\n0\t1\t0\n", "3 columns"),
        (b"QGC WPL 110\n0 1 0 16 0 0 0 0 x 6 92 1\n", "column 9"),
        (b"QGC WPL 110\n0 1 0 16 0 0 0 0 1e999 6 92 1\n", "column 9"),
        (b"QGC WPL 110\n0 1 0 16 0 0 0 0 inf 6 92 1\n", "column 9"),
        (b"QGC WPL 110\n0 1 0 99999999 0 0 0 0 50 6 92 1\n", "its command"),
        (b"QGC WPL 110\n0 1 0 16 0 0 0 0 50 6 92 " + b"9" * 5000 + b"\n", "autocontinue"),
        (b"QGC WPL 110\n0 1 0 16 0 0 0 0 95 6 92 1\n", "row 0, home"),
        (b"\xff\xfe\x00", "UTF-8"),
        (b"QGC WPL 110\n\0", "not text"),
    ],
)
def test_errors(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(MetadataError, match=message):
        read_of(tmp_path, content)


def read_of(folder: Path, content: bytes) -> ReadMission:
    path = folder / "file.waypoints"
    path.write_bytes(content)
    return read_waypoints(path)
