"""Where a mission file told the autopilot to take its photographs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fieldkit.evaluation.pose_table import Poses, pose_array, pose_entry
from fieldkit.geometry import Pose
from fieldkit.geometry.priors import SourceFrame
from fieldkit.geometry.stations import associate
from fieldkit.missions.autopilots.execution import Execution
from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.files.reading import read_mission
from fieldkit.results.evaluation import PoseEntry
from fieldkit.vehicles.vehicle_file import load_vehicle


@dataclass(frozen=True, eq=False)
class FlownMission:
    """A mission as its autopilot carries it out.

    Attributes:
        execution: its photographs, heights above home.
        home_amsl_m: home above mean sea level; None where the file does not say.
    """

    execution: Execution
    home_amsl_m: float | None

    @classmethod
    def read(cls, mission: Path, vehicle: str) -> FlownMission:
        """Read a mission file and carry it out.

        Args:
            mission: .plan, .waypoints, .kmz (DJI WPML) or Litchi .csv.
            vehicle: profile's name or file.

        Raises:
            MetadataError: one of them cannot be used.
        """
        flown_by = load_vehicle(vehicle)
        read = read_mission(mission)
        dialect = flown_by.dialect if flown_by.dialect != "dji" else read.firmware or "ardupilot"
        home = None if read.home is None else read.home.amsl_m
        return cls(interpret(read, flown_by, dialect), home)

    def by_station(
        self, stations: Poses, frame: SourceFrame, home_amsl_m: float | None
    ) -> tuple[dict[str, PoseEntry], str]:
        """Commanded poses of a plot's stations in the plot frame, and why there are none ("" where there are).

        Args:
            stations: the plan's, by name, plot frame.
            frame: the plot's.
            home_amsl_m: home above mean sea level by the flight log; the file's own where None.
        """
        if self.execution.refused:
            return {}, self.execution.refused[0][1]
        origin = frame.origin
        if origin is None:
            return {}, "the plot is not georeferenced, so the mission's positions have no place in it"
        home = self.home_amsl_m if home_amsl_m is None else home_amsl_m
        if home is None:
            return {}, "neither the mission nor a log says how high home is"
        if origin.datum == "ellipsoid":
            return {}, "the mission's heights are above sea level, the plot's above the ellipsoid"
        turn = frame.from_source.rotation
        entries = []
        for shot in self.execution.photographs:
            if shot.never or shot.place is None or not math.isfinite(shot.place.height_m):
                continue
            place = shot.place
            (local,) = origin.to_local(place.latitude_deg, place.longitude_deg, home + place.height_m)
            position = frame.from_source.apply(local)
            camera = Pose.from_yaw_pitch(np.zeros(3), shot.heading_deg or 0.0, shot.pitch_deg or 0.0)
            entry = pose_entry(position, camera.rotation @ turn.T)
            known = {
                "yaw_deg": None if shot.heading_deg is None else entry.yaw_deg,
                "pitch_deg": None if shot.pitch_deg is None else entry.pitch_deg,
            }
            entries.append(entry.model_copy(update=known))
        names = list(stations)
        pairs = associate(pose_array(entries), pose_array(stations.values())).station_of
        if not pairs:
            return {}, "the mission takes no photograph near the plan's stations"
        return {names[b]: entries[a] for a, b in pairs.items()}, ""
