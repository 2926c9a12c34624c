"""From what a log's messages say to its triggers: what a trigger message leaves out is taken from the track."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.flightlogs.model import Attitude, Gimbal, Place, Series, Track, Trigger
from fieldkit.flightlogs.values import as_attitude, as_gimbal, as_place
from fieldkit.geometry.angles import wrapped_deg
from fieldkit.wording import count

_GIMBAL_REACH_S = 2.0
_FASTEST_GIMBAL_DPS = 100.0
"""Camera gimbals on multicopters turn at 30 to 100 °/s when they are told to."""
_ACCURACY_REACH_S = 10.0
_MOST_LISTED = 8


@dataclass(frozen=True)
class Event:
    """A trigger message. Attributes are those of `Trigger`; place and attitude where the message holds them."""

    time_s: float
    utc_s: float | None
    image: int | None
    place: Place | None
    attitude: Attitude | None
    source: str


Commanded = Callable[[float], Gimbal | None]
"""The gimbal's attitude that a mission had commanded at a time on the log's clock."""


def complete(events: Sequence[Event], track: Track, commanded: Commanded | None = None) -> tuple[Trigger, ...]:
    """The triggers in the order of time; a message that was recorded twice counts once."""
    triggers: list[Trigger] = []
    seen: set[tuple[float, int | None]] = set()
    for event in sorted(events, key=lambda e: e.time_s):
        if (event.time_s, event.image) in seen:
            continue
        seen.add((event.time_s, event.image))
        triggers.append(_complete(event, track, commanded))
    return tuple(triggers)


def missing_numbers(triggers: Sequence[Trigger]) -> list[str]:
    """A remark where the autopilot's numbers say that trigger messages are missing from the log."""
    numbers = [t.image for t in triggers if t.image is not None]
    if len(numbers) < 2 or numbers != sorted(set(numbers)):
        return []
    absent = numbers[-1] - numbers[0] + 1 - len(numbers)
    if not 0 < absent <= 100_000:
        return []
    have = set(numbers)
    listed = [n for n in range(numbers[0], numbers[-1] + 1) if n not in have][:_MOST_LISTED]
    more = ", …" if absent > len(listed) else ""
    names = ", ".join(map(str, listed))
    lost = count(absent, "trigger message is", "trigger messages are")
    return [f"{lost} missing from the log (lost on the link?): image {names}{more}"]


def _complete(event: Event, track: Track, commanded: Commanded | None) -> Trigger:
    time = event.time_s
    place, attitude = event.place, event.attitude
    if place is None:
        row = track.position.at(time)
        place = None if row is None else as_place(*(float(v) for v in row))
    if attitude is None:
        row = track.attitude.at(time)
        attitude = None if row is None else as_attitude(*(float(v) for v in row))
    velocity = track.velocity.at(time)
    accuracy = track.accuracy.at(time, _ACCURACY_REACH_S)
    gimbal = _gimbal(track, time)
    if gimbal is None and commanded is not None:
        gimbal = commanded(time)
    return Trigger(
        time_s=time,
        utc_s=event.utc_s,
        image=event.image,
        place=place,
        attitude=attitude,
        gimbal=gimbal,
        speed_mps=None if velocity is None else float((velocity @ velocity) ** 0.5),
        accuracy_m=None if accuracy is None or accuracy[0] <= 0.0 else float(accuracy[0]),
        source=event.source,
        turning_dps=_turning(track, time),
        interpolated=event.place is None or event.attitude is None,
    )


def _gimbal(track: Track, time_s: float) -> Gimbal | None:
    """The gimbal as reported around a time.

    A jump faster than gimbals turn is a new target, of one that reports its targets. Mission items run in order, the
    gimbal's before the shutter's, so the target behind such a jump is the one that the shutter found.
    """
    in_vehicle = track.gimbal_vehicle.distance_s(time_s) <= track.gimbal_north.distance_s(time_s)
    series: Series = track.gimbal_vehicle if in_vehicle else track.gimbal_north
    row = series.at(time_s, _GIMBAL_REACH_S)
    if row is not None and _rate(series, time_s) > _FASTEST_GIMBAL_DPS:
        row = series.values[int(np.searchsorted(series.times_s, time_s))]
    if row is None:
        return None
    roll, pitch, yaw = row.tolist()
    return as_gimbal(roll, pitch, yaw, "vehicle" if in_vehicle else "north", "reported")


def _turning(track: Track, time_s: float) -> float | None:
    """How fast the camera turns, degrees per second: the vehicle's heading or the gimbal, whichever is faster."""
    kinds = (track.attitude, track.gimbal_vehicle, track.gimbal_north)
    rates = [_rate(series, time_s, yaw_only=series is track.attitude) for series in kinds if len(series) > 1]
    return max(rates) if rates else None


def _rate(series: Series, time_s: float, *, yaw_only: bool = False) -> float:
    """Degrees per second between the samples on both sides of a time; 0 beyond the ends and over gaps."""
    after = int(np.searchsorted(series.times_s, time_s))
    if not 0 < after < len(series):
        return 0.0
    span = float(series.times_s[after] - series.times_s[after - 1])
    if span > 2.0 * _GIMBAL_REACH_S:
        return 0.0
    step = wrapped_deg(series.values[after] - series.values[after - 1])
    return float(np.abs(step[2:] if yaw_only else step).max()) / span
