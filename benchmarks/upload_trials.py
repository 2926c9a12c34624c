"""Many uploads of one mission over bad and broken links, through the real MAVSDK against the stand-in vehicle."""

from __future__ import annotations

import random
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fieldkit.errors import FieldkitError, LinkError
from fieldkit.link.items import stored, to_wire
from fieldkit.link.upload import Held, ItemRefused, UploadError, UploadReport, upload_mission
from fieldkit.link.vehicle import Vehicle
from fieldkit.missions.items import MissionItem
from fieldkit_sim.standin.recording import read_recording
from fieldkit_sim.standin.replay import Faults, Replay

_AGAIN_S, _SILENCE_S = 0.7, 9.0
"""Of `Vehicle`; they are shortened as the vehicle's time is."""
_WITH_GPS_S = 45.0
"""Time in the recordings at which the vehicle stands at home with a position."""


@dataclass(frozen=True)
class Trials:
    """Results of many uploads."""

    count: int
    succeeded: int  # by their own report
    identical: int  # of these, after which the vehicle held exactly what was read back, except home
    attempts: int  # within them, one each without failures
    packets: int  # of the whole link, both ways
    lost: int
    seconds: float  # of wall time
    vehicle_s: float  # the same in vehicle time
    failures: tuple[str, ...]  # messages of those that failed


def upload_trials(
    count: int,
    loss: float,
    seed: int,
    *,
    items: Sequence[MissionItem],
    recording: Path,
    speed: float = 8.0,
    duplicate: float = 0.0,
    delay_s: float = 0.0,
) -> Trials:
    """Upload a mission ``count`` times over a link with faults, each onto a vehicle that holds an older mission.

    Args:
        count: number of uploads; each has its own vehicle and random numbers.
        loss: share of lost packets, each way.
        seed: of the random numbers.
        items: of the mission, without home.
        recording: of a vehicle, for its telemetry.
        speed: vehicle seconds per second. Time-outs of both sides are scaled too, so statistics are those of real time
            if this machine answers within a few hundredths of a second.
        duplicate: share of packets that arrives twice.
        delay_s: mean time under way, vehicle seconds.
    """
    source = read_recording(recording)
    begun = time.monotonic()
    old = tuple(items[: max(1, len(items) // 2)])
    succeeded = identical = attempts = packets = lost = 0
    failures = []
    for number in range(count):
        faults = Faults(loss=loss, duplicate=duplicate, delay_s=delay_s, seed=seed * 100_003 + number)
        vehicle = Replay(source, speed=speed, faults=faults, begin_s=_WITH_GPS_S, rate_hz=1.0)
        vehicle.hold(old)
        with vehicle:
            try:
                report = _uploaded(vehicle, items, speed)
            except FieldkitError as error:
                failures.append(str(error))
            else:
                succeeded += 1
                attempts += report.attempts
                identical += report.read_back[1:] == vehicle.autopilot.items[1:]
            packets += vehicle.traffic.heard + vehicle.traffic.said
            lost += vehicle.traffic.lost
    seconds = time.monotonic() - begun
    return Trials(count, succeeded, identical, attempts, packets, lost, seconds, seconds * speed, tuple(failures))


def _uploaded(vehicle: Replay, items: Sequence[MissionItem], speed: float, connect_s: float = 20.0) -> UploadReport:
    with Vehicle(vehicle.url, connect_s=connect_s, again_s=_AGAIN_S / speed, silence_s=_SILENCE_S / speed) as link:
        return upload_mission(link, items)


@dataclass(frozen=True)
class CutTrials:
    """Results of uploads whose link broke, each repeated over the restored link."""

    count: int
    unheard: int  # broke before the vehicle was heard; nothing was sent
    completed: int  # broke after the upload had ended well
    reported: dict[str, int]  # states reported of the vehicle, by the names of `Held`, or "WHOLE"
    untrue: int  # reports that were wrong
    whole: int  # repeated uploads after which the vehicle held the whole new mission
    failures: tuple[str, ...]  # messages of the repeated uploads that failed


def cut_trials(
    count: int, seed: int, *, items: Sequence[MissionItem], recording: Path, loss: float = 0.02, speed: float = 16.0
) -> CutTrials:
    """Break the link after a random number of packets, check the report, restore the link and repeat the upload."""
    source = read_recording(recording)
    generator = random.Random(seed)
    old = tuple(items[: max(1, len(items) // 2)])
    new = tuple(stored(item) for item in to_wire(items))
    reported: dict[str, int] = {}
    unheard = completed = untrue = whole = 0
    failures = []
    for number in range(count):
        faults = Faults(loss=loss, seed=seed * 100_003 + number)
        vehicle = Replay(source, speed=speed, faults=faults, begin_s=_WITH_GPS_S, rate_hz=1.0)
        vehicle.hold(old)
        before = vehicle.autopilot.items[1:]
        with vehicle:
            vehicle.cut_after(generator.randint(1, 2 * len(items) + 20))
            held: Held | None = None
            try:
                _uploaded(vehicle, items, speed, connect_s=2.0)
            except (UploadError, ItemRefused) as error:
                held = error.held
            except LinkError:
                unheard += 1
                held = Held.UNTOUCHED
            else:
                completed += 1
            name = "WHOLE" if held is None else held.name
            reported[name] = reported.get(name, 0) + 1
            now = vehicle.autopilot.items[1:]
            true = {Held.UNTOUCHED: before, Held.CLEARED: (), None: new}
            untrue += held in true and now != true[held]
            vehicle.cut_after(None)
            try:
                _uploaded(vehicle, items, speed)
            except FieldkitError as error:
                failures.append(str(error))
            else:
                whole += vehicle.autopilot.items[1:] == new
    return CutTrials(count, unheard, completed, reported, untrue, whole, tuple(failures))
