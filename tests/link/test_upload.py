"""Uploads through the real MAVSDK."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mavsdk
import pytest

from fieldkit.errors import LinkError, MissionError
from fieldkit.link.compare import to_wire
from fieldkit.link.item_rules import stored
from fieldkit.link.upload import upload_mission
from fieldkit.link.upload_outcome import Held, ItemRefused, Patience, UploadError, UploadInterrupted
from fieldkit.missions.items import MissionItem
from fieldkit.routing.mission import Fence, Home
from fieldkit.standin.faults import Faults
from fieldkit.standin.recording import Recording, read_recording
from fieldkit.standin.replay import Replay

SPEED = 16.0
PATIENCE = Patience(reply_s=0.5 / SPEED)
SHORT = Patience(reply_s=0.01, attempts=1, downloads=1)
KEY = bytes(range(32))
SLOW = pytest.mark.slow
Missions = Callable[[int], tuple[MissionItem, ...]]


def standing(recording: Recording, *, faults: Faults | None = None, key: bytes | None = None) -> Replay:
    return Replay(recording, speed=SPEED, begin_s=45.0, rate_hz=1.0, faults=faults, key=key)


def holds(vehicle: Replay, items: tuple[MissionItem, ...]) -> bool:
    return vehicle.autopilot.items[1:] == tuple(stored(item) for item in to_wire(items))


def test_a_flown_mission(recording: Recording, flown: tuple[MissionItem, ...]) -> None:
    shown = 0

    def advance(count: int) -> None:
        nonlocal shown
        assert count > 0
        shown += count

    with standing(recording) as vehicle:
        report = upload_mission(
            flown, vehicle.url, home=Home(50.8649, 6.4473, 92.0), dialect="ardupilot", patience=PATIENCE,
            advance=advance,
        )  # fmt: skip
        assert holds(vehicle, flown)
        assert report.read_back[1:] == vehicle.autopilot.items[1:]
    assert (report.autopilot, report.items, report.fence_items, report.attempts) == ("ArduPilot", 67, 0, 1)
    assert not report.signed
    assert shown == 67
    assert "item 2 DO_MOUNT_CONTROL: param 7 2 is kept as 0" in report.roundings


def test_the_largest_mission(recording: Recording, delays: Missions) -> None:
    with standing(recording) as vehicle:
        report = upload_mission(delays(649), vehicle.url, patience=PATIENCE)
        assert len(report.read_back) == 650
        assert holds(vehicle, delays(649))


def test_a_larger_one_is_refused_before_anything_is_sent(recording: Recording, delays: Missions) -> None:
    with standing(recording) as vehicle:
        with pytest.raises(MissionError, match="650 items and home, the vehicle stores 650; nothing was sent"):
            upload_mission(delays(650), vehicle.url)
        with pytest.raises(MissionError, match="empty"):
            upload_mission((), vehicle.url)
        assert vehicle.traffic.heard == 0


def test_a_fence(recording: Recording, flown: tuple[MissionItem, ...]) -> None:
    square = ((50.864, 6.446), (50.864, 6.448), (50.866, 6.448), (50.866, 6.446))
    hole = ((50.8641, 6.4461), (50.8641, 6.4462), (50.8642, 6.4462))
    with standing(recording) as vehicle:
        report = upload_mission(flown, vehicle.url, fence=Fence((square,), (hole,)), patience=PATIENCE)
        assert report.fence_items == 7
        corners = [(item.command, item.x) for item in vehicle.autopilot.fence.items]
        assert corners[:4] == [(5001, round(latitude * 1e7)) for latitude, _ in square]
        assert corners[4:] == [(5002, round(latitude * 1e7)) for latitude, _ in hole]
        assert holds(vehicle, flown)


def test_a_refused_item_is_named_and_nothing_mixed_is_left(
    recording: Recording, flown: tuple[MissionItem, ...], delays: Missions
) -> None:
    bad = list(flown)
    bad[7] = MissionItem(195, 6, (0.0, 0.0, 0.0, 0.0, 50.865, 6.4473, 0.5))
    vehicle = standing(recording)
    vehicle.hold(delays(20))
    with vehicle:
        with pytest.raises(ItemRefused, match="refuses item 8, DO_SET_ROI_LOCATION: MAV_MISSION_UNSUPPORTED") as caught:
            upload_mission(bad, vehicle.url, patience=PATIENCE)
        assert caught.value.held is Held.CLEARED
        assert (caught.value.item, caught.value.exit_code) == (8, 5)
        assert len(vehicle.autopilot.items) == 1  # home alone


def test_who_is_refused_an_upload(sitl: Path, recording: Recording, flown: tuple[MissionItem, ...]) -> None:
    flying = read_recording(sitl / "mount_then_yaw.tlog")
    with Replay(flying, begin_s=60.0, rate_hz=2.0) as vehicle:
        with pytest.raises(MissionError, match="is armed"):
            upload_mission(flown, vehicle.url)
        assert vehicle.autopilot.mission.items == ()
    with standing(recording) as vehicle:
        with pytest.raises(MissionError, match="written for px4, the vehicle is an ArduPilot"):
            upload_mission(flown, vehicle.url, dialect="px4")
        assert vehicle.autopilot.mission.items == ()


def test_nobody_there(flown: tuple[MissionItem, ...]) -> None:
    with pytest.raises(LinkError, match=r"no vehicle was heard in 0\.3 s") as caught:
        upload_mission(flown, "udpin://127.0.0.1:0", patience=Patience(connect_s=0.3))
    assert caught.value.exit_code == 6


def test_a_mavsdk_whose_time_outs_cannot_be_set_is_refused_before_anything_is_sent(
    recording: Recording, flown: tuple[MissionItem, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Library:
        """MAVSDK's, less the function that its Python API does not name."""

        def __init__(self, whole: Any) -> None:
            self._whole = whole

        def __getattr__(self, name: str) -> Any:
            if name == "mavsdk_set_timeout_s":
                raise AttributeError(name)
            return getattr(self._whole, name)

    class Another(mavsdk.Mavsdk):  # type: ignore[misc]
        def __init__(self, configuration: Any) -> None:
            super().__init__(configuration)
            self._lib = Library(self._lib)

    monkeypatch.setattr(mavsdk, "Mavsdk", Another)
    with standing(recording) as vehicle:
        with pytest.raises(LinkError, match="does not let its time-outs be set") as caught:
            upload_mission(flown, vehicle.url, patience=PATIENCE)
        assert vehicle.autopilot.items == ()
    assert "pip install" in caught.value.remedy


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=SLOW), pytest.param(2, marks=SLOW)])
def test_bad_links(recording: Recording, flown: tuple[MissionItem, ...], delays: Missions, seed: int) -> None:
    vehicle = standing(recording, faults=Faults(loss=0.1, duplicate=0.2, delay_s=0.02, seed=seed))
    vehicle.hold(delays(30))
    with vehicle:
        report = upload_mission(flown, vehicle.url, patience=PATIENCE)
        assert report.read_back[1:] == vehicle.autopilot.items[1:]
        assert holds(vehicle, flown)


