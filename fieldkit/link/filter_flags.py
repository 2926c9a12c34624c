"""What an ArduPilot's position filter says of itself in EKF_STATUS_REPORT."""

from __future__ import annotations

_NEEDED = 1 | 2 | 16 | 32
"""Attitude, horizontal velocity, absolute horizontal position, absolute height."""
_AGAINST = 128 | 1024
"""Constant position: no GPS; uninitialised."""


def uses_gps(flags: int) -> bool:
    """Whether the filter has a position of its own, without which ArduCopter refuses AUTO.

    In the recordings flags go from 167 to 831 within half a second of the text "EKF3 IMU0 is using GPS".
    """
    return flags & _NEEDED == _NEEDED and not flags & _AGAINST
