"""The demo's flight: the mission on a stand-in vehicle, and how exactly the recorded vehicle flew."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.evaluation.adherence import pose_noise
from fieldkit.flightlogs import read_flight_log
from fieldkit.flightlogs.adherence import PlannedPose, adherence
from fieldkit.link.upload import UploadReport, upload_mission
from fieldkit.link.vehicle import Vehicle
from fieldkit.missions.files.formats import read_mission
from fieldkit.runtime.shipped import shipped_folder

FLOWN = "mount_then_yaw"
STANDING = "probe_items"
"""Recording in which the vehicle stays on the ground."""
_STANDS_AT_HOME_S = 45.0
"""Time from which on it has a position there, seconds."""
_SPEED = 8.0
"""Factor by which the recording is replayed faster."""


@dataclass(frozen=True)
class RecordedFlight:
    """How a recorded flight kept to its plan."""

    photographs: int
    """That belong to a planned pose."""
    position_m: float
    """Standard deviation of a coordinate, about the mean error."""
    angle_deg: float
    """Root mean square of yaw and pitch errors."""


def upload_to_stand_in(mission: Path) -> UploadReport:
    """Upload a mission file, through MAVSDK over UDP on this machine, to the recorded vehicle's stand-in."""
    from fieldkit_sim.standin.recording import read_recording
    from fieldkit_sim.standin.replay import Replay

    read = read_mission(mission)
    recording = read_recording(shipped_folder("sim/sitl") / f"{STANDING}.tlog")
    replay = Replay(recording, speed=_SPEED, begin_s=_STANDS_AT_HOME_S, rate_hz=1.0)
    with replay, Vehicle(replay.url, connect_s=20.0) as vehicle:
        return upload_mission(vehicle, read.items, home=read.home, dialect=read.firmware)


def recorded_flight() -> RecordedFlight:
    """How the recorded flight kept to its plan, by its log."""
    folder = shipped_folder("sim/sitl")
    log = read_flight_log(folder / f"{FLOWN}.tlog")
    names = [f"photograph {k}" for k in range(len(log.triggers))]
    kept = adherence(_stations(folder / f"{FLOWN}.json"), log.triggers, names)
    position, angle = pose_noise([kept])
    if position is None or angle is None:
        raise MetadataError("the recording that belongs to fieldkit is damaged", path=folder / f"{FLOWN}.tlog")
    return RecordedFlight(len(kept.stations), round(position, 4), round(angle, 3))


def _stations(path: Path) -> list[PlannedPose]:
    try:
        rows = json.loads(path.read_text("utf-8"))["stations"]
        return [
            PlannedPose(f"station {s['i'] + 1}", s["lat"] * 1e-7, s["lon"] * 1e-7, s["h"], s["yaw"], s["pitch"])
            for s in rows
        ]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise MetadataError("the recording that belongs to fieldkit is damaged", path=path) from error
