"""A mission's route read back from the GeoJSON file that export-mission writes beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.documents.json_file import read_json_object
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import LocalFrame

_REMEDY = "Give the GeoJSON file that `fieldkit export-mission` wrote beside the mission."
_MAX_BYTES, _MAX_FEATURES, _MAX_CORNERS = 16 << 20, 20_000, 100_000
_FARTHEST_M = 100_000.0


@dataclass(frozen=True)
class RouteStation:
    """A photograph of a route.

    Attributes:
        plot: over which it is taken.
        station: its number in the plan; −1 where the file does not say it.
        position_m: east, north and up of home.
        yaw_deg, pitch_deg: of the camera.
    """

    plot: str
    station: int
    position_m: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float


@dataclass(frozen=True, eq=False)
class Route:
    """A route in metres east, north and up of home.

    Attributes:
        name: of the mission.
        home: latitude and longitude, degrees.
        home_amsl_m: height of home above sea level, or None.
        stations: in the order they are flown.
        way: (n, 3) corners of the way: home, stops, landing.
        fences, zones: outlines (k, 2) of where it may and may not fly.
    """

    name: str
    home: tuple[float, float]
    home_amsl_m: float | None
    stations: tuple[RouteStation, ...]
    way: NDArray[np.float64]
    fences: tuple[NDArray[np.float64], ...]
    zones: tuple[NDArray[np.float64], ...]

    @property
    def length_m(self) -> float:
        """Of the way."""
        return float(np.linalg.norm(np.diff(self.way, axis=0), axis=1).sum())

    @property
    def plots(self) -> tuple[str, ...]:
        """In the order they are flown."""
        return tuple(dict.fromkeys(station.plot for station in self.stations))


def read_route(file: Path) -> Route | None:
    """Read a route.

    Returns:
        The route; None where the file is GeoJSON of something else.

    Raises:
        MetadataError: it is missing, unreadable, too large, no JSON, or a feature of the route is wrong.
    """
    document = read_json_object(file, _REMEDY, noun="route", max_bytes=_MAX_BYTES)
    rows = document.get("features")
    if not isinstance(rows, list) or not _is_route(rows):
        return None
    if len(rows) > _MAX_FEATURES:
        raise MetadataError(f"holds {len(rows)} features; {_MAX_FEATURES} are the most", path=file, remedy=_REMEDY)
    name = document.get("name")
    try:
        return _read(rows, name if isinstance(name, str) else file.stem)
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise MetadataError("is no route of a mission: a feature is damaged", path=file, remedy=_REMEDY) from error


def _is_route(rows: list[Any]) -> bool:
    kinds = [p.get("kind") for row in rows if isinstance(row, dict) and isinstance(p := row.get("properties"), dict)]
    return "home" in kinds and "station" in kinds and "landing" in kinds


def _read(rows: list[dict[str, Any]], name: str) -> Route:
    by_kind: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        by_kind.setdefault(str(row["properties"]["kind"]), []).append(row)
    home = by_kind["home"][0]
    longitude, latitude = _lonlat(home["geometry"]["coordinates"])
    frame = LocalFrame(latitude, longitude, 0.0, "unknown")
    amsl = home["properties"].get("amsl_m")

    def placed(row: dict[str, Any]) -> tuple[float, float, float]:
        height = _number(row["properties"]["height_above_home_m"])
        east, north, _ = _local(frame, [row["geometry"]["coordinates"]])[0]
        return float(east), float(north), height

    stops = sorted(
        (row for kind in ("station", "via") for row in by_kind.get(kind, [])),
        key=lambda row: _number(row["properties"]["order"]),
    )
    spots = [placed(home), *(placed(row) for row in stops), placed(by_kind["landing"][0])]
    stations = tuple(
        RouteStation(
            plot=str(p.get("plot", "")),
            station=s if isinstance(s := p.get("station"), int) else -1,
            position_m=spot,
            yaw_deg=_number(p["yaw_deg"]),
            pitch_deg=_number(p["pitch_deg"]),
        )
        for row, spot in zip(stops, spots[1:-1], strict=True)
        if (p := row["properties"])["kind"] == "station"
    )
    corners = 0
    outlines: dict[str, list[NDArray[np.float64]]] = {"fence": [], "no-fly": []}
    for kind, found in outlines.items():
        for row in by_kind.get(kind, []):
            ring = row["geometry"]["coordinates"][0]
            corners += len(ring)
            if corners > _MAX_CORNERS:
                raise ValueError("too many corners")
            found.append(_local(frame, ring)[:, :2])
    return Route(
        name, (latitude, longitude), None if amsl is None else _number(amsl), stations, np.array(spots),
        tuple(outlines["fence"]), tuple(outlines["no-fly"]),
    )  # fmt: skip


def _local(frame: LocalFrame, positions: list[Any]) -> NDArray[np.float64]:
    """East and north of home (n, 3); the third column is of no use: heights stand in the properties."""
    pairs = [_lonlat(position) for position in positions]
    found = frame.to_local([p[1] for p in pairs], [p[0] for p in pairs], np.zeros(len(pairs)))
    if not np.isfinite(found).all() or np.abs(found[:, :2]).max(initial=0.0) > _FARTHEST_M:
        raise ValueError("a place far from home")
    return found


def _lonlat(position: Any) -> tuple[float, float]:
    longitude, latitude = _number(position[0]), _number(position[1])
    if abs(longitude) > 180 or abs(latitude) > 90:
        raise ValueError("not a place on the Earth")
    return longitude, latitude


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or abs(value) > 1e6:
        raise ValueError("not a number")
    return float(value)
