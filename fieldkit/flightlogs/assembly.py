"""From what messages say to triggers: numbers checked, and what a message leaves out taken from the track."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.flightlogs.model import Attitude, Gimbal, Place, Series, Track, Trigger, YawFrame
from fieldkit.geometry.geodesy import on_earth
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.wording import count

_GIMBAL_REACH_S = 2.0
_FASTEST_GIMBAL_DPS = 100.0
"""Camera gimbals on multicopters turn at 30 to 100 °/s when they are told to."""
_ACCURACY_REACH_S = 10.0
_MOST_LISTED = 8


Commanded = Callable[[float], Gimbal | None]
"""The gimbal's attitude that a mission had commanded at a time on the log's clock."""
_YAW_LOCK, _YAW_VEHICLE, _YAW_NORTH = 16, 32, 64
GPS_EPOCH_S = 315964800.0
"""1980-01-06, the zero of GPS time, in seconds since 1970."""
LEAP_SECONDS = 18.0
"""GPS time less UTC since 2017-01-01 (IERS Bulletin C)."""
_UTC_RANGE = (1.0e9, 4.2e9)
_BOOT_LIMIT_S = 4.4e6


@dataclass(frozen=True)
class Event:
    """A trigger message. Attributes are those of `Trigger`; place and attitude where the message holds them."""

    time_s: float
    utc_s: float | None
    image: int | None
    place: Place | None
    attitude: Attitude | None
    source: str


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


def as_place(
    latitude_deg: float, longitude_deg: float, amsl_m: float | None, above_home_m: float | None
) -> Place | None:
    """A place, or None for (0, 0) (no fix) and for what is not on Earth; heights beyond 100 km are dropped."""
    if not on_earth(latitude_deg, longitude_deg) or (latitude_deg == 0.0 and longitude_deg == 0.0):
        return None
    return Place(float(latitude_deg), float(longitude_deg), _height(amsl_m), _height(above_home_m))


def as_attitude(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Attitude | None:
    """An attitude with its yaw in [0, 360), or None where a number is no angle."""
    if not all(math.isfinite(a) and abs(a) <= 720.0 for a in (roll_deg, pitch_deg, yaw_deg)):
        return None
    return Attitude(float(roll_deg), float(pitch_deg), float(yaw_deg) % 360.0)


def as_gimbal(
    roll_deg: float, pitch_deg: float, yaw_deg: float, frame: YawFrame, source: Literal["reported", "commanded"]
) -> Gimbal | None:
    """Where a gimbal points, or None where its pitch is no angle."""
    if not (math.isfinite(pitch_deg) and abs(pitch_deg) <= 180.0):
        return None
    return Gimbal(float(roll_deg), float(pitch_deg), float(yaw_deg), frame, source)


def as_utc(seconds: float) -> float | None:
    """Seconds since 1970, or None where that lies outside 2001 … 2103: clocks that were never set."""
    return float(seconds) if math.isfinite(seconds) and _UTC_RANGE[0] < seconds < _UTC_RANGE[1] else None


def as_boot(seconds: float) -> float | None:
    """Seconds since boot, or None where that is more than 50 days (MAVLink's 32-bit milliseconds)."""
    return float(seconds) if math.isfinite(seconds) and 0.0 <= seconds < _BOOT_LIMIT_S else None


def gps_to_utc(week: ArrayLike, milliseconds: ArrayLike) -> NDArray[np.float64]:
    """GPS week and milliseconds of it to seconds since 1970 UTC."""
    weeks = np.asarray(week, dtype=np.float64)
    return np.asarray(GPS_EPOCH_S + weeks * 604800.0 + np.asarray(milliseconds, np.float64) * 1e-3 - LEAP_SECONDS)


def gimbal_yaw_frame(flags: int) -> YawFrame:
    """What GIMBAL_DEVICE_ATTITUDE_STATUS.q's yaw counts from (MAVLink common.xml, GIMBAL_DEVICE_FLAGS).

    Flag 32 (YAW_IN_VEHICLE_FRAME) or 64 (YAW_IN_EARTH_FRAME) says it; senders older than these mean north where the
    yaw is locked (16), the vehicle's heading otherwise.
    """
    if flags & _YAW_VEHICLE:
        return "vehicle"
    return "north" if flags & (_YAW_NORTH | _YAW_LOCK) else "vehicle"


def euler_deg(quaternions: ArrayLike) -> NDArray[np.float64]:
    """Roll, pitch, yaw (n, 3) in degrees (Tait–Bryan Z-Y-X) of quaternions (n, 4), w first.

    NaN where a quaternion is no rotation. Within 0.1° of pitch ±90 roll and yaw are one rotation: it goes to yaw.
    """
    q = np.atleast_2d(np.asarray(quaternions, dtype=np.float64))
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.linalg.norm(q, axis=1, keepdims=True)
        w, x, y, z = (q / np.where((length > 0.5) & (length < 2.0), length, np.nan)).T
        sine = np.clip(2.0 * (w * y - z * x), -1.0, 1.0)
        upright = np.abs(sine) > np.sin(np.radians(89.9))
        roll = np.where(upright, 0.0, np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)))
        yaw = np.where(
            upright,
            np.arctan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z)),
            np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )
        return np.asarray(np.degrees(np.stack([roll, np.arcsin(sine), yaw], axis=1)))


def _height(metres: float | None) -> float | None:
    return float(metres) if metres is not None and math.isfinite(metres) and abs(metres) < 1e5 else None
