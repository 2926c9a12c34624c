"""WGS 84 coordinates and local east-north-up frames, exact on the ellipsoid.

Geodetic ⇄ earth-centred (ECEF) ⇄ local east-north-up, without a map projection. One frame serves a whole
capture: metres from a cos(latitude) taken anew at each point are not a frame and are wrong by metres over a field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray

SEMI_MAJOR_M = 6378137.0
"""Semi-major axis of the WGS 84 ellipsoid (NGA.STND.0036, EPSG:7030), metres."""
FLATTENING = 1.0 / 298.257223563
"""Flattening of the WGS 84 ellipsoid."""

_MEAN_RADIUS_M = 6_371_000.0
"""Mean radius of the Earth, metres."""
_SEMI_MINOR_M = SEMI_MAJOR_M * (1.0 - FLATTENING)
_E2 = FLATTENING * (2.0 - FLATTENING)
_EP2 = _E2 / (1.0 - _E2)

EAST_DEG = 90.0
"""Compass heading of east."""
DATUMS = ("ellipsoid", "sea level", "unknown")
"""What an altitude is measured from."""


def plot_from_enu(row_heading_deg: float) -> FloatArray:
    """(3, 3) turn from east-north-up to a plot's axes: x along the rows' compass heading, y to its left, z up."""
    heading = np.radians(row_heading_deg)
    s, c = float(np.sin(heading)), float(np.cos(heading))
    return np.array([[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]])


def geodetic_to_ecef(latitude_deg: ArrayLike, longitude_deg: ArrayLike, altitude_m: ArrayLike) -> FloatArray:
    """WGS 84 latitude, longitude (degrees) and height above the ellipsoid (metres) to ECEF (n, 3) metres."""
    lat = np.radians(np.atleast_1d(np.asarray(latitude_deg, dtype=np.float64)))
    lon = np.radians(np.atleast_1d(np.asarray(longitude_deg, dtype=np.float64)))
    height = np.atleast_1d(np.asarray(altitude_m, dtype=np.float64))
    normal = SEMI_MAJOR_M / np.sqrt(1.0 - _E2 * np.sin(lat) ** 2)
    horizontal = (normal + height) * np.cos(lat)
    return np.stack(
        np.broadcast_arrays(
            horizontal * np.cos(lon), horizontal * np.sin(lon), (normal * (1.0 - _E2) + height) * np.sin(lat)
        ),
        axis=1,
    )


def on_earth(latitude_deg: float, longitude_deg: float) -> bool:
    """Whether two numbers are a latitude within ±90° and a longitude within ±180°."""
    return abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0


def great_circle_m(
    latitude_deg: ArrayLike, longitude_deg: ArrayLike, from_latitude_deg: float, from_longitude_deg: float
) -> FloatArray:
    """Distances (n,) metres from a place along the ground, good to half a percent however far."""
    ends = geodetic_to_ecef(latitude_deg, longitude_deg, 0.0)
    chords = np.linalg.norm(ends - geodetic_to_ecef(from_latitude_deg, from_longitude_deg, 0.0), axis=1)
    return np.asarray(2.0 * _MEAN_RADIUS_M * np.arcsin(np.minimum(chords / (2.0 * _MEAN_RADIUS_M), 1.0)))


def ecef_to_geodetic(points: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """ECEF (n, 3) metres to latitude, longitude (degrees, longitude in (−180, 180]) and ellipsoidal height (metres).

    Bowring's parametric latitude (Bowring 1976), iterated; below a nanometre from 100 km under the ellipsoid
    to satellite heights. At the poles the longitude is 0.
    """
    xyz = np.atleast_2d(np.asarray(points, dtype=np.float64))
    x, y, z = xyz[:, 0], xyz[:, 1], xyz[:, 2]
    p = np.hypot(x, y)
    # The parametric (reduced) latitude is kept as sine and cosine, so nothing divides by zero at the poles.
    sin_b, cos_b = SEMI_MAJOR_M * z, _SEMI_MINOR_M * p
    for _ in range(4):
        length = np.hypot(sin_b, cos_b)
        length = np.where(length == 0.0, 1.0, length)
        s, c = sin_b / length, cos_b / length
        sin_phi = z + _EP2 * _SEMI_MINOR_M * s**3
        cos_phi = p - _E2 * SEMI_MAJOR_M * c**3
        sin_b, cos_b = (1.0 - FLATTENING) * sin_phi, cos_phi
    lat = np.arctan2(sin_phi, cos_phi)
    sin_lat, cos_lat = np.sin(lat), np.cos(lat)
    # p cos φ + z sin φ − a √(1 − e² sin² φ) is the height at every latitude; p / cos φ − N fails at the poles.
    height = p * cos_lat + z * sin_lat - SEMI_MAJOR_M * np.sqrt(1.0 - _E2 * sin_lat**2)
    return np.degrees(lat), np.degrees(np.where(p == 0.0, 0.0, np.arctan2(y, x))), height


def utm_epsg(latitude_deg: float, longitude_deg: float) -> int:
    """EPSG code of the WGS 84 / UTM zone (326zz north, 327zz south), with Norway's and Svalbard's wider zones."""
    if not (np.isfinite(latitude_deg) and np.isfinite(longitude_deg) and -80.0 <= latitude_deg <= 84.0):
        raise ValueError(f"UTM covers latitudes from −80° to 84°, not {latitude_deg}°")
    longitude = (longitude_deg + 180.0) % 360.0 - 180.0
    zone = min(int((longitude + 180.0) // 6.0) + 1, 60)
    if 56.0 <= latitude_deg < 64.0 and 3.0 <= longitude < 12.0:
        zone = 32
    elif latitude_deg >= 72.0 and 0.0 <= longitude < 42.0:
        zone = 31 if longitude < 9.0 else 33 if longitude < 21.0 else 35 if longitude < 33.0 else 37
    return (32600 if latitude_deg >= 0.0 else 32700) + zone


def east_north_up(latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> FloatArray:
    """(3, 3), or (3, 3, n) of places (n,): unit vectors in ECEF that point east, north and up."""
    lat, lon = np.radians(latitude_deg), np.radians(longitude_deg)
    s, c, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    return np.array([[-sl, cl, 0.0 * s], [-s * cl, -s * sl, c], [c * cl, c * sl, s]])


@dataclass(frozen=True)
class LocalFrame:
    """An east-north-up frame, metres, tangent to the ellipsoid at its origin.

    Altitudes above sea level may be given as they are: an undulation of 100 m read as ellipsoidal height scales
    horizontal distances by 16 millionths (1.6 mm over 100 m). ``datum`` only says which it was.
    """

    latitude_deg: float
    """WGS 84, −90…90."""
    longitude_deg: float
    """WGS 84."""
    altitude_m: float = 0.0
    """Of the origin, above ``datum``."""
    datum: str = "unknown"
    """One of `DATUMS`."""

    def __post_init__(self) -> None:
        if not all(np.isfinite([self.latitude_deg, self.longitude_deg, self.altitude_m])):
            raise ValueError("latitude, longitude and altitude must be finite")
        if abs(self.latitude_deg) > 90.0:
            raise ValueError(f"latitude {self.latitude_deg}° is outside −90…90°")
        if self.datum not in DATUMS:
            raise ValueError(f"altitude datum {self.datum!r} is not one of {', '.join(DATUMS)}")

    def rotation(self) -> FloatArray:
        """(3, 3) local-from-ECEF rotation; its rows are east, north and up."""
        return east_north_up(self.latitude_deg, self.longitude_deg)

    def _origin(self) -> FloatArray:
        return np.asarray(geodetic_to_ecef(self.latitude_deg, self.longitude_deg, self.altitude_m)[0])

    def to_local(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike, altitude_m: ArrayLike) -> FloatArray:
        """Degrees, degrees and metres above this frame's datum, scalars or (n,), to east-north-up (n, 3) metres."""
        ecef = geodetic_to_ecef(latitude_deg, longitude_deg, altitude_m)
        return np.asarray((ecef - self._origin()) @ self.rotation().T)

    def to_geodetic(self, points: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """East-north-up (n, 3) or (3,) metres to latitudes, longitudes (degrees) and altitudes (metres), each (n,)."""
        local = np.atleast_2d(np.asarray(points, dtype=np.float64))
        return ecef_to_geodetic(local @ self.rotation() + self._origin())

    def utm_epsg(self) -> int:
        """EPSG code of the origin's UTM zone. Raises ValueError beyond −80…84° of latitude."""
        return utm_epsg(self.latitude_deg, self.longitude_deg)


def utm_epsg_of(origin: LocalFrame | None) -> int | None:
    """EPSG code of an origin's UTM zone; None without an origin, and where UTM is not defined."""
    try:
        return None if origin is None else origin.utm_epsg()
    except ValueError:
        return None
