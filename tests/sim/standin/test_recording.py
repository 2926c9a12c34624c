"""Telemetry logs, whole and damaged."""

import json
import struct
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.mavlink import LogReader, checksum_right, decode, frame_length, mavlink
from fieldkit_sim.standin.recording import read_frames, read_messages, read_recording
from fieldkit_sim.standin.replay import Splitter


def test_messages_are_those_that_mavutil_reads(sitl: Path) -> None:
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(str(sitl / "hold0.tlog"))
    theirs = []
    while (message := log.recv_msg()) is not None:
        theirs.append((message.get_type(), message.get_srcSystem(), bytes(message.get_msgbuf())))
    log.close()
    ours = [(m.get_type(), system, bytes(m.get_msgbuf())) for _, system, m in read_messages(sitl / "hold0.tlog")]
    assert ours == theirs
    photographs = json.loads((sitl / "hold0.json").read_text())["triggers"]
    assert sum(name == "CAMERA_FEEDBACK" for name, _, _ in ours) == len(photographs)


@given(st.data())
def test_damaged_logs_never_fail_but_cleanly(data: st.DataObject) -> None:
    whole = (Path(__file__).parents[3] / "sim/sitl/probe_items.tlog").read_bytes()
    begin = data.draw(st.integers(0, 50_000))
    piece = bytearray(whole[begin : begin + data.draw(st.integers(0, 3000))])
    for place, value in data.draw(st.lists(st.tuples(st.integers(0, 2999), st.integers(0, 255)), max_size=40)):
        if place < len(piece):
            piece[place] = value
    frames = None
    with tempfile.NamedTemporaryFile(suffix=".tlog") as file:
        file.write(piece)
        file.flush()
        with suppress(MetadataError):
            frames = list(read_frames(Path(file.name)))
    if frames is None:
        return
    assert frames
    assert sum(8 + len(frame.data) for frame in frames) <= len(piece)
    for frame in frames:
        assert decode(frame.data) is not None


@pytest.mark.parametrize("content", [b"", b"\xfe\x00" * 5000])
def test_no_log(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.tlog").write_bytes(content)
    with pytest.raises(MetadataError, match="holds no MAVLink messages"):
        list(read_frames(tmp_path / "x.tlog"))


def test_a_recording_is_what_the_vehicle_said(sitl: Path) -> None:
    flight = read_recording(sitl / "mount_then_yaw.tlog")
    assert (flight.system, flight.component) == (1, 1)
    assert flight.length_s == pytest.approx(230.339, abs=1e-3)
    assert flight.version.flight_sw_version >> 8 == 0x040506
    assert flight.parameters["WPNAV_SPEED"].param_value == 200
    kinds = {mavlink.mavlink_map[frame.message_id].msgname for frame in flight.telemetry}
    assert {"HEARTBEAT", "GLOBAL_POSITION_INT", "EKF_STATUS_REPORT", "STATUSTEXT", "CAMERA_FEEDBACK"} <= kinds


def test_a_log_without_a_vehicle(sitl: Path, tmp_path: Path) -> None:
    station = [f for f in read_frames(sitl / "probe_items.tlog") if f.system == 255]
    file = tmp_path / "station.tlog"
    file.write_bytes(b"".join(struct.pack(">Q", round(f.time_s * 1e6)) + f.data for f in station))
    with pytest.raises(MetadataError, match="no heartbeat of an autopilot"):
        read_recording(file)


def test_a_stream_is_cut_wherever_it_arrives(sitl: Path) -> None:
    frames = [frame.data for frame in read_frames(sitl / "probe_items.tlog")][:200]
    stream = b"noise\xfd" + b"".join(frames)
    for step in (1, 7, 300, len(stream)):
        splitter = Splitter()
        found = [f for k in range(0, len(stream), step) for f in splitter.split(stream[k : k + step])]
        assert found[1:] == frames[1:]
    damaged = bytearray(frames[3])
    damaged[12] ^= 1
    assert not checksum_right(bytes(damaged))
    assert frame_length(frames[3]) == len(frames[3])


@pytest.mark.parametrize(
    ("stranger", "skipped"),
    [
        (3 * (bytes(8) + b"\xfd\x04\x00\x00\x00\x01\x01\xee\xee\xee" + b"abcd" + b"\x12\x34"), 0),
        (bytes(8) + b"\xfd\xf0\x00\x00\x00\x01\x01\xee\xee\xee" + bytes(20), 38),  # says that it is longer
    ],
)
def test_frames_of_kinds_that_no_dialect_has_take_no_other_with_them(sitl: Path, stranger: bytes, skipped: int) -> None:
    frames = list(read_frames(sitl / "probe_items.tlog"))[:30]
    parts = [struct.pack(">Q", round(frame.time_s * 1e6)) + frame.data for frame in frames]
    reader = LogReader(b"".join([*parts[:10], stranger, *parts[10:]]))
    assert [frame.data for frame in reader] == [frame.data for frame in frames]
    assert reader.skipped == skipped


def test_damage_costs_no_frame_but_those_it_lies_in(sitl: Path) -> None:
    whole = (sitl / "hold0.tlog").read_bytes()
    begin, end = 300_000, 300_200
    data = whole[:begin] + b"\xfe\xfd" * 100 + whole[end:]
    kept, at = [], 0
    for frame in LogReader(whole):
        after = at + 8 + len(frame.data)
        if after <= begin or at >= end:
            kept.append(frame.data)
        at = after
    assert [frame.data for frame in LogReader(data)] == kept
