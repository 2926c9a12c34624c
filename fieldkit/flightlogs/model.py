"""What a flight log says, whatever wrote it. Angles are degrees; the vehicle's axes are forward, right, down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.arrays import FloatArray
from fieldkit.geometry.geodesy import geodetic_to_ecef
from fieldkit.geometry.pose import wrapped_deg

Clock = Literal["boot", "UTC"]
"""Seconds since the autopilot started, or since 1970-01-01 UTC."""
LogKind = Literal["tlog", "dataflash", "ulog"]
YawFrame = Literal["vehicle", "north"]

_REACH_S = 1.0
"""Time to the nearest sample beyond which a series is unknown, seconds."""
_DOUBLED_S = 0.3
"""Time within which a trigger may repeat the one before, seconds."""
_BURST_S = 3.0
"""Most time between two triggers of a burst, seconds."""
_HOVER_M = 0.3
"""Most distance between two triggers of a burst, metres."""


@dataclass(frozen=True)
class Place:
    """Where the vehicle was, as its estimator had it."""

    latitude_deg: float
    longitude_deg: float
    """WGS 84."""
    amsl_m: float | None = None
    """Above mean sea level."""
    above_home_m: float | None = None
    """Above the home position."""


@dataclass(frozen=True)
class Attitude:
    """Of the vehicle, north-east-down to forward-right-down, yaw first, then pitch, then roll (Tait–Bryan Z-Y-X)."""

    roll_deg: float
    """Positive lowers the right side."""
    pitch_deg: float
    """Positive raises the nose."""
    yaw_deg: float
    """Clockwise from true north."""


@dataclass(frozen=True)
class Gimbal:
    """Of the camera, as the gimbal reports it; one without encoders reports its targets."""

    roll_deg: float
    pitch_deg: float
    """Against the horizon; pitch −90 looks straight down."""
    yaw_deg: float
    """Clockwise, from ``frame``."""
    frame: YawFrame
    """"vehicle": from its heading; "north": from true north."""


@dataclass(frozen=True)
class Trigger:
    """One release of the shutter."""

    time_s: float
    """On the log's clock (`FlightLog.clock`)."""
    utc_s: float | None
    """Seconds since 1970-01-01 UTC, or None."""
    image: int | None
    """Number that the autopilot gave it, or None."""
    place: Place | None
    """None where the log does not say."""
    attitude: Attitude | None
    """Of the vehicle, never of the camera; None where the log does not say."""
    gimbal: Gimbal | None
    """None where the log holds neither a report nor a command."""
    speed_mps: float | None
    """Of the vehicle in space at that moment."""
    accuracy_m: float | None
    """Standard deviation of the horizontal position that the GNSS receiver stated."""
    source: str
    """Message that says so: "CAMERA_FEEDBACK", "CAM", "camera_capture" …"""
    turning_dps: float | None = None
    """How fast the camera turned, with the vehicle or on its gimbal, degrees per second; a gimbal that reports its
    targets seems to jump. None where the log does not say."""
    height_accuracy_m: float | None = None
    """Standard deviation of ``place.amsl_m`` where that is the receiver's, which is good to centimetres; None where it
    is the autopilot's estimate, which leans on the barometer."""


def doubled(triggers: Sequence[Trigger], photographs: int) -> tuple[int, ...]:
    """Triggers that repeat the one before: where most come within 0.3 s of it at one place, and photographs do not.

    A hot shoe that bounces, or a message for the command and one for the camera, as some autopilots write it.
    """
    if len(triggers) < 2:
        return ()
    near_s, apart_m = np.diff([t.time_s for t in triggers]), _apart_m(triggers)
    again = (near_s <= _DOUBLED_S) & ~(apart_m > _HOVER_M)
    single = len(triggers) - int(again.sum())
    return (
        tuple((np.flatnonzero(again) + 1).tolist())
        if 2 * again.sum() >= single and 2 * photographs <= 3 * single
        else ()
    )


def _apart_m(triggers: Sequence[Trigger]) -> FloatArray:
    places = [(t.place.latitude_deg, t.place.longitude_deg) if t.place else (np.nan, np.nan) for t in triggers]
    latitudes, longitudes = np.reshape(places, (-1, 2)).T
    return np.asarray(np.linalg.norm(np.diff(geodetic_to_ecef(latitudes, longitudes, 0.0), axis=0), axis=1))


