"""How a reconstruction lies: its frame, ground, volume and cameras. Lengths are metres where it has a scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from pydantic import PositiveInt
from pydantic.dataclasses import dataclass

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Intrinsics, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.priors import SourceFrame
from fieldkit.results.fields import STRICT, Count, Length, Share, Strict, Text, Vector, vector

Row = tuple[float, float, float, float]


@dataclass(frozen=True, config=STRICT)
class Plane:
    """A plane normal · x = offset_m with how well it fits: the ground, in the plot frame."""

    normal: Vector
    """Unit vector towards the cameras."""
    offset_m: float
    rms_m: Length
    """Of the inliers' distances."""
    inlier_share: Share
    """Of the points it was fitted to, those within ``tolerance_m``."""
    tolerance_m: Length
    """Up to which a point counts as ground."""

    def heights(self, points: ArrayLike) -> FloatArray:
        """Signed heights (n,) of points (n, 3) above the plane, metres."""
        heights: FloatArray = np.asarray(points, dtype=np.float64) @ self.normal - self.offset_m
        return heights

    def above(self, places: FloatArray, height: float = 0.0) -> FloatArray:
        """Points (n, 3) that high above the plane at places (n, 2)."""
        z = (self.offset_m + height - places @ self.normal[:2]) / self.normal[2]
        return np.column_stack([places, z])

    def tilt_deg(self) -> float:
        """Angle between the normal and the z axis, degrees."""
        return float(np.degrees(np.arctan2(np.hypot(self.normal[0], self.normal[1]), self.normal[2])))

    def moved(self, motion: Similarity) -> Plane:
        """The same plane after a rigid motion."""
        normal = motion.rotation @ self.normal
        offset_m = self.offset_m + float(normal @ motion.translation)
        return replace(self, normal=vector(normal), offset_m=offset_m)

    def levelling(self, origin: ArrayLike | None = None) -> Similarity:
        """The rigid transform that turns the normal to +z by the shortest way and puts the plane at z = 0.

        ``origin`` (3,) is a point whose foot on the plane becomes (0, 0, 0); without it x and y move only by the turn.
        """
        x, y, z = self.normal
        if z > -1.0 + 1e-12:
            # Rodrigues' formula with the axis normal × z, free of angles.
            cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
            rotation = np.eye(3) + cross + cross @ cross / (1.0 + z)
        else:
            rotation = np.diag([1.0, -1.0, -1.0])
        shift = np.array([0.0, 0.0, -self.offset_m])
        if origin is not None:
            shift[:2] = -(rotation @ np.asarray(origin, dtype=np.float64))[:2]
        return Similarity(1.0, rotation, shift)


class FrameEntry(Strict):
    """How the plot frame lies in the frame of the metric source."""

    plot_from_source: tuple[Row, Row, Row, Row]
    """Rigid motion, rows of a homogeneous matrix: plot point = matrix · source point, metres."""
    origin: LocalFrame | None
    """Of the source frame (axes east, north, up; WGS 84); null where it is not georeferenced."""
    crs_epsg: int | None
    """UTM zone (WGS 84) of the origin."""
    ground: Plane | None
    notes: tuple[Text, ...]
    """Doubts about scale and place."""
    ground_sigma_m: Length = 0.0
    """Standard deviation of the ground's height below the plot, beyond that of soil in plain view."""

    def of_source(self, metric_source: str) -> SourceFrame:
        """The frame as a reconstruction works in it; ``metric_source`` is that of the same report."""
        return SourceFrame(metric_source, self.origin, Similarity.from_matrix(np.array(self.plot_from_source)))

    def about(self, place: LocalFrame, points: FloatArray) -> FloatArray:
        """Points (n, 3) of the plot frame, which has a place on Earth, in the frame about another place."""
        assert self.origin is not None
        return place.to_local(*self.origin.to_geodetic(self.of_source("").from_source.inverse().apply(points)))


class VolumeEntry(Strict):
    """The volume of interest, an axis-aligned box in the plot frame."""

    lower_m: Vector
    upper_m: Vector


class CameraReport(Strict):
    """A camera with its intrinsics after bundle adjustment."""

    key: Text
    """Made from make, model, serial number, focal length and size."""
    model: str
    """COLMAP's camera model."""
    width: PositiveInt
    height: PositiveInt
    params: tuple[float, ...]
    """In COLMAP's order; pixels where they are lengths."""
    source: str
    """Where the start values came from: camera.toml, camera.json, EXIF or self-calibrated."""
    photos: Count
    """Registered photographs it took."""

    @property
    def intrinsics(self) -> Intrinsics:
        """Model, size and parameters."""
        return Intrinsics(self.model, self.width, self.height, self.params)
