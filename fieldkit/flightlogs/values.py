"""Checks and conversions of the numbers in flight logs: anything may stand there."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.flightlogs.model import Attitude, Gimbal, Place, YawFrame
from fieldkit.geometry.geodesy import on_earth

_YAW_LOCK, _YAW_VEHICLE, _YAW_NORTH = 16, 32, 64
GPS_EPOCH_S = 315964800.0
"""1980-01-06, the zero of GPS time, in seconds since 1970."""
LEAP_SECONDS = 18.0
"""GPS time less UTC since 2017-01-01 (IERS Bulletin C)."""
_UTC_RANGE = (1.0e9, 4.2e9)
_BOOT_LIMIT_S = 4.4e6


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
