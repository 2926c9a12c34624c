"""The stand-in vehicle, against the real pymavlink."""

import socket
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fieldkit.errors import UsageError
from fieldkit.link.items import ARDUPILOT, mission_items
from fieldkit.missions.items import MissionItem
from fieldkit_sim.standin.recording import Recording, read_recording
from fieldkit_sim.standin.replay import Channel, Faults, Replay


@pytest.fixture
def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def station(free_port: int) -> Iterator[Any]:
    """pymavlink's own station, waiting for a vehicle."""
    from pymavlink import mavutil

    link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{free_port}", source_system=255, source_component=190)
    link.place = f"udpout://127.0.0.1:{free_port}"
    yield link
    link.close()


def receive(station: Any, *names: str) -> Any:
    message = station.recv_match(type=list(names), blocking=True, timeout=10)
    assert message is not None, names
    return message


def test_telemetry_comes_at_vehicle_time(recording: Recording, station: Any) -> None:
    with Replay(recording, serve=station.place, speed=50.0, begin_s=40.0):
        begun = time.monotonic()
        counts: Counter[str] = Counter()
        last = None
        while last is None or last.time_boot_ms < 60_000:
            message = receive(station, "ATTITUDE", "HEARTBEAT", "GLOBAL_POSITION_INT", "EKF_STATUS_REPORT")
            counts[message.get_type()] += 1
            last = message if message.get_type() == "ATTITUDE" else last
        took = time.monotonic() - begun
    recorded = Counter(f.message_id for f in recording.telemetry if 40.0 <= f.time_s <= 60.0)
    assert counts["ATTITUDE"] == pytest.approx(recorded[30], abs=3)
    assert counts["HEARTBEAT"] == pytest.approx(recorded[0] + 1, abs=2)
    assert took > 0.35  # 20 s of vehicle time at 50
    assert station.mav.total_receive_errors == 0
    assert station.packet_loss() == 0


def test_after_its_end_the_vehicle_stays_connected(sitl: Path, station: Any) -> None:
    short = read_recording(sitl / "probe_items.tlog")
    with Replay(short, serve=station.place, speed=20.0, begin_s=short.length_s + 1.0):
        assert [receive(station, "HEARTBEAT").type for _ in range(4)] == [2, 2, 2, 2]
        assert receive(station, "EKF_STATUS_REPORT").flags == 831
        assert receive(station, "GLOBAL_POSITION_INT").lat == pytest.approx(508649000, abs=100)


def test_pymavlink_uploads_and_downloads(recording: Recording, station: Any, flown: tuple[MissionItem, ...]) -> None:
    sent = mission_items(flown, None, ARDUPILOT)
    with Replay(recording, serve=station.place, speed=5.0, begin_s=45.0, rate_hz=1.0) as vehicle:
        station.wait_heartbeat(timeout=10)
        station.mav.mission_count_send(1, 1, len(sent))
        asked = []
        while (message := receive(station, "MISSION_REQUEST", "MISSION_ACK")).get_type() == "MISSION_REQUEST":
            item = sent[message.seq]
            asked.append(message.seq)
            station.mav.mission_item_int_send(
                1, 1, message.seq, item.frame, item.command, 0, 1, *item.params, item.x, item.y, item.z
            )
        assert message.type == 0
        assert asked == list(range(len(sent)))
        station.mav.mission_request_list_send(1, 1)
        count = receive(station, "MISSION_COUNT").count
        assert count == 68
        for seq in range(count):
            station.mav.mission_request_int_send(1, 1, seq)
            item = receive(station, "MISSION_ITEM_INT")
            held = vehicle.autopilot.items[seq]
            assert (item.seq, item.command, item.frame) == (seq, held.command, held.frame)
            assert (item.x, item.y, item.z) == (held.x, held.y, pytest.approx(held.z))
        assert vehicle.autopilot.items[0].x == 508649000  # its own home
        station.mav.mission_clear_all_send(1, 1)
        assert receive(station, "MISSION_ACK").type == 0
        assert vehicle.autopilot.items == ()


def test_faults_lose_packets_both_ways(recording: Recording, station: Any) -> None:
    faults = Faults(loss=0.5, seed=3)
    with Replay(recording, serve=station.place, speed=20.0, begin_s=45.0, rate_hz=2.0, faults=faults) as vehicle:
        station.wait_heartbeat(timeout=10)
        answers = 0
        for _ in range(60):
            station.mav.mission_request_list_send(1, 1)
            answers += station.recv_match(type="MISSION_COUNT", blocking=True, timeout=0.03) is not None
        traffic = vehicle.traffic
    assert 15 <= traffic.heard <= 45
    assert 3 <= answers <= 30
    assert traffic.lost > 30


@pytest.mark.parametrize("serve", ["udpout://192.0.2.1:14550", "udpin://0.0.0.0:14550", "tcpout://127.0.0.1:5760"])
def test_only_on_this_machine(recording: Recording, serve: str) -> None:
    with pytest.raises(UsageError, match="this machine only"):
        Replay(recording, serve=serve)


def test_shares_and_the_order_are_kept_the_same_at_a_seed() -> None:
    packets = [k.to_bytes(2, "big") for k in range(20_000)]
    channels = [Channel(Faults(loss=0.2, duplicate=0.1, seed=4), 0) for _ in range(2)]
    for channel in channels:
        for packet in packets:
            channel.put(packet, 0.0)
    channel = channels[0]
    assert channel.lost == pytest.approx(4000, rel=0.05)
    assert channel.doubled == pytest.approx(1600, rel=0.1)
    arrived = channel.arrived(0.0)
    assert len(arrived) == 20_000 - channel.lost + channel.doubled
    assert arrived == sorted(arrived) == channels[1].arrived(0.0)
    assert channel.arrived(1.0) == []


@pytest.mark.parametrize(
    "arguments",
    [{"loss": 1.1}, {"duplicate": float("nan")}],
)
def test_errors(arguments: dict[str, float]) -> None:
    with pytest.raises(UsageError):
        Faults(**arguments)
