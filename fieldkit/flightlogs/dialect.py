"""pymavlink's message definitions: MAVLink 2, ArduPilot's dialect (it contains common.xml).

The one place that imports them. pymavlink reads MAVLINK20 when mavutil is imported; without it, mavutil speaks
MAVLink 1 whatever dialect is asked for.
"""

from __future__ import annotations

import os

os.environ["MAVLINK20"] = "1"

from pymavlink.dialects.v20 import ardupilotmega as mavlink  # after the variable, see above

__all__ = ["mavlink"]
