"""Litchi's CSV: written and read back."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from fieldkit.errors import MetadataError, MissionError
from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.check import check_mission
from fieldkit.missions.files.formats import mission_bytes
from fieldkit.missions.files.litchi import COLUMNS, read_litchi
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.findings import Report
from tests.missions.vehicles import small_mission, vehicle

DJI = vehicle("dji")
TEXT = mission_bytes("litchi", small_mission(), DJI).decode()


def read_of(text: str) -> ReadMission:
    with TemporaryDirectory() as folder:
        path = Path(folder, "a.csv")
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


def test_other_spellings() -> None:
    expected = read_of(TEXT)
    for variant in ("\ufeff" + TEXT, TEXT.replace("\n", "\r\n"), TEXT.replace(",", ";"), TEXT + "\n\n"):
        assert read_of(variant) == expected
    feet = read_of("latitude,longitude,altitude(ft),heading(deg)\n50.865,6.4473,10,90\n")
    assert feet.stops[0].place.height_m == pytest.approx(3.048)
    assert interpret(feet, DJI, "dji").photographs == ()


def test_what_litchi_cannot_hold_is_not_written() -> None:
    mission = small_mission()
    with pytest.raises(MissionError, match="Litchi takes at most 99"):
        mission_bytes("litchi", replace(mission, stops=100 * mission.stops[:1]), DJI)
    with pytest.raises(MissionError, match="40 s; Litchi pauses for at most 32 s"):
        mission_bytes("litchi", replace(mission, settle_s=40.0), DJI)
    assert mission_bytes("litchi", replace(mission, burst=7), DJI)
    with pytest.raises(MissionError, match=r"8 photographs at each station; .* 15 actions, enough for 7") as caught:
        mission_bytes("litchi", replace(mission, burst=8), DJI)
    assert "--burst 7" in caught.value.remedy


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
        ("latitude,longitude,altitude(m)\n350,2,3\n", "latitude 350 is outside"),
    ],
)
def test_errors(text: str, message: str) -> None:
    with pytest.raises(MetadataError, match=message):
        read_of(text)


def checked(*rows: dict[str, object], units: str = "m") -> Report:
    """The check of waypoints 11.12 m apart to the north, each with these cells, 5 m high and facing east.

    One is enough here.
    """
    columns = tuple(name.replace("(m)", f"({units})") for name in COLUMNS)
    lines = [",".join(columns)]
    for k, row in enumerate(rows):
        cells: dict[str, object] = dict.fromkeys(columns, 0) | {name: -1 for name in columns if "actiontype" in name}
        cells |= {"photo_timeinterval": -1, "photo_distinterval": -1}
        cells |= {"latitude": 50.865 + 1e-4 * k, "longitude": 6.4473, f"altitude({units})": 5.0, "heading(deg)": 90}
        lines.append(",".join(str((cells | row)[name]) for name in columns))
    report = check_mission(read_of("\n".join(lines)), DJI)
    return replace(report, findings=tuple(f for f in report.findings if f.code != "too-few-waypoints"))


def acts(*actions: tuple[float, float], **others: object) -> dict[str, object]:
    cells: dict[str, object] = {}
    for k, (kind, parameter) in enumerate(actions, 1):
        cells |= {f"actiontype{k}": kind, f"actionparam{k}": parameter}
    return cells | others


SHOT = ((0, 4000.0), (1, 0.0), (0, 1000.0))
TILTED = {"gimbalmode": 2, "gimbalpitchangle": -45}


def poses(report: Report) -> list[tuple[float | None, float | None]]:
    return [(shot.heading_deg, shot.pitch_deg) for shot in report.photographs]


def codes(report: Report) -> set[str]:
    return {finding.code for finding in report.findings} - {"heading-mode"}


def test_actions_are_carried_out_in_order_with_time() -> None:
    row = acts(*SHOT, (5, -90.0), *SHOT, (4, 270.0), *SHOT, **TILTED)
    report = checked(row, TILTED)
    assert poses(report) == [(90.0, -45.0), (90.0, -90.0), (270.0, -90.0)]
    assert codes(report) == set()
    plain = checked(acts(*SHOT, *SHOT, *SHOT, **TILTED), TILTED)
    assert report.seconds - plain.seconds == pytest.approx(180.0 / 60.0 + 0.15)
    assert codes(checked(acts((0, 4000.0), (5, -90.0), (1, 0.0), (0, 1000.0), **TILTED), TILTED)) == {"no-settle"}
    assert codes(checked(acts((5, -90.0), (0, 4000.0), (1, 0.0), (4, 0.0), **TILTED), TILTED)) == {"no-delay"}


def test_a_tilt_stays_where_the_gimbals_mode_is_off() -> None:
    report = checked(acts((5, -60.0)), acts(*SHOT), acts(*SHOT, **TILTED), TILTED)
    assert poses(report) == [(90.0, -60.0), (90.0, -45.0)]
    assert codes(checked(acts(*SHOT))) == {"no-pitch"}
    alone = checked({}, acts(*SHOT, **TILTED), {})
    assert (poses(alone), codes(alone)) == ([(90.0, -45.0)], {"not-modelled"})


def test_a_point_of_interest_is_faced() -> None:
    for units, scale in (("m", 1.0), ("ft", 1.0 / 0.3048)):
        poi = {
            "poi_latitude": 50.865,
            "poi_longitude": 6.448,
            f"poi_altitude({units})": 1 * scale,
            f"altitude({units})": 5 * scale,
        }
        report = checked(acts(*SHOT, **poi, gimbalmode=1), acts(*SHOT, **poi, **TILTED), units=units)
        # It lies 49 m east, then 49 m east and 11 m south, and 4 m lower.
        (first, steep), (second, pitch) = poses(report)
        assert (first, steep) == (pytest.approx(90.0, abs=0.01), pytest.approx(-4.6, abs=0.1))
        assert (second, pitch) == (pytest.approx(102.7, abs=0.1), -45.0)
        assert codes(report) == set()
    ground = checked(acts(*SHOT, **poi, gimbalmode=1, poi_altitudemode=1), units="ft")
    for report in (ground, checked(acts(*SHOT, gimbalmode=1))):
        assert (codes(report), poses(report)[0][1]) == ({"unknown-item", "no-pitch"}, None)
        assert not report.ok


def test_actions_that_nobody_can_say_the_photographs_of_are_refused() -> None:
    assert codes(checked(acts((3, 0.0), (5, -45.0), *SHOT))) == set()
    for kind in (2, 9, 4.5):
        report = checked(acts((kind, 0.0), (5, -45.0), *SHOT))
        assert (codes(report), report.ok) == ({"unknown-item"}, False)
        assert f"waypoint 0 has an action {kind:g}" in report.findings[0].message
