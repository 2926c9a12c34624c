"""Logs that are cut, mutated or made to do harm end in a MetadataError, or are read as far as they make sense."""

import gzip
import struct
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fieldkit.errors import MetadataError
from fieldkit.flightlogs import achieved_pose, match, read_flight_log
from fieldkit.flightlogs.matching import Stamp
from fieldkit.flightlogs.mavlink import LogReader
from tests.flightlogs.recordings import recording
from tests.flightlogs.test_px4_logs import flight
from tests.flightlogs.ulog_file import write_ulog

QUIET = settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])


def dataflash(rows: int = 40) -> bytes:
    """A small dataflash log: FMT, ATT, POS, GPS, CAM."""

    def fmt(kind: int, size: int, name: bytes, types: bytes, labels: bytes) -> bytes:
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, size, name, types, labels)

    parts = [
        fmt(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"),
        fmt(1, 17, b"ATT", b"Qccc", b"TimeUS,Roll,Pitch,Yaw"),
        fmt(2, 27, b"POS", b"QLLff", b"TimeUS,Lat,Lng,Alt,RelHomeAlt"),
        fmt(3, 17, b"GPS", b"QIH", b"TimeUS,GMS,GWk"),
        fmt(4, 35, b"CAM", b"QHLLffccC", b"TimeUS,Img,Lat,Lng,Alt,RelAlt,R,P,Y"),
    ]
    for k in range(rows):
        us = 1_000_000 * k
        parts.append(b"\xa3\x95\x01" + struct.pack("<Qhhh", us, 10, -10, 9000))
        parts.append(b"\xa3\x95\x02" + struct.pack("<Qiiff", us, 508650000 + k, 64473000, 95.0, 3.0))
        parts.append(b"\xa3\x95\x03" + struct.pack("<QIH", us, 510990400 + 1000 * k, 2445))
        if k % 5 == 2:
            row = struct.pack("<QHiiffhhH", us, k, 508650000 + k, 64473000, 95.0, 3.0, 0, 0, 9000)
            parts.append(b"\xa3\x95\x04" + row)
    return b"".join(parts)


def whole(path: Path) -> None:
    """Read a log and use all that it says."""
    log = read_flight_log(path)
    for trigger in log.triggers:
        achieved_pose(trigger)
    match([Stamp("a", 3.0), Stamp("b", 4.0, 50.0, 7.0)], log.triggers[:50])


def tolerated(path: Path) -> None:
    error: MetadataError | None = None
    try:
        whole(path)
    except MetadataError as caught:
        error = caught
    assert error is None or (error.path == path and error.message and error.remedy)


def mutated(data: bytes, edits: list[tuple[int, int]], cut: int) -> bytes:
    changed = bytearray(data[: max(1, len(data) - cut % len(data))])
    for at, value in edits:
        changed[at % len(changed)] = value
    return bytes(changed)


edits = st.lists(st.tuples(st.integers(0, 1 << 24), st.integers(0, 255)), max_size=40)
cuts = st.one_of(st.just(0), st.integers(0, 1 << 20))


@pytest.fixture(scope="module")
def sound() -> dict[str, bytes]:
    """A small log of each kind; of the telemetry log the last minute of a recording: triggers, home and mission."""
    data = recording("naive.tlog").read_bytes()
    return {".tlog": data[:60_000] + data[800_000:860_000], ".BIN": dataflash(), ".ulg": write_ulog(flight())}


@pytest.mark.parametrize("suffix", [".tlog", ".BIN", ".ulg"])
@given(edits, cuts)
@QUIET
def test_mutated_logs(
    sound: dict[str, bytes], tmp_path: Path, suffix: str, edits: list[tuple[int, int]], cut: int
) -> None:
    path = tmp_path / f"flight{suffix}"
    path.write_bytes(mutated(sound[suffix], edits, cut))
    tolerated(path)


def test_a_log_that_is_cut_short_is_read_up_to_there(tmp_path: Path) -> None:
    data = recording("mount_then_yaw.tlog").read_bytes()
    path = tmp_path / "cut.tlog"
    path.write_bytes(data[: len(data) // 2])
    log = read_flight_log(path)
    assert 3 <= len(log.triggers) < 13
    torn = bytearray(data)
    torn[300_000:301_000] = b"\xfd" * 1000
    path.write_bytes(torn)
    log = read_flight_log(path)
    assert len(log.triggers) == 13
    assert "damaged" in log.remarks[0]


def test_lost_trigger_messages_are_told(tmp_path: Path) -> None:
    """The frames of the fifth and sixth trigger are taken out, as a radio link loses them."""
    data = recording("mount_then_yaw.tlog").read_bytes()
    frames = [frame.data for frame in LogReader(data) if frame.kind == 180]
    for frame in frames[4:6]:
        at = data.index(frame)
        data = data[: at - 8] + data[at + len(frame) :]
    path = tmp_path / "lossy.tlog"
    path.write_bytes(data)
    log = read_flight_log(path)
    assert [t.image for t in log.triggers] == [1, 2, 3, 4, 7, 8, 9, 10, 11, 12, 13]
    assert log.remarks == ("2 trigger messages are missing from the log (lost on the link?): image 5, 6",)


def test_bombs_and_other_files_are_refused(tmp_path: Path) -> None:
    bomb = tmp_path / "bomb.BIN.gz"
    bomb.write_bytes(gzip.compress(bytes(100 << 20), 9))
    with pytest.raises(MetadataError, match="far more than a log holds"):
        read_flight_log(bomb)
    large = tmp_path / "large.tlog"
    large.write_bytes(bytes(5000))
    with pytest.raises(MetadataError, match="far too large"):
        read_flight_log(large, max_bytes=4000)
    with pytest.raises(MetadataError, match="no MAVLink"):
        read_flight_log(large)
    with pytest.raises(MetadataError, match="no such file"):
        read_flight_log(tmp_path / "none.tlog")
    empty = tmp_path / "empty.tlog"
    empty.touch()
    with pytest.raises(MetadataError, match="is empty"):
        read_flight_log(empty)
