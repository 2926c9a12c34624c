"""Uploads through the real MAVSDK."""

import random
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fieldkit.errors import LinkError, MissionError
from fieldkit.link.items import stored, to_wire
from fieldkit.link.upload import Held, ItemRefused, UploadError, UploadInterrupted, UploadReport, upload_mission
from fieldkit.link.vehicle import Vehicle
from fieldkit.missions.items import MissionItem
from fieldkit.routing.mission import Home
from fieldkit_sim.standin.recording import Recording, read_recording
from fieldkit_sim.standin.replay import Faults, Replay

SPEED = 16.0
SLOW = pytest.mark.slow
Missions = Callable[[int], tuple[MissionItem, ...]]


def standing(recording: Recording, holds: tuple[MissionItem, ...] = (), *, faults: Faults | None = None) -> Replay:
    """A vehicle on the ground that holds a mission already."""
    vehicle = Replay(recording, speed=SPEED, begin_s=45.0, rate_hz=1.0, faults=faults)
    if holds:
        vehicle.hold(holds)
    return vehicle


def upload(vehicle: Replay, items: tuple[MissionItem, ...], *, connect_s: float = 10.0, **options: Any) -> UploadReport:
    """Over a link whose waits are as short as the vehicle's time."""
    with Vehicle(vehicle.url, connect_s=connect_s, again_s=0.7 / SPEED, silence_s=9.0 / SPEED) as link:
        return upload_mission(link, items, **options)


def holds(vehicle: Replay, items: tuple[MissionItem, ...]) -> bool:
    return vehicle.autopilot.items[1:] == tuple(stored(item) for item in to_wire(items))


def test_a_flown_mission(recording: Recording, flown: tuple[MissionItem, ...]) -> None:
    shown = 0

    def advance(count: int) -> None:
        nonlocal shown
        assert count > 0
        shown += count

    with standing(recording) as vehicle:
        report = upload(vehicle, flown, home=Home(50.8649, 6.4473, 92.0), dialect="ardupilot", advance=advance)
        assert holds(vehicle, flown)
        assert report.read_back[1:] == vehicle.autopilot.items[1:]
    assert (report.autopilot, report.items, report.attempts) == ("ArduPilot", 67, 1)
    assert shown == 67


def test_a_larger_one_is_refused_before_anything_is_sent(recording: Recording, delays: Missions) -> None:
    with standing(recording) as vehicle:
        with pytest.raises(MissionError, match="650 items and home, the vehicle stores 650; nothing was sent"):
            upload(vehicle, delays(650))
        with pytest.raises(MissionError, match="empty"):
            upload(vehicle, ())
        assert vehicle.autopilot.mission == ()


def test_a_refused_item_is_named_and_nothing_mixed_is_left(recording, flown, delays) -> None:
    bad = list(flown)
    bad[7] = MissionItem(195, 6, (0.0, 0.0, 0.0, 0.0, 50.865, 6.4473, 0.5))
    vehicle = standing(recording, delays(20))
    with vehicle:
        with pytest.raises(ItemRefused, match="refuses item 8, DO_SET_ROI_LOCATION: MAV_MISSION_UNSUPPORTED") as caught:
            upload(vehicle, tuple(bad))
        assert caught.value.held is Held.CLEARED
        assert (caught.value.item, caught.value.exit_code) == (8, 5)
        assert vehicle.autopilot.items == ()


def test_who_is_refused_an_upload(sitl: Path, recording: Recording, flown: tuple[MissionItem, ...]) -> None:
    flying = read_recording(sitl / "mount_then_yaw.tlog")
    with Replay(flying, begin_s=60.0, rate_hz=2.0) as vehicle:
        with pytest.raises(MissionError, match="is armed"):
            upload(vehicle, flown)
        assert vehicle.autopilot.mission == ()
    with standing(recording) as vehicle:
        with pytest.raises(MissionError, match="written for px4, the vehicle is an ArduPilot"):
            upload(vehicle, flown, dialect="px4")
        assert vehicle.autopilot.mission == ()


def test_nobody_there() -> None:
    with pytest.raises(LinkError, match=r"no vehicle was heard in 0\.3 s") as caught:
        Vehicle("udpin://127.0.0.1:14599", connect_s=0.3)
    assert caught.value.exit_code == 6


@pytest.mark.parametrize("item", [30, pytest.param(1, marks=SLOW), pytest.param(67, marks=SLOW)])
def test_ctrl_c_clears_what_was_begun(recording, flown, delays, item) -> None:
    shown = 0

    def advance(count: int) -> None:
        nonlocal shown
        shown += count
        if shown >= item:
            raise KeyboardInterrupt

    vehicle = standing(recording, delays(30), faults=Faults(loss=0.03, seed=item))
    with vehicle:
        with pytest.raises(UploadInterrupted, match="holds no mission now") as caught:
            upload(vehicle, flown, advance=advance)
        assert (caught.value.held, caught.value.exit_code) == (Held.CLEARED, 130)
        assert vehicle.autopilot.items == ()
        upload(vehicle, flown)
        assert holds(vehicle, flown)


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=SLOW) for seed in range(2, 12))])
def test_cut_at_any_packet_and_repeated(recording, flown, delays, seed) -> None:
    """The link breaks after some packets: the state is not known, and that is told; repeated, the mission is whole."""
    vehicle = standing(recording, delays(30), faults=Faults(loss=0.02, seed=seed))
    packets = random.Random(seed).randint(3, 140)
    with vehicle:
        vehicle.cut_after(packets)
        with pytest.raises(LinkError) as caught:
            upload(vehicle, flown, connect_s=2.0)
        if isinstance(caught.value, UploadError):
            assert caught.value.held is Held.UNKNOWN
            assert "mix of the old and the new" in str(caught.value)
        vehicle.cut_after(None)
        report = upload(vehicle, flown)
        assert report.read_back[1:] == vehicle.autopilot.items[1:]
        assert holds(vehicle, flown)


def test_killed_and_repeated(recording: Recording, flown: tuple[MissionItem, ...], delays: Missions) -> None:
    """A process that is killed leaves a mix, as a real ArduPilot has it; the next upload makes it whole."""
    script = textwrap.dedent(
        """
        import sys
        from fieldkit.missions.items import MissionItem
        from fieldkit.link.upload import upload_mission
        from fieldkit.link.vehicle import Vehicle
        items = tuple(MissionItem(93, 2, (1000.0 + k, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0)) for k in range(600))
        with Vehicle(sys.argv[1]) as vehicle:
            upload_mission(vehicle, items)
        """
    )
    old = delays(640)
    vehicle = standing(recording, old, faults=Faults(delay_s=0.02))
    with vehicle:
        process = subprocess.Popen([sys.executable, "-c", script, vehicle.url])
        end = time.monotonic() + 60
        while (vehicle.autopilot.receiving is None or vehicle.traffic.heard < 100) and time.monotonic() < end:
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        process.wait()
        held = vehicle.autopilot.items[1:]
        new = sum(item.params[0] >= 1000.0 for item in held)
        assert 0 < new < len(held) == 600  # a mix, ready to fly
        upload(vehicle, flown)
        assert holds(vehicle, flown)