def bursts_of(triggers: Sequence[Trigger]) -> NDArray[np.int_]:
    """(m,) which burst each trigger of a flight is of, from 0; all are alone where most would be: odd ones are none."""
    stays = (np.diff([t.time_s for t in triggers]) <= _BURST_S) & (_apart_m(triggers) <= _HOVER_M)
    bursts = np.cumsum(np.concatenate([[0], ~stays]))[: len(triggers)]
    sizes = np.unique(bursts, return_counts=True)[1]
    return bursts if len(triggers) and np.bincount(sizes).argmax() > 1 else np.arange(len(triggers))


@dataclass(frozen=True, eq=False)
class Series:
    """Values over time."""

    times_s: FloatArray
    """(n,) increasing."""
    values: FloatArray
    """(n, k)."""
    angles: tuple[int, ...] = ()
    """Columns that are degrees and wrap at 360."""

    @classmethod
    def of(cls, times_s: ArrayLike, values: ArrayLike, width: int, angles: tuple[int, ...] = ()) -> Series:
        """From samples in any order: times (n,) and values (n, ``width``); what is not finite is left out."""
        times = np.asarray(times_s, dtype=np.float64).reshape(-1)
        rows = np.asarray(values, dtype=np.float64).reshape(len(times), width)
        good = np.isfinite(times) & (np.abs(times) < 1e11) & np.isfinite(rows).all(axis=1)
        good &= (np.abs(rows) < 1e9).all(axis=1)
        times, first = np.unique(times[good], return_index=True)
        return cls(times, rows[good][first], angles)

    @classmethod
    def empty(cls, width: int) -> Series:
        """Without a sample."""
        return cls(np.zeros(0), np.zeros((0, width)))

    def __len__(self) -> int:
        return len(self.times_s)

    def distance_s(self, time_s: float) -> float:
        """To the nearest sample; infinite without any."""
        return float(np.abs(self.times_s - time_s).min()) if len(self) else float("inf")

    def at(self, time_s: float, reach_s: float = _REACH_S) -> FloatArray | None:
        """The values (k,) at a time, linear between neighbours; None farther than ``reach_s`` from any sample."""
        if self.distance_s(time_s) > reach_s:
            return None
        after = int(np.searchsorted(self.times_s, time_s))
        if after == 0 or after == len(self):
            return np.array(self.values[min(after, len(self) - 1)])
        before = after - 1
        span = self.times_s[after] - self.times_s[before]
        if span > 2.0 * reach_s:
            nearest = before if time_s - self.times_s[before] < self.times_s[after] - time_s else after
            return np.array(self.values[nearest])
        step = self.values[after] - self.values[before]
        for column in self.angles:
            step[column] = wrapped_deg(step[column])
        return np.asarray(self.values[before] + step * ((time_s - self.times_s[before]) / span))


_EMPTY = {width: Series.empty(width) for width in (1, 3, 4)}


@dataclass(frozen=True, eq=False)
class Track:
    """The flight between the triggers, on the log's clock."""

    position: Series = _EMPTY[4]
    """Latitude, longitude (degrees), above sea level, above home (metres)."""
    velocity: Series = _EMPTY[3]
    """North, east, down, m/s."""
    attitude: Series = _EMPTY[3]
    """Roll, pitch, yaw of the vehicle."""
    gimbal_vehicle: Series = _EMPTY[3]
    gimbal_north: Series = _EMPTY[3]
    """Roll, pitch, yaw of the camera, by the frame of their yaw."""
    accuracy: Series = _EMPTY[1]
    """Horizontal position accuracy that the GNSS receiver states, m."""
    vertical_accuracy: Series = _EMPTY[1]
    receiver_height: Series = _EMPTY[1]
    """The receiver's height above sea level, and its accuracy, m."""


@dataclass(frozen=True, eq=False)
class FlightLog:
    """A flight, read."""

    path: Path
    kind: LogKind
    clock: Clock
    """Of all ``time_s``."""
    home: Place | None
    """The last home position before the first trigger; its ``above_home_m`` is 0."""
    triggers: tuple[Trigger, ...]
    """In the order of time."""
    track: Track
    remarks: tuple[str, ...] = ()
    """What a person should know: gaps, damage, other cameras."""
    camera: int | None = None
    """Whose triggers these are, by the log's number; None where it holds those of one."""
    others: tuple[FlightLog, ...] = ()
    """The same flight with the other cameras' triggers."""
