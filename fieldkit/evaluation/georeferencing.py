"""Clouds of a georeferenced plot in UTM, as LAZ."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

from fieldkit.clouds import Cloud, write_cloud
from fieldkit.reconstruction.result import MetricFrame
from fieldkit.runtime.progress import Progress

COARSE_M = 0.3
"""Standard deviation of positions from which they do not say on which plot something lies."""


def to_utm(cloud: Cloud, frame: MetricFrame) -> tuple[Cloud, int]:
    """A cloud of the plot frame in WGS 84 / UTM, and the zone's EPSG code.

    Heights keep the datum of the frame's origin. Normals are turned by the plot frame's rotation only; the meridian
    convergence (under 3° within a zone) is left out of them.
    """
    from pyproj import Transformer

    if frame.origin is None:
        raise ValueError("the frame is not georeferenced")
    epsg = frame.origin.utm_epsg()
    in_source = cloud.transformed(frame.plot_from_source.inverse())
    latitude, longitude, altitude = frame.origin.to_geodetic(in_source.points)
    easting, northing = Transformer.from_crs(4326, epsg, always_xy=True).transform(longitude, latitude)
    return Cloud(np.stack([easting, northing, altitude], axis=1), in_source.colors, in_source.normals), epsg


def write_georeferenced(path: Path, cloud: Cloud, frame: MetricFrame, progress: Progress) -> bool:
    """Write a cloud as LAZ in its UTM zone where it has one; returns whether it did."""
    if frame.origin is None or len(cloud) == 0:
        return False
    if any(importlib.util.find_spec(name) is None for name in ("laspy", "lazrs", "pyproj")):
        progress.note(f"{path.name} is not written: install the extra, pip install 'fieldkit[geo]'")
        return False
    try:
        moved, epsg = to_utm(cloud, frame)
    except ValueError as error:  # UTM ends at 84° north and 80° south
        progress.note(f"{path.name} is not written: {error}")
        return False
    write_cloud(path, moved, crs_epsg=epsg)
    return True
