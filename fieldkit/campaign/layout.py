"""Plots side by side, and what a plan photographs on each: how well a geotagged photograph fits each plot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from fieldkit.arrays import FloatArray
from fieldkit.campaign.reading import CampaignPlot
from fieldkit.captures.heights import GPS_ACCURACY_M, RTK_ACCURACY_M
from fieldkit.captures.model import Photo
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.results.plan import Plan

_LEAST_PITCH_DEG = 15.0  # flatter, and where the axis meets the ground is not known


@dataclass(frozen=True, eq=False)
class FieldLayout:
    """All plots in metres east and north of their middle."""

    frame: LocalFrame
    """Of these metres."""
    aims: FloatArray
    """(p, s, 2) places that the stations look at."""
    stations: FloatArray
    """(p, s, 2) places of the stations."""
    spacing: FloatArray
    """(p, p) distances between the plots' middles, infinite on the diagonal."""
    shapes: NDArray[np.object_]
    """(p,) polygons; empty where a plot is a point."""
    height: float
    """Of a camera above what it looks at."""
    most_reach: float
    """Horizontal distance from a camera to that, at most."""

    @classmethod
    def of(cls, plots: Sequence[CampaignPlot], plan: Plan) -> FieldLayout:
        latitude = np.array([plot.latitude_deg for plot in plots])
        longitude = np.array([plot.longitude_deg for plot in plots])
        around = longitude[0] + float(np.mean((longitude - longitude[0] + 180.0) % 360.0 - 180.0))
        frame = LocalFrame(float(latitude.mean()), float((around + 180.0) % 360.0 - 180.0))
        middles = frame.to_local(latitude, longitude, 0.0)[:, :2]
        poses = [station.pose for station in plan.stations]
        centers = np.array([pose.center for pose in poses])
        region = region_of_interest(poses)
        level = 0.0 if region is None else region.center[2]
        height = float(np.median(centers[:, 2])) - level
        height = height if height > 0.1 else max(float(np.median(centers[:, 2])), 0.1)
        away = 0.0 if region is None else float(np.hypot(*(centers[:, :2] - np.array(region.center[:2])).T).max())
        most = 1.5 * max(away, height)
        yaws = np.array([station.yaw_deg for station in plan.stations])
        pitches = np.array([station.pitch_deg for station in plan.stations])
        aims = centers[:, :2] + _reach(height, pitches, most)[:, None] * _direction(yaws)
        turned = [_turn(plot.row_heading_deg) for plot in plots]
        spacing = np.linalg.norm(middles[:, None] - middles[None], axis=2)
        np.fill_diagonal(spacing, np.inf)
        return cls(
            frame,
            np.array([middle + aims @ turn.T for middle, turn in zip(middles, turned, strict=True)]),
            np.array([middle + centers[:, :2] @ turn.T for middle, turn in zip(middles, turned, strict=True)]),
            spacing,
            np.array([_polygon(plot, frame) for plot in plots], dtype=object),
            height,
            most,
        )

    def distances(self, photo: Photo) -> FloatArray:
        """(p,) how far a geotagged photograph is from what each plot's plan asks for, metres."""
        tag = photo.geotag
        assert tag is not None
        here = self.frame.to_local(tag.latitude_deg, tag.longitude_deg, 0.0)[0, :2]
        if photo.yaw_deg is None or photo.pitch_deg is None or photo.pitch_deg > -_LEAST_PITCH_DEG:
            return np.asarray(np.linalg.norm(self.stations - here, axis=2).min(axis=1))
        reach = _reach(self.height, np.array([photo.pitch_deg]), self.most_reach)
        aim = here + reach[0] * _direction(np.array([photo.yaw_deg]))[0]
        away = np.linalg.norm(self.aims - aim, axis=2).min(axis=1)
        inside = shapely.distance(self.shapes, shapely.Point(aim))  # NaN for an empty polygon
        return np.asarray(np.fmin(away, inside))


def tag_accuracy_m(photo: Photo) -> float:
    """Standard deviation of a geotagged photograph's horizontal position."""
    tag = photo.geotag
    assert tag is not None
    if tag.horizontal_accuracy_m is not None:
        return max(tag.horizontal_accuracy_m, RTK_ACCURACY_M)
    return RTK_ACCURACY_M if tag.rtk else GPS_ACCURACY_M


def _polygon(plot: CampaignPlot, frame: LocalFrame) -> shapely.Polygon:
    if plot.shape is None:
        return shapely.Polygon()
    ring = np.array(plot.shape)
    return shapely.Polygon(frame.to_local(ring[:, 0], ring[:, 1], 0.0)[:, :2])


def _turn(row_heading_deg: float) -> FloatArray:
    """(2, 2): east and north of the plot frame's x and y."""
    heading = np.radians(row_heading_deg)
    s, c = float(np.sin(heading)), float(np.cos(heading))
    return np.array([[s, -c], [c, s]])


def _direction(yaw_deg: FloatArray) -> FloatArray:
    """(n, 2) unit vectors of headings clockwise from the second axis."""
    yaw = np.radians(yaw_deg)
    return np.stack([np.sin(yaw), np.cos(yaw)], axis=1)


def _reach(height: float, pitch_deg: FloatArray, most: float) -> FloatArray:
    """(n,) horizontal distance from the camera to what it looks at, ``height`` below it, ``most`` at most."""
    slope = np.tan(np.radians(np.clip(-pitch_deg, _LEAST_PITCH_DEG, 90.0)))
    return np.minimum(height / slope, most)
