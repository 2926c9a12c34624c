"""Poses achieved at every trigger of the recorded flights, against what the recordings' JSON says of them."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink import DFReader, mavutil

from fieldkit.flightlogs import Attitude, FixedMount, Gimbal, Series, Trigger, achieved_pose, read_flight_log
from fieldkit.flightlogs.adherence import assigned, station_errors
from fieldkit.flightlogs.assembly import euler_deg
from fieldkit.flightlogs.dataflash import read_messages
from fieldkit.flightlogs.reading import _unpacked
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.results.evaluation import StationErrorEntry
from tests.flightlogs.recordings import description, flight_log, recording
from tests.flightlogs.test_px4_logs import quaternion

FLOWN = ["mount_then_yaw", "wind4turb_settled", "roi_settled", "naive", "hold0"]
LOGS = [*(f"{name}.tlog" for name in FLOWN), "mount_then_yaw.BIN.gz"]
SETTLED = ["mount_then_yaw.tlog", "wind4turb_settled.tlog", "roi_settled.tlog", "mount_then_yaw.BIN.gz"]


def turn(a: float, b: float) -> float:
    return abs((a - b + 180.0) % 360.0 - 180.0)


def apart_m(latitude: float, longitude: float, to: dict[str, float]) -> float:
    frame = LocalFrame(to["lat"], to["lon"])
    return float(np.linalg.norm(frame.to_local(latitude, longitude, 0.0)[0]))


@pytest.mark.parametrize("name", LOGS)
def test_poses_are_those_of_the_triggers(name: str) -> None:
    log = flight_log(name)
    told = description(name.split(".")[0])["triggers"]
    assert log.clock == "boot"
    assert [t.image for t in log.triggers] == [t["img"] for t in told]
    for trigger, t in zip(log.triggers, told, strict=True):
        pose = achieved_pose(trigger)
        assert abs(trigger.time_s - t["t_s"]) < 0.020
        assert apart_m(pose.place.latitude_deg, pose.place.longitude_deg, t["est"]) < 0.02
        assert pose.place.above_home_m == pytest.approx(t["est"]["rel_alt"], abs=0.02)
        assert pose.yaw_deg is not None
        assert turn(pose.yaw_deg, t["est"]["yaw"] + t["gimbal"]["yaw_body"]) < 0.2
        assert pose.pitch_deg == pytest.approx(t["gimbal"]["pitch"], abs=0.2)
        assert trigger.attitude.roll_deg == pytest.approx(t["est"]["roll"], abs=0.2)
        assert trigger.attitude.pitch_deg == pytest.approx(t["est"]["pitch"], abs=0.2)


@pytest.mark.parametrize("name", LOGS)
def test_the_track_between_messages_leads_to_the_same_poses(name: str) -> None:
    """Interpolated at the trigger's time, from messages that are 50 or 100 ms apart and nothing of the trigger's own.

    Positions have the grid of 1e-7° (1.1 cm) and the motion between; hold0 turns at 60 °/s while it photographs.
    """
    log = flight_log(name)
    settled = name in SETTLED
    for trigger, t in zip(log.triggers, description(name.split(".")[0])["triggers"], strict=True):
        place, attitude = log.track.position.at(trigger.time_s), log.track.attitude.at(trigger.time_s)
        velocity = log.track.velocity.at(trigger.time_s)
        assert apart_m(place[0], place[1], t["est"]) < (0.02 if settled else 0.05)
        assert place[3] == pytest.approx(t["est"]["rel_alt"], abs=0.02 if settled else 0.06)
        assert turn(attitude[2], t["est"]["yaw"]) < (0.2 if settled else 2.0)
        assert math.hypot(velocity[0], velocity[1]) == pytest.approx(t["true_speed"], abs=0.12)


def test_mavsdk4_holds_only_the_triggers() -> None:
    """Its log has no attitude, no position and no gimbal reports, and its JSON no poses: compared with its mission."""
    path = recording("mavsdk4.tlog")
    log = read_flight_log(path)
    assert (log.clock, len(log.triggers)) == ("UTC", description("mavsdk4")["flight"]["photos"])
    link = mavutil.mavlink_connection(str(path))
    told = list(iter(lambda: link.recv_match(type="CAMERA_FEEDBACK"), None))
    link.close()
    for trigger, m in zip(log.triggers, told, strict=True):
        assert trigger.place.latitude_deg == pytest.approx(m.lat * 1e-7, abs=1e-10)
        assert trigger.utc_s == pytest.approx(m.time_usec * 1e-6, abs=1e-5)
    found = kept_to(planned("mount_then_yaw"), log.triggers)
    assert [e.image for e in found] == [f"{k}" for k in range(13)]
    assert max(np.hypot(e.east_m, e.north_m) for e in found) < 0.1
    assert max(abs(e.yaw_deg or 0.0) for e in found) < 3.0
    assert {e.pitch_deg for e in found} == {None}


def test_dataflash_messages_are_those_that_pymavlink_reads(tmp_path: Path) -> None:
    packed = recording("mount_then_yaw.BIN.gz")
    data = _unpacked(packed.read_bytes(), 1 << 30)
    file = tmp_path / "flight.BIN"
    file.write_bytes(data)
    names = {"CAM", "MNT", "ATT", "POS", "GPS", "XKF1", "ORGN", "GPA"}
    found, _ = read_messages(data, names)
    reader = DFReader.DFReader_binary(str(file))
    for name in names:
        reader.rewind()
        theirs = []
        while (m := reader.recv_match(type=name)) is not None:
            theirs.append(m)
        ours = found[name]
        assert len(ours) == len(theirs)
        for column in ours.rows.dtype.names or ():
            expected = np.array([float(getattr(m, column)) for m in theirs]) * (1e-6 if column == "TimeUS" else 1.0)
            np.testing.assert_allclose(ours.column(column), expected, rtol=1e-6, atol=1e-9)
    reader.close()


angles = st.tuples(st.floats(-180, 180), st.floats(-89, 89), st.floats(-180, 180))


@given(angles)
def test_euler_angles_of_quaternions(rpy: tuple[float, float, float]) -> None:
    for found, wanted in zip(euler_deg(quaternion(*rpy))[0], rpy, strict=True):
        assert turn(float(found), wanted) < 1e-6


def trigger(attitude: Attitude | None, gimbal: Gimbal | None) -> Trigger:
    return Trigger(0.0, None, 1, None, attitude, gimbal, None, None, "test")


def test_a_gimbals_heading() -> None:
    nose = Attitude(5.0, -3.0, 350.0)
    assert achieved_pose(trigger(nose, Gimbal(0, -40, 20, "vehicle"))).yaw_deg == pytest.approx(10.0)
    assert achieved_pose(trigger(nose, Gimbal(0, -40, 20, "north"))).yaw_deg == pytest.approx(20.0)
    assert achieved_pose(trigger(nose, Gimbal(0, -40, 20, "vehicle"))).pitch_deg == -40
    assert achieved_pose(trigger(None, Gimbal(0, -40, 20, "vehicle"))).yaw_deg is None
    assert achieved_pose(trigger(nose, None)).pitch_deg is None


@given(st.floats(-60, 60), st.floats(0, 359), st.floats(-40, 40))
def test_a_fixed_camera_turns_with_the_vehicle(pitch: float, yaw: float, mounted: float) -> None:
    """In pitch and heading angles add; a roll about the optical axis is the camera's roll."""
    level = achieved_pose(trigger(Attitude(0.0, pitch / 2, yaw), None), FixedMount(mounted))
    assert level.pitch_deg == pytest.approx(pitch / 2 + mounted, abs=1e-6)
    assert level.yaw_deg is not None
    assert turn(level.yaw_deg, yaw) < 1e-6
    rolled = achieved_pose(trigger(Attitude(pitch, 0.0, yaw), None), FixedMount(0.0))
    assert rolled.roll_deg == pytest.approx(pitch, abs=1e-6)
    sideways = achieved_pose(trigger(Attitude(0.0, 0.0, yaw), None), FixedMount(mounted, 90.0))
    straight = Pose.from_yaw_pitch(np.zeros(3), yaw + 90.0, mounted)
    assert sideways.yaw_deg is not None
    assert sideways.pitch_deg is not None
    got = Pose.from_yaw_pitch(np.zeros(3), sideways.yaw_deg, sideways.pitch_deg)
    assert rotation_angle_deg(got.rotation, straight.rotation) < 1e-5


