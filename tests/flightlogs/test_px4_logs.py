"""PX4 logs, written by the published format and read back, also by pyulog."""

import io
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from fieldkit.flightlogs import achieved_pose, read_flight_log
from fieldkit.flightlogs.ulog import SYNC, read_topics
from tests.flightlogs.ulog_file import Topic, message, write_ulog

UTC_US = 1_795_211_730_000_000
YAW_VEHICLE, YAW_LOCK = 32, 16


def quaternion(roll: float, pitch: float, yaw: float) -> list[float]:
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.radians([roll, pitch, yaw]) / 2), np.sin(np.radians([roll, pitch, yaw]) / 2)
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]


def flight(flags: int = YAW_VEHICLE) -> dict[str, Topic]:
    """One minute northwards at 2 m/s, turning 3 °/s, gimbal at −40° and 10° to the right; a photograph every 10 s."""
    times = [10_000_000 + 100_000 * k for k in range(600)]

    def heading(us: float) -> float:
        return 350.0 + 3.0 * (us - 10_000_000) * 1e-6

    def latitude(us: float) -> float:
        return 50.0 + 2.0 * (us - 10_000_000) * 1e-6 / 111_240.0

    gimbal = 10.0 if flags & YAW_VEHICLE else 123.0
    shots = [15_030_000 + 10_000_000 * k for k in range(5)]
    return {
        "vehicle_attitude": (
            "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;uint8_t quat_reset_counter;uint8_t[7] _padding0;",
            [(t + 5_000, t, quaternion(2.0, -1.0, heading(t)), 0, [0] * 7) for t in times],
        ),
        "vehicle_global_position": (
            "uint64_t timestamp;double lat;double lon;float alt;",
            [(t, latitude(t), 7.0, 103.5) for t in times[::2]],
        ),
        "vehicle_local_position": (
            "uint64_t timestamp;float vx;float vy;float vz;",
            [(t, 2.0, 0.0, 0.0) for t in times[::2]],
        ),
        "home_position": ("uint64_t timestamp;double lat;double lon;float alt;", [(9_000_000, 50.0, 7.0, 100.0)]),
        "gimbal_device_attitude_status": (
            "uint64_t timestamp;uint16_t device_flags;float[4] q;",
            [(t, flags, quaternion(0.0, -40.0, gimbal)) for t in times[::5]],
        ),
        "vehicle_gps_position": (
            "uint64_t timestamp;uint64_t time_utc_usec;float eph;",
            [(t, t + UTC_US, 0.8) for t in times[::10]],
        ),
        "camera_capture": (
            "uint64_t timestamp;uint64_t timestamp_utc;uint32_t seq;double lat;double lon;float alt;int8_t result;",
            [(t, t + UTC_US, k + 1, latitude(t), 7.0, 103.5, 1) for k, t in enumerate(shots)],
        ),
    }


@pytest.mark.parametrize(("flags", "gimbal_yaw"), [(YAW_VEHICLE, None), (YAW_LOCK, 123.0)])
def test_poses_of_a_flight(tmp_path: Path, flags: int, gimbal_yaw: float | None) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(write_ulog(flight(flags)))
    log = read_flight_log(path)
    assert (log.kind, log.clock, log.remarks) == ("ulog", "boot", ())
    assert len(log.triggers) == 5
    for k, trigger in enumerate(log.triggers):
        time = 15.03 + 10.0 * k
        pose = achieved_pose(trigger)
        assert trigger.time_s == pytest.approx(time)
        assert trigger.image == k + 1
        assert pose.place.latitude_deg == pytest.approx(50.0 + 2.0 * (time - 10.0) / 111_240.0, abs=1e-8)
        assert pose.place.above_home_m == pytest.approx(3.5)
        expected = (350.0 + 3.0 * (time - 10.0) + 10.0 if gimbal_yaw is None else gimbal_yaw) % 360.0
        assert pose.yaw_deg == pytest.approx(expected, abs=0.01)
        assert pose.pitch_deg == pytest.approx(-40.0, abs=1e-3)
        assert trigger.speed_mps == pytest.approx(2.0)
        assert trigger.accuracy_m == pytest.approx(0.8)


def test_triggers_without_a_place_take_the_tracks(tmp_path: Path) -> None:
    topics = flight()
    shots = topics.pop("camera_capture")[1]
    topics["camera_trigger"] = (
        "uint64_t timestamp;uint64_t timestamp_utc;uint32_t seq;",
        [(row[0], 0, row[2]) for row in shots],
    )
    path = tmp_path / "flight.ulg"
    path.write_bytes(write_ulog(topics))
    log = read_flight_log(path)
    assert [t.source for t in log.triggers] == ["camera_trigger"] * 5
    for k, trigger in enumerate(log.triggers):
        assert trigger.place.latitude_deg == pytest.approx(50.0 + 2.0 * (5.03 + 10.0 * k) / 111_240.0, abs=1e-8)
        assert trigger.utc_s == pytest.approx(UTC_US * 1e-6 + trigger.time_s, abs=1e-4)


def test_topics_are_those_that_pyulog_reads() -> None:
    data = write_ulog(flight())
    ours, skipped = read_topics(data, frozenset(flight()))
    assert skipped == 0
    for theirs in ULog(io.BytesIO(data)).data_list:
        rows = ours[theirs.name]
        for name in rows.dtype.names or ():
            if rows.dtype[name].shape:
                for k in range(rows.dtype[name].shape[0]):
                    np.testing.assert_array_equal(rows[name][:, k], theirs.data[f"{name}[{k}]"])
            else:
                np.testing.assert_array_equal(rows[name], theirs.data[name])


def test_damage_in_the_middle_costs_what_lies_before_the_next_sync() -> None:
    data = write_ulog(flight())
    whole, _ = read_topics(data, frozenset(flight()))
    half = len(data) // 2
    torn = data[:half] + b"\xff" * 50 + message("S", SYNC) + write_ulog(flight())[half + 7 :]
    rows, skipped = read_topics(torn, frozenset(flight()))
    assert skipped > 0
    assert len(rows["vehicle_attitude"]) > 0.4 * len(whole["vehicle_attitude"])


def test_nested_formats_take_no_time() -> None:
    """Arrays of arrays of arrays: pyulog would expand them to 2.8e14 fields."""
    formats = b"".join(
        message("F", text.encode()) for text in ("camera_capture:b[65535] x;", "b:c[65535] x;", "c:uint8_t[65535] x;")
    )
    data = write_ulog({})[:16] + formats + message("A", struct_subscription("camera_capture"))
    assert read_topics(data, frozenset({"camera_capture"})) == ({}, 0)


def struct_subscription(name: str, instance: int = 0) -> bytes:
    return bytes([instance, 0, 0]) + name.encode()