@pytest.mark.parametrize("item", [30, pytest.param(1, marks=SLOW), pytest.param(67, marks=SLOW)])
def test_ctrl_c_clears_what_was_begun(
    recording: Recording, flown: tuple[MissionItem, ...], delays: Missions, item: int
) -> None:
    shown = 0

    def advance(count: int) -> None:
        nonlocal shown
        shown += count
        if shown >= item:
            raise KeyboardInterrupt

    vehicle = standing(recording, faults=Faults(loss=0.03, seed=item))
    vehicle.hold(delays(30))
    with vehicle:
        with pytest.raises(UploadInterrupted, match="holds no mission now") as caught:
            upload_mission(flown, vehicle.url, patience=PATIENCE, advance=advance)
        assert (caught.value.held, caught.value.exit_code) == (Held.CLEARED, 130)
        assert len(vehicle.autopilot.items) == 1
        upload_mission(flown, vehicle.url, patience=PATIENCE)
        assert holds(vehicle, flown)


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=SLOW) for seed in range(2, 12))])
def test_cut_at_any_packet_and_repeated(
    recording: Recording, flown: tuple[MissionItem, ...], delays: Missions, seed: int
) -> None:
    """The link breaks after some packets: the state is not known, and that is told; repeated, the mission is whole."""
    vehicle = standing(recording, faults=Faults(loss=0.02, seed=seed))
    vehicle.hold(delays(30))
    packets = random.Random(seed).randint(3, 140)
    with vehicle:
        vehicle.cut_after(packets)
        with pytest.raises(LinkError) as caught:
            upload_mission(flown, vehicle.url, patience=replace(SHORT, connect_s=2.0))
        if isinstance(caught.value, UploadError):
            assert caught.value.held is Held.UNKNOWN
            assert "mix of the old and the new" in str(caught.value)
        vehicle.cut_after(None)
        report = upload_mission(flown, vehicle.url, patience=PATIENCE)
        assert report.read_back[1:] == vehicle.autopilot.items[1:]
        assert holds(vehicle, flown)