def test_series_wrap_and_end() -> None:
    series = Series.of([2.0, 0.0, 1.0, 1.0, math.nan], [[10], [350], [358], [0], [5]], 1, (0,))
    assert len(series) == 3
    middle = series.at(1.5)
    assert turn(float(middle[0]), 4.0) < 1e-9
    assert series.at(3.5) is None
    assert series.at(2.5) == pytest.approx([10.0])
    assert Series.empty(2).at(0.0) is None


# How far photographs were taken from their stations, on the recorded flights.


def planned(name: str) -> dict[str, dict[str, float]]:
    return {f"station {s['i']}": s for s in description(name)["stations"]}


def kept_to(plan: dict[str, dict[str, float]], triggers: Sequence[Trigger]) -> list[StationErrorEntry]:
    """Errors of triggers, named by their numbers, that belong to a station."""
    first = next(iter(plan.values()))
    frame = LocalFrame(first["lat"] * 1e-7, first["lon"] * 1e-7)

    def place(latitude: float, longitude: float, height: float) -> tuple[float, float, float]:
        east, north, _ = frame.to_local(latitude, longitude, 0.0)[0]
        return east, north, height

    stations = {n: (place(s["lat"] * 1e-7, s["lon"] * 1e-7, s["h"]), s["yaw"], s["pitch"]) for n, s in plan.items()}
    taken = {}
    for k, trigger in enumerate(triggers):
        pose = achieved_pose(trigger)
        at = place(pose.place.latitude_deg, pose.place.longitude_deg, pose.place.above_home_m)
        taken[str(k)] = at, pose.yaw_deg, pose.pitch_deg
    return station_errors(stations, taken, assigned(stations, taken))


