"""Placing a plan on a site: from the plot frame to WGS 84, and the frame that a flight is planned in.

Heights. Autopilots count heights from home along the plumb line, so every height here is "above home": the difference
of ellipsoidal heights. Two frames follow from that:

- `PlotFrame` is the plan's: east-north-up at the plot's origin on its ground, turned so that x points along the row. It
  touches the ellipsoid there and not at home, so that a plot 1 km from home is not put 8 cm (d²/2R) too low, and a
  station z metres above the fitted ground is z metres above it wherever the plot lies. Stations keep their places
  to each other and to the plants exactly.
- `SiteFrame` is the flight's: metres east and north of home, in the plane that touches the ellipsoid there, and the
  height above home, which is not the third coordinate of that plane.

Horizontal scale grows with height by 1.6·10⁻⁷ per metre. Where home says its height above the ellipsoid all is exact;
the height above sea level, taken in its place, is off by up to 110 m: 2 mm over 100 m, nothing over a plot.

Slopes. Where a plot's ground rises by g along x and h along y, everything of the plan is sheared upright: a point at
(x, y, z) comes to (x, y, z + g·x + h·y). Plants on a slope grow upright and stand on it, so this is where they are, and
a station keeps its place in the plan, its height above the ground below it, and its heading. The optical axis is
sheared alike: the pitch turns by at most the slope's angle, and the camera looks at the same place of the same plant.
Turning the rig as one piece with the ground would lay it over to one side of upright plants, and take a roll that
gimbals do not have. docs/vehicles-and-sites.md says what each way scores.

Headings. A plan's yaw is measured clockwise from the plot frame's y axis; ``row_heading_deg`` of the site's plot is the
compass heading of its x axis, and is all that turns it. The plan's own ``row_heading_deg`` says how the plot lay that
the plan was made on, so it is not added: to fly that plot again, its site file says the same heading.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray
from fieldkit.geometry.geodesy import LocalFrame, east_north_up, plot_from_enu
from fieldkit.results.mission import Home, MissionOutline
from fieldkit.results.plan import Plan, Plans, plan_on
from fieldkit.routing.flights import Stop
from fieldkit.routing.legs import Place
from fieldkit.routing.mission import GeoPoint, Shot
from fieldkit.sites.site import LEVEL, Gradient, Site, SitePlot
from fieldkit.vehicles.vehicle import Vehicle

_NEAR_PLOT_M = 25.0
"""Distance from every plot beyond which the ground is home's, metres."""

Geodetic = tuple[FloatArray, FloatArray, FloatArray]
"""Latitudes and longitudes (degrees, WGS 84) and heights (metres above home), (n,) each."""