def test_a_link_that_comes_back_in_time(recording: Recording, flown: tuple[MissionItem, ...], delays: Missions) -> None:
    vehicle = standing(recording)
    vehicle.hold(delays(30))
    with vehicle:
        vehicle.cut_after(25)
        mend = threading.Timer(1.5, vehicle.cut_after, [None])
        mend.start()
        report = upload_mission(flown, vehicle.url, patience=PATIENCE)
        mend.join()
        assert report.attempts > 1
        assert holds(vehicle, flown)


def test_killed_and_repeated(recording: Recording, flown: tuple[MissionItem, ...], delays: Missions) -> None:
    """A process that is killed leaves a mix, as a real ArduPilot has it; the next upload makes it whole."""
    script = textwrap.dedent(
        """
        import sys
        from fieldkit.missions.items import MissionItem
        from fieldkit.link.upload import upload_mission
        from fieldkit.link.upload_outcome import Patience
        items = tuple(MissionItem(93, 2, (1000.0 + k, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0)) for k in range(600))
        upload_mission(items, sys.argv[1], patience=Patience(reply_s=0.05))
        """
    )
    old = delays(640)
    vehicle = standing(recording, faults=Faults(delay_s=0.02))
    vehicle.hold(old)
    with vehicle:
        process = subprocess.Popen([sys.executable, "-c", script, vehicle.url])
        end = time.monotonic() + 60
        while (vehicle.autopilot.mission.receiving is None or vehicle.traffic.heard < 100) and time.monotonic() < end:
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        process.wait()
        held = vehicle.autopilot.items[1:]
        new = sum(item.params[0] >= 1000.0 for item in held)
        assert 0 < new < len(held) == 600  # a mix, ready to fly
        upload_mission(flown, vehicle.url, patience=PATIENCE)
        assert holds(vehicle, flown)


def test_a_signed_link(recording: Recording, delays: Missions) -> None:
    with standing(recording, key=KEY) as vehicle:
        report = upload_mission(delays(20), vehicle.url, key=KEY, patience=PATIENCE)
        assert report.signed
        assert holds(vehicle, delays(20))
        assert vehicle.traffic.refused == 0
        with pytest.raises(LinkError, match="not signed with this key"):
            upload_mission(delays(5), vehicle.url, key=bytes(32), patience=Patience(connect_s=0.5))
        with pytest.raises(UploadError) as caught:
            upload_mission(delays(5), vehicle.url, patience=SHORT)
        assert caught.value.held is Held.UNKNOWN
        assert vehicle.traffic.refused > 0
        assert holds(vehicle, delays(20))


def test_a_vehicle_that_does_not_sign_is_not_heard(recording: Recording, delays: Missions) -> None:
    with standing(recording) as vehicle:
        with pytest.raises(LinkError, match="not signed with this key"):
            upload_mission(delays(5), vehicle.url, key=KEY, patience=Patience(connect_s=0.5))
        assert vehicle.autopilot.mission.items == ()
