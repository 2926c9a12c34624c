"""Flight logs: where the vehicle was and where its camera looked at every trigger, as the autopilot estimated it."""

from fieldkit.flightlogs.achieved import AchievedPose, FixedMount, achieved_pose
from fieldkit.flightlogs.matching import Matches, Stamp, match, match_log
from fieldkit.flightlogs.model import Attitude, FlightLog, Gimbal, Place, Series, Track, Trigger
from fieldkit.flightlogs.reading import read_flight_log

__all__ = [
    "AchievedPose",
    "Attitude",
    "FixedMount",
    "FlightLog",
    "Gimbal",
    "Matches",
    "Place",
    "Series",
    "Stamp",
    "Track",
    "Trigger",
    "achieved_pose",
    "match",
    "match_log",
    "read_flight_log",
]