@dataclass(frozen=True)
class SiteFrame:
    """Metres east and north of home, and above home."""

    home: Home

    def to_local(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike, height_m: ArrayLike) -> FloatArray:
        """Degrees, degrees and metres above home, scalars or (n,), to (n, 3) metres east, north and above home."""
        height = np.atleast_1d(np.asarray(height_m, dtype=np.float64))
        local = self._tangent.to_local(latitude_deg, longitude_deg, self._tangent.altitude_m + height)
        local[:, 2] = height
        return local

    def to_geodetic(self, points: ArrayLike) -> Geodetic:
        """(n, 3) or (3,) metres east, north and above home to latitudes, longitudes and heights above home."""
        local = np.atleast_2d(np.array(points, dtype=np.float64))
        height = local[:, 2].copy()
        # Each round leaves the share 1 − cos(d/R) of the error: 1e-4 of it at 100 km.
        for _ in range(4):
            latitude, longitude, altitude = self._tangent.to_geodetic(local)
            local[:, 2] += self._tangent.altitude_m + height - altitude
        return latitude, longitude, height

    def points(self, places: Iterable[GeoPoint]) -> FloatArray:
        """(n, 3) of places."""
        rows = [(place.latitude_deg, place.longitude_deg, place.height_m) for place in places]
        table = np.array(rows, dtype=np.float64).reshape(-1, 3)
        return self.to_local(table[:, 0], table[:, 1], table[:, 2])

    def places(self, points: ArrayLike) -> tuple[GeoPoint, ...]:
        """The same as places."""
        return _geo_points(self.to_geodetic(points))

    def outline(self, corners: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        """Corners (latitude, longitude) as (east, north), at home's height."""
        ring = np.array(corners, dtype=np.float64).reshape(-1, 2)
        return tuple((float(x), float(y)) for x, y, _ in self.to_local(ring[:, 0], ring[:, 1], np.zeros(len(ring))))

    @cached_property
    def _tangent(self) -> LocalFrame:
        return LocalFrame(self.home.latitude_deg, self.home.longitude_deg, _altitude(self.home))


@dataclass(frozen=True)
class PlotFrame:
    """A plan's frame on one plot: x along the row, y to its left, z above the plot's ground."""

    tangent: LocalFrame
    """East-north-up at the origin."""
    ground_m: float
    """Height of the origin above home."""
    row_heading_deg: float
    """Compass heading of x."""
    gradient: Gradient = LEVEL
    """Rise of the ground per metre along x and y."""

    @classmethod
    def of(cls, site: Site, plot: SitePlot) -> PlotFrame:
        """The frame of a site's plot."""
        ground = site.ground_m(plot)
        tangent = LocalFrame(plot.latitude_deg, plot.longitude_deg, _altitude(site.home) + ground)
        return cls(tangent, ground, plot.row_heading_deg, plot.gradient)

    @classmethod
    def recorded(cls, plot: MissionOutline) -> PlotFrame:
        """The frame of a plot of mission.json."""
        return cls(plot.origin, plot.ground_m, plot.row_heading_deg, plot.gradient)

    def to_geodetic(self, points: ArrayLike) -> Geodetic:
        """(n, 3) or (3,) metres of the plot frame to latitudes, longitudes and heights above home."""
        plot = self.upright(points)
        latitude, longitude, altitude = self.tangent.to_geodetic(plot @ self._enu_from_plot.T)
        return latitude, longitude, altitude - self.tangent.altitude_m + self.ground_m

    def to_plot(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike, height_m: ArrayLike) -> FloatArray:
        """Degrees, degrees and metres above home, scalars or (n,), to (n, 3) metres of the plot frame."""
        altitude = np.asarray(height_m, dtype=np.float64) - self.ground_m + self.tangent.altitude_m
        plot = self.tangent.to_local(latitude_deg, longitude_deg, altitude) @ self._enu_from_plot
        if self.gradient != LEVEL:
            plot[:, 2] -= self.rise_m(plot)
        return plot

    def rise_m(self, points: ArrayLike) -> FloatArray:
        """(n,) height of the ground below points (n, 3) or (n, 2) above that at the origin; 0 on a level plot."""
        plot = np.atleast_2d(np.asarray(points, dtype=np.float64))
        rise: FloatArray = self.gradient[0] * plot[:, 0] + self.gradient[1] * plot[:, 1]
        return rise

    def upright(self, points: ArrayLike) -> FloatArray:
        """(n, 3) points (n, 3) or (3,) of the plot frame with z above the ground at the origin."""
        plot = np.atleast_2d(np.asarray(points, dtype=np.float64))
        if self.gradient == LEVEL:
            return plot
        return np.column_stack([plot[:, :2], plot[:, 2] + self.rise_m(plot)])

    @property
    def level(self) -> PlotFrame:
        """The frame with z above the ground at the origin, in which what `upright` gives is put on Earth."""
        return replace(self, gradient=LEVEL)

    def pitches(self, yaw_deg: ArrayLike, pitch_deg: ArrayLike) -> FloatArray:
        """(n,) pitches on the slope of cameras with yaws and pitches in the plot frame; as they are on a level plot."""
        return self._pitches(yaw_deg, pitch_deg, 1.0)

    def planned_pitches(self, yaw_deg: ArrayLike, pitch_deg: ArrayLike) -> FloatArray:
        """(n,) pitches in the plot frame of cameras with yaws there and pitches on the slope: reverse of `pitches`."""
        return self._pitches(yaw_deg, pitch_deg, -1.0)

    def _pitches(self, yaw_deg: ArrayLike, pitch_deg: ArrayLike, sign: float) -> FloatArray:
        pitch = np.atleast_1d(np.asarray(pitch_deg, dtype=np.float64))
        if self.gradient == LEVEL:
            return pitch
        yaw, down = np.radians(np.atleast_1d(np.asarray(yaw_deg, dtype=np.float64))), np.radians(pitch)
        ahead = np.sin(yaw) * self.gradient[0] + np.cos(yaw) * self.gradient[1]
        turned: FloatArray = np.degrees(np.arctan2(np.sin(down) + sign * ahead * np.cos(down), np.cos(down)))
        return turned

    def headings(self, points: ArrayLike, yaw_deg: ArrayLike) -> FloatArray:
        """(n,) true headings, in [0, 360), of yaws in the plot frame at places in it, (n, 3).

        True north is that of each place: near the poles it differs within a plot.
        """
        latitude, longitude, _ = self.to_geodetic(points)
        angle = np.radians(np.atleast_1d(np.asarray(yaw_deg, dtype=np.float64)) + self.row_heading_deg - 90.0)
        forward = np.stack([np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=1) @ self.tangent.rotation()
        east, north, _ = east_north_up(latitude, longitude).swapaxes(1, 2)
        return _compass(np.sum(forward * east, axis=1), np.sum(forward * north, axis=1))

    def yaws(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike, heading_deg: ArrayLike) -> FloatArray:
        """(n,) yaws in the plot frame, in [0, 360), of true headings at places: the reverse of `headings`."""
        east, north, _ = east_north_up(np.atleast_1d(latitude_deg), np.atleast_1d(longitude_deg)).swapaxes(1, 2)
        angle = np.radians(np.atleast_1d(np.asarray(heading_deg, dtype=np.float64)))[:, None]
        local = (np.sin(angle) * east + np.cos(angle) * north) @ self.tangent.rotation().T
        return _positive(_compass(local[:, 0], local[:, 1]) - self.row_heading_deg + 90.0)

    @property
    def _enu_from_plot(self) -> FloatArray:
        return plot_from_enu(self.row_heading_deg).T


def place(plans: Plans, site: Site) -> tuple[Shot, ...]:
    """The stations of a plan, or of each plot's own, on all plots of a site, in the plots' order.

    On a level plot pitch is kept: within a plot the plumb line turns by less than 10⁻⁵ degrees a metre. On a slope it
    turns so that the camera looks at the same place of the ground, see above.
    """
    shots: list[Shot] = []
    for plot in site.plots:
        shots += _on_plot(plan_on(plans, plot.name), plot.name, PlotFrame.of(site, plot))
    return tuple(shots)


def _on_plot(plan: Plan, name: str, frame: PlotFrame) -> list[Shot]:
    positions = np.array([station.position_m for station in plan.stations], dtype=np.float64)
    yaws = [station.yaw_deg for station in plan.stations]
    places = _geo_points(frame.to_geodetic(positions))
    headings = frame.headings(positions, yaws).tolist()
    pitches = frame.pitches(yaws, [station.pitch_deg for station in plan.stations]).tolist()
    return [
        Shot.at(where, heading, pitch, name, index)
        for index, (where, heading, pitch) in enumerate(zip(places, headings, pitches, strict=True))
    ]


def stops_of(shots: Sequence[Shot], site: Site, vehicle: Vehicle) -> tuple[Stop, ...]:
    """Where a vehicle stands still for photographs, site frame."""
    pause_s = vehicle.trigger.settle_s + vehicle.trigger.exposure_s
    points = SiteFrame(site.home).points(shot.place for shot in shots).tolist()
    return tuple(
        Stop((x, y, z), shot.yaw_deg, pause_s, shot.plot, shot.station)
        for (x, y, z), shot in zip(points, shots, strict=True)
    )


def landing_of(site: Site) -> Place:
    """Where flights end, on the ground, site frame."""
    if site.landing is None:
        return (0.0, 0.0, 0.0)
    east, north, _ = SiteFrame(site.home).to_local(site.landing.latitude_deg, site.landing.longitude_deg, 0.0)[0]
    return (float(east), float(north), 0.0)


def grounds_m(site: Site, shots: Sequence[Shot]) -> FloatArray:
    """(n,) heights above home of the ground below photographs."""
    frames = {plot.name: PlotFrame.of(site, plot) for plot in site.plots}
    found = np.array([frames[shot.plot].ground_m for shot in shots], dtype=np.float64)
    for name, frame in frames.items():
        rows = [k for k, shot in enumerate(shots) if shot.plot == name] if frame.gradient != LEVEL else []
        if rows:
            places = [shots[k].place for k in rows]
            table = np.array([(p.latitude_deg, p.longitude_deg, p.height_m) for p in places])
            found[rows] += frame.rise_m(frame.to_plot(table[:, 0], table[:, 1], table[:, 2]))
    return found


def ground_below(site: Site, places: Sequence[GeoPoint]) -> FloatArray:
    """(n,) heights above home of the ground below places: the nearest plot's, home's own farther than 25 m from all."""
    table = np.array([(p.latitude_deg, p.longitude_deg, p.height_m) for p in places]).reshape(-1, 3)
    found, least = np.zeros(len(table)), np.full(len(table), _NEAR_PLOT_M)
    for frame in (PlotFrame.of(site, plot) for plot in site.all_plots):
        local = frame.to_plot(*np.nan_to_num(table).T)
        away = np.hypot(local[:, 0], local[:, 1])
        found = np.where(away < least, frame.ground_m + frame.rise_m(local), found)
        least = np.minimum(least, away)
    return found


def _altitude(home: Home) -> float:
    """Home's height above the ellipsoid, as well as it is known."""
    return next((height for height in (home.ellipsoid_m, home.amsl_m) if height is not None), 0.0)


def _geo_points(geodetic: Geodetic) -> tuple[GeoPoint, ...]:
    return tuple(GeoPoint(float(a), float(b), float(c)) for a, b, c in zip(*geodetic, strict=True))


def _compass(east: FloatArray, north: FloatArray) -> FloatArray:
    return _positive(np.degrees(np.arctan2(east, north)))


def _positive(degrees: FloatArray) -> FloatArray:
    """In [0, 360); a hair below 0 becomes 360 when it is rounded, hence the second remainder."""
    turned: FloatArray = degrees % 360.0 % 360.0
    return turned