@pytest.mark.parametrize("name", ["mount_then_yaw", "naive", "hold0"])
def test_errors_are_those_of_the_recording(name: str) -> None:
    """The JSON's err_est are its triggers' estimates less their stations; north is 2 % off there (a round factor)."""
    triggers = flight_log(f"{name}.tlog").triggers
    found = kept_to(planned(name), triggers)
    told = {t["img"]: t for t in description(name)["triggers"]}
    assert len(found) == len(triggers) == len(planned(name))
    for error in found:
        t = told[triggers[int(error.image)].image]
        assert error.station == f"station {t['station']}"
        assert error.east_m == pytest.approx(t["err_est"]["e"], abs=0.012)
        assert error.north_m == pytest.approx(t["err_est"]["n"], abs=0.012)
        assert error.up_m == pytest.approx(t["err_est"]["u"], abs=0.011)
        assert error.yaw_deg == pytest.approx(t["err_est"]["yaw"], abs=0.02)
        station = description(name)["stations"][t["station"]]
        assert error.pitch_deg == pytest.approx(t["gimbal"]["pitch"] - station["pitch"], abs=0.01)


def test_missing_and_extra_whatever_the_order() -> None:
    triggers = flight_log("mount_then_yaw.tlog").triggers
    plan = planned("mount_then_yaw")
    rng = np.random.default_rng(1)
    order = rng.permutation(13)
    shuffled = [triggers[k] for k in order]
    kept = [t for t in shuffled if t.image != 10]
    found = kept_to({name: station for name, station in plan.items() if name != "station 5"}, kept)
    assert 6 not in {kept[int(error.image)].image for error in found}
    assert [e.station for e in found] == [f"station {k}" for k in range(13) if k not in (5, 9)]
    for error in found:
        assert kept[int(error.image)].image == int(error.station.split()[1]) + 1
        assert np.hypot(error.east_m, error.north_m) < 0.1
