"""MAVLink mission items as values, and what every autopilot refuses of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import IntEnum

Params = tuple[float, float, float, float, float, float, float]

PLACE_DIGITS = 7
"""Decimals of degrees that reach an autopilot: MISSION_ITEM_INT has whole 1e-7°, 11 mm (MAVLink, mission protocol)."""


class Frame(IntEnum):
    """MAV_FRAME: what a positional item's coordinates are, or that an item has none (MAVLink common.xml)."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6
    GLOBAL_TERRAIN_ALT = 10
    GLOBAL_TERRAIN_ALT_INT = 11


_PLAIN = {
    int(Frame.GLOBAL_INT): int(Frame.GLOBAL),
    int(Frame.GLOBAL_RELATIVE_ALT_INT): int(Frame.GLOBAL_RELATIVE_ALT),
    int(Frame.GLOBAL_TERRAIN_ALT_INT): int(Frame.GLOBAL_TERRAIN_ALT),
}


class Command(IntEnum):
    """MAV_CMD: the commands that fieldkit writes or understands (MAVLink common.xml)."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TURNS = 18
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_LOITER_TO_ALT = 31
    NAV_ROI = 80
    NAV_SPLINE_WAYPOINT = 82
    NAV_VTOL_TAKEOFF = 84
    NAV_VTOL_LAND = 85
    NAV_DELAY = 93
    NAV_PAYLOAD_PLACE = 94
    CONDITION_DELAY = 112
    CONDITION_DISTANCE = 114
    CONDITION_YAW = 115
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_LAND_START = 189
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_NONE = 197
    DO_SET_ROI = 201
    DO_DIGICAM_CONFIGURE = 202
    DO_DIGICAM_CONTROL = 203
    DO_MOUNT_CONFIGURE = 204
    DO_MOUNT_CONTROL = 205
    DO_SET_CAM_TRIGG_DIST = 206
    DO_FENCE_ENABLE = 207
    NAV_SET_YAW_SPEED = 213
    DO_SET_CAM_TRIGG_INTERVAL = 214
    DO_SET_RESUME_REPEAT_DIST = 215
    SET_CAMERA_MODE = 530
    SET_CAMERA_ZOOM = 531
    SET_CAMERA_FOCUS = 532
    SET_CAMERA_SOURCE = 534
    JUMP_TAG = 600
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    DO_GIMBAL_MANAGER_CONFIGURE = 1001
    IMAGE_START_CAPTURE = 2000
    IMAGE_STOP_CAPTURE = 2001
    DO_TRIGGER_CONTROL = 2003
    VIDEO_STOP_CAPTURE = 2501


POSITIONAL = frozenset({
    Command.NAV_WAYPOINT, Command.NAV_LOITER_UNLIM, Command.NAV_LOITER_TURNS, Command.NAV_LOITER_TIME,
    Command.NAV_LAND, Command.NAV_TAKEOFF, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TO_ALT, Command.NAV_ROI,
    Command.NAV_VTOL_TAKEOFF, Command.NAV_VTOL_LAND, Command.NAV_PAYLOAD_PLACE, Command.DO_SET_HOME,
    Command.DO_LAND_START, Command.DO_SET_ROI_LOCATION, Command.DO_SET_ROI,
})  # fmt: skip
"""Commands whose params 5 to 7 are latitude, longitude and altitude."""


@dataclass(frozen=True)
class MissionItem:
    """One item of a mission, as MISSION_ITEM_INT and QGroundControl's SimpleItem have it."""

    command: int
    """MAV_CMD, also one that `Command` does not have."""
    frame: int
    """MAV_FRAME, also one that `Frame` does not have."""
    params: Params
    """Seven; of positional commands the last three are latitude and longitude in degrees and altitude in metres of
    ``frame``. NaN where a parameter is left to the autopilot (null in a .plan file)."""
    autocontinue: bool = True
    """Go on with the next item by itself."""
    station: int | None = None
    """Index of the photograph that the item belongs to in the mission it was rendered from; None otherwise. Files do
    not hold it."""

    @property
    def positional(self) -> bool:
        """Whether params 5 to 7 are a place."""
        return self.command in POSITIONAL

    @property
    def name(self) -> str:
        """Of its command, for people; its number where `Command` does not have it."""
        return command_name(self.command)


def command_name(command: int) -> str:
    """MAV_CMD's name without its prefix, or the number."""
    try:
        return Command(command).name
    except ValueError:
        from fieldkit.flightlogs.mavlink import mavlink  # takes a moment, and hardly any mission needs it

        entry = mavlink.enums["MAV_CMD"].get(command)
        return f"command {command}" if entry is None else str(entry.name).removeprefix("MAV_CMD_")


def with_jump_moved(item: MissionItem, by: int) -> MissionItem:
    """A jump that leads as many items farther on; any other item as it is."""
    if item.command != Command.DO_JUMP or not math.isfinite(item.params[0]):
        return item
    return replace(item, params=(item.params[0] + by, *item.params[1:]))


def plain_frame(frame: int) -> int:
    """The frame with the _INT ones as their plain ones: both say the same of an item."""
    return _PLAIN.get(frame, frame)
