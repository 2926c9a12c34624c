"""How far the photographs of a flight were taken from where they were planned."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.geometry.stations import PoseArray, associate
from fieldkit.results.evaluation import StationErrorEntry
from fieldkit.results.fields import Vector, finite

PoseRow = tuple[Vector, float | None, float | None]
"""Position, metres, NaN where not known; yaw, clockwise from +y, and pitch in degrees, None where not known."""
Poses = Mapping[str, PoseRow]
"""By photograph, or by station."""


def assigned(stations: Poses, photographs: Poses, offset_m: FloatArray | None = None) -> dict[str, str]:
    """The station of each photograph that belongs to one, by name; ``offset_m`` as of `associate`."""
    names, station_names = list(photographs), list(stations)
    pairs = associate(
        PoseArray.of(list(photographs.values())), PoseArray.of(list(stations.values())), offset_m=offset_m
    )
    return {names[a]: station_names[b] for a, b in pairs.station_of.items()}


def station_errors(
    stations: Poses, photographs: Poses, station_of: Mapping[str, str], axes: FloatArray | None = None
) -> list[StationErrorEntry]:
    """Achieved less planned, in the order of the stations.

    Args:
        stations: planned poses, by name.
        photographs: achieved poses, by name; those that are not in it have no error.
        station_of: station of each photograph.
        axes: (3, 3) rows are east, north and up in the poses' frame; None where these are its axes.
    """
    taken = {station: name for name, station in station_of.items() if name in photographs}
    errors = []
    for station, (planned, yaw, pitch) in stations.items():
        if station not in taken:
            continue
        name = taken[station]
        position, taken_yaw, taken_pitch = photographs[name]
        apart = np.subtract(position, planned)
        east, north, up = apart if axes is None else axes @ apart
        errors.append(
            StationErrorEntry(
                station=station,
                image=name,
                east_m=float(east),
                north_m=float(north),
                up_m=finite(up),
                yaw_deg=None if taken_yaw is None or yaw is None else finite(wrapped_deg(taken_yaw - yaw)),
                pitch_deg=None if taken_pitch is None or pitch is None else finite(taken_pitch - pitch),
            )
        )
    return errors
