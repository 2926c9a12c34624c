"""Checks before a start, and the start."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from fieldkit.errors import LinkError, MissionError
from fieldkit.link.filter_flags import uses_gps
from fieldkit.link.mavsdk_vehicle import MavsdkVehicle
from fieldkit.link.start import check_standing, start_mission
from fieldkit.link.upload import connected
from fieldkit.missions.items import MissionItem
from fieldkit.routing.mission import Home
from fieldkit.standin.recording import Recording
from fieldkit.standin.replay import Replay

HOME = Home(50.8649, 6.4473, 92.0)


@contextmanager
def vehicle_of(
    recording: Recording, begin_s: float, items: tuple[MissionItem, ...] = ()
) -> Iterator[tuple[Replay, MavsdkVehicle]]:
    replay = Replay(recording, speed=10.0, begin_s=begin_s)
    replay.hold(items)
    with replay, connected(replay.url) as vehicle:
        yield replay, vehicle


def test_a_vehicle_at_home_is_started(recording: Recording, flown: tuple[MissionItem, ...]) -> None:
    with vehicle_of(recording, 60.0, flown) as (replay, vehicle):
        standing = check_standing(vehicle, HOME)
        assert standing.distance_m < 1.0
        assert abs(standing.height_m) < 1.0
        assert standing.satellites == 10
        start_mission(vehicle)
        assert (replay.autopilot.armed, replay.autopilot.mode, replay.autopilot.current) == (True, 3, 1)
        with pytest.raises(MissionError, match="armed already"):
            check_standing(vehicle, HOME)


def test_a_vehicle_elsewhere_is_not(recording: Recording) -> None:
    with vehicle_of(recording, 60.0) as (_, vehicle):
        check_standing(vehicle, Home(50.8649, 6.4473 + 8 / 70200, 92.0))
        with pytest.raises(MissionError, match=r"is 1[12]\.\d m from the site's home"):
            check_standing(vehicle, Home(50.8650, 6.4473 + 4 / 70200, 92.0))
        check_standing(vehicle, Home(50.8650, 6.4473, 92.0), within_m=20.0)


def test_without_gps_it_is_not_either(recording: Recording) -> None:
    with vehicle_of(recording, 20.0) as (_, vehicle):
        with pytest.raises(MissionError, match=r"has not used GPS in 0\.3 s"):
            check_standing(vehicle, HOME, wait_s=0.3)
        check_standing(vehicle, HOME, wait_s=20.0)  # it comes at 41.5 s of the recording


def test_a_refused_start_leaves_it_disarmed(recording: Recording) -> None:
    with vehicle_of(recording, 60.0) as (replay, vehicle):
        with pytest.raises(LinkError, match=r"to AUTO: failed .*Missing Takeoff.*It is disarmed\.") as caught:
            start_mission(vehicle)
        assert caught.value.remedy
        assert not replay.autopilot.armed


def test_a_lost_link_is_not_hidden(recording: Recording, flown: tuple[MissionItem, ...]) -> None:
    with vehicle_of(recording, 60.0, flown) as (replay, vehicle):
        replay.cut_after(1)  # arming arrives, its answer does not
        with pytest.raises(LinkError, match=r"arming was not acknowledged\. IT MAY BE ARMED"):
            start_mission(vehicle, command_s=0.5)
        replay.cut_after(None)


@pytest.mark.parametrize(("flags", "uses"), [(0, False), (167, False), (831, True), (1024, False), (831 | 128, False)])
def test_flags_of_the_recordings(flags: int, uses: bool) -> None:
    assert uses_gps(flags) is uses
