"""The demo's flight: the mission on a stand-in vehicle."""

from __future__ import annotations

from pathlib import Path

from fieldkit.link.upload import UploadReport, upload_mission
from fieldkit.link.vehicle import Vehicle
from fieldkit.missions.files.formats import read_mission
from fieldkit.runtime.shipped import shipped_folder

STANDING = "probe_items"
"""Recording in which the vehicle stays on the ground."""
_STANDS_AT_HOME_S = 45.0
"""Time from which on it has a position there, seconds."""
_SPEED = 8.0
"""Factor by which the recording is replayed faster."""


def upload_to_stand_in(mission: Path) -> UploadReport:
    """Upload a mission file, through MAVSDK over UDP on this machine, to the recorded vehicle's stand-in."""
    from fieldkit_sim.standin.recording import read_recording
    from fieldkit_sim.standin.replay import Replay

    read = read_mission(mission)
    recording = read_recording(shipped_folder("sim/sitl") / f"{STANDING}.tlog")
    replay = Replay(recording, speed=_SPEED, begin_s=_STANDS_AT_HOME_S, rate_hz=1.0)
    with replay, Vehicle(replay.url, connect_s=20.0) as vehicle:
        return upload_mission(vehicle, read.items, home=read.home, dialect=read.firmware)
