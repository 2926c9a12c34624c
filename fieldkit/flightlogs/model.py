"""What a flight log says, whatever wrote it. Angles are degrees; the vehicle's axes are forward, right, down."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.geometry.angles import wrapped_deg

Clock = Literal["boot", "UTC"]
"""Seconds since the autopilot started, or since 1970-01-01 UTC."""
LogKind = Literal["tlog", "dataflash", "ulog"]
YawFrame = Literal["vehicle", "north"]

_REACH_S = 1.0


@dataclass(frozen=True)
class Place:
    """Where the vehicle was, as its estimator had it.

    Attributes:
        latitude_deg, longitude_deg: WGS 84.
        amsl_m: above mean sea level.
        above_home_m: above the home position.
    """

    latitude_deg: float
    longitude_deg: float
    amsl_m: float | None = None
    above_home_m: float | None = None


@dataclass(frozen=True)
class Attitude:
    """Of the vehicle, north-east-down to forward-right-down, yaw first, then pitch, then roll (Tait–Bryan Z-Y-X).

    Attributes:
        roll_deg: positive lowers the right side.
        pitch_deg: positive raises the nose.
        yaw_deg: clockwise from true north.
    """

    roll_deg: float
    pitch_deg: float
    yaw_deg: float


@dataclass(frozen=True)
class Gimbal:
    """Of the camera.

    Attributes:
        roll_deg, pitch_deg: against the horizon; pitch −90 looks straight down.
        yaw_deg: clockwise, from ``frame``.
        frame: "vehicle": from its heading; "north": from true north.
        source: "reported" by the gimbal (one without encoders reports its targets), or "commanded" by the mission item
            that ran last, where the log holds no report.
    """

    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    frame: YawFrame
    source: Literal["reported", "commanded"] = "reported"


@dataclass(frozen=True)
class Trigger:
    """One release of the shutter.

    Attributes:
        time_s: on the log's clock (`FlightLog.clock`).
        utc_s: seconds since 1970-01-01 UTC, or None.
        image: number that the autopilot gave it, or None.
        place: None where the log does not say.
        attitude: of the vehicle, never of the camera; None where the log does not say.
        gimbal: None where the log holds neither a report nor a command.
        speed_mps: of the vehicle in space at that moment.
        accuracy_m: standard deviation of the horizontal position that the GNSS receiver stated.
        turning_dps: how fast the camera turned, with the vehicle or on its gimbal, degrees per second; a gimbal that
            reports its targets seems to jump. None where the log does not say.
        source: message that says so: "CAMERA_FEEDBACK", "CAM", "camera_capture" …
        interpolated: whether place and attitude are the track's at that time and not the trigger message's own.
    """

    time_s: float
    utc_s: float | None
    image: int | None
    place: Place | None
    attitude: Attitude | None
    gimbal: Gimbal | None
    speed_mps: float | None
    accuracy_m: float | None
    source: str
    turning_dps: float | None = None
    interpolated: bool = False


@dataclass(frozen=True, eq=False)
class Series:
    """Values over time.

    Attributes:
        times_s: (n,) increasing.
        values: (n, k).
        angles: columns that are degrees and wrap at 360.
    """

    times_s: NDArray[np.float64]
    values: NDArray[np.float64]
    angles: tuple[int, ...] = ()

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

    def at(self, time_s: float, reach_s: float = _REACH_S) -> NDArray[np.float64] | None:
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


@dataclass(frozen=True, eq=False)
class Track:
    """The flight between the triggers, on the log's clock.

    Attributes:
        position: latitude, longitude (degrees), above sea level, above home (metres).
        velocity: north, east, down, m/s.
        attitude: roll, pitch, yaw of the vehicle.
        gimbal_vehicle, gimbal_north: roll, pitch, yaw of the camera, by the frame of their yaw.
        accuracy: horizontal position accuracy that the GNSS receiver states, m.
    """

    position: Series = field(default_factory=lambda: Series.empty(4))
    velocity: Series = field(default_factory=lambda: Series.empty(3))
    attitude: Series = field(default_factory=lambda: Series.empty(3))
    gimbal_vehicle: Series = field(default_factory=lambda: Series.empty(3))
    gimbal_north: Series = field(default_factory=lambda: Series.empty(3))
    accuracy: Series = field(default_factory=lambda: Series.empty(1))


@dataclass(frozen=True, eq=False)
class FlightLog:
    """A flight, read.

    Attributes:
        path: the file.
        kind: of file.
        clock: of all ``time_s``.
        home: the last home position before the first trigger; its ``above_home_m`` is 0.
        triggers: in the order of time.
        track: everything between.
        remarks: what a person should know: gaps, damage, other cameras.
    """

    path: Path
    kind: LogKind
    clock: Clock
    home: Place | None
    triggers: tuple[Trigger, ...]
    track: Track
    remarks: tuple[str, ...] = ()
