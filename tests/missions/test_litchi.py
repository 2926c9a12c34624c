"""Litchi's CSV: written and read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fieldkit.errors import MetadataError, MissionError
from fieldkit.missions.files.litchi import COLUMNS, read_litchi
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.files.writing import mission_bytes
from tests.missions.vehicles import small_mission, vehicle

DJI = vehicle("dji")
TEXT = mission_bytes("litchi", small_mission(), DJI).decode()


def read_of(folder: Path, text: str) -> ReadMission:
    path = folder / "a.csv"
    path.write_bytes(text.encode())
    return read_litchi(path)


def test_columns() -> None:
    lines = TEXT.splitlines()
    assert len(COLUMNS) == 46
    assert lines[0] == ",".join(COLUMNS)
    rows = [dict(zip(COLUMNS, line.split(","), strict=True)) for line in lines[1:]]
    assert len(rows) == 6
    first = rows[1]
    assert (first["latitude"], first["longitude"], first["altitude(m)"]) == ("50.865022500", "6.447300000", "1.500")
    assert (first["heading(deg)"], first["gimbalmode"], first["gimbalpitchangle"]) == ("180.00", "2", "-21.80")
    actions = [(first[f"actiontype{k}"], first[f"actionparam{k}"]) for k in range(1, 5)]
    assert actions == [("0", "4000"), ("1", "0"), ("0", "1000"), ("-1", "0")]
    assert first["altitudemode"] == "0"
    # Where nothing is photographed the camera already looks as it will at the next photograph.
    assert rows[3]["actiontype1"] == "-1"
    assert rows[3]["heading(deg)"] == rows[4]["heading(deg)"]


def test_read_back(tmp_path: Path) -> None:
    mission = small_mission()
    read = read_of(tmp_path, TEXT)
    photographed = [stop for stop in read.stops if stop.photographs]
    for shot, stop in zip(mission.shots, photographed, strict=True):
        assert stop.place.latitude_deg == pytest.approx(shot.place.latitude_deg, abs=1e-9)
        assert stop.place.height_m == pytest.approx(shot.place.height_m, abs=1e-3)
        assert stop.yaw_deg == pytest.approx(shot.yaw_deg, abs=0.01)
        assert stop.pitch_deg == pytest.approx(shot.pitch_deg, abs=0.01)
        assert (stop.before_s, stop.after_s) == (4.0, 1.0)
    assert [remark.code for remark in read.remarks] == ["heading-mode"]


def test_other_spellings(tmp_path: Path) -> None:
    expected = read_of(tmp_path, TEXT)
    for variant in ("\ufeff" + TEXT, TEXT.replace("\n", "\r\n"), TEXT.replace(",", ";"), TEXT + "\n\n"):
        assert read_of(tmp_path, variant) == expected
    feet = read_of(tmp_path, "latitude,longitude,altitude(ft),heading(deg)\n50.865,6.4473,10,90\n")
    assert feet.stops[0].place.height_m == pytest.approx(3.048)
    assert feet.stops[0].photographs == 0


def test_too_many_waypoints() -> None:
    mission = small_mission()
    with pytest.raises(MissionError, match="Litchi takes at most 99"):
        mission_bytes("litchi", replace(mission, stops=100 * mission.stops[:1]), DJI)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no Litchi mission"),
        ("a,b\n1,2\n", "no Litchi mission"),
        ("latitude,longitude,altitude(m)\n1,2\n", "line 2 lacks"),
        ("latitude,longitude,altitude(m)\n1,2,x\n", "altitude"),
        ("latitude,longitude,altitude(m)\n1,2,3,4\n", "4 columns"),
        ('latitude,longitude,altitude(m)\n"1' + 200_000 * "0" + '",2,3\n', "not CSV"),
        ("latitude,longitude,altitude(m)\nnan,2,3\n", "latitude is not a number"),
        ("latitude,longitude,altitude(m)\n1e400,2,3\n", "latitude is not a number"),
    ],
)
def test_errors(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(MetadataError, match=message):
        read_of(tmp_path, text)


def test_a_pause_that_litchi_cannot_hold() -> None:
    with pytest.raises(MissionError, match="40 s; Litchi pauses for at most 32 s"):
        mission_bytes("litchi", replace(small_mission(), settle_s=40.0), vehicle("dji"))
