"""Plots files: the plots that a GIS draws, with their ids, and what is known of them, as properties."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import ValidationError

from fieldkit.documents.mistaken import MISSPELT, nearest
from fieldkit.documents.toml_file import sentence
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import LocalFrame, plot_from_enu
from fieldkit.geometry.priors import SourceFrame
from fieldkit.sites.plot_ids import ID_FIELDS, IdProblem, PlotIds, plot_ids
from fieldkit.sites.site import SitePlot
from fieldkit.sites.vector_files import NUMBERS, Feature, Ring, VectorFile, read_wgs84, wgs84_features
from fieldkit.wording import listed

PLOTS_REMEDY = "Plots are polygons or points; height_m, row_heading_deg … are properties, in metres and degrees."
_AS_THEY_ARE = (
    "height_m",
    "datum",
    "slope_percent",
    "uphill_heading_deg",
    "plant_height_m",
    "row_spacing_m",
)
_PROPERTIES = (*NUMBERS, "datum")
_OTHERWISE = {"slope_deg": "slope_percent", "ground_points": "slope_percent"}
"""Columns that say the slope in another way."""
_NEAR = 0.87
"""Likeness from which a column's name is a slip: plant_heigth_m and lenght_m are, height and length are not."""
_MOST_COLUMNS = 12
"""Most columns that are named."""
_SIDES_M = (0.1, 1000.0)
"""Sides of a plot that are taken from its outline, metres."""
_LARGEST_M = 10_000.0
"""Largest half width of a plot, metres."""
_SQUARE = 1.05
"""Ratio of sides below which a drawing decides which one is longer."""


@dataclass(frozen=True, eq=False)
class PlotsFile:
    """A plots file, read."""

    plots: tuple[SitePlot, ...]
    """In the file's order."""
    shapes: tuple[Ring | None, ...]
    """Of each plot its corners (latitude, longitude), the last not the first again; None of a point."""
    ids: PlotIds
    """Which field their names are from."""
    file: VectorFile
    """As GeoJSON in WGS 84."""
    unused: tuple[str, ...] = ()
    """Columns that say nothing of a plot here."""

    @property
    def told(self) -> list[str]:
        """For people, before anything is computed: where the ids are from, and what is passed over."""
        unused = f"Columns that are not used: {listed(list(self.unused), _MOST_COLUMNS)}."
        return [f"{self.ids.sentence()}.", *([unused] if self.unused else []), *self.file.told]

    def geojson(self) -> bytes | None:
        """The plots as GeoJSON in WGS 84 that gives the same plots to any reader, its ids under "plot_id".

        None where the file itself does.
        """
        if self.file.as_is and (self.ids.field is None or self.ids.field.casefold() in ID_FIELDS):
            return None
        found = self.file.document.get("features", [self.file.document])
        rows = [
            {**row, "properties": {"plot_id": name, **_without(row.get("properties") or {}, "plot_id")}}
            for row, name in zip(found, self.ids.ids, strict=True)
        ]
        document = {"type": "FeatureCollection", "features": rows}
        return (json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False) + "\n").encode()


def load_plots(path: Path, plot_id: str | None = None) -> tuple[SitePlot, ...]:
    """The plots of a file: see `read_plots`."""
    return read_plots(path, plot_id).plots


def read_plots(path: Path, plot_id: str | None = None) -> PlotsFile:
    """Read a plots file: points and polygons, in the file's order.

    Of a polygon the origin is the centroid, and x points along the longer side of its least rectangle (see
    `plot_shape`), unless its ``row_heading_deg`` says otherwise. Of the two directions of that side the first polygon
    takes the one from 315° over north to 135°, and all others the one nearer to the first's, so that no plot of a field
    lies the other way round. That rectangle's sides are the plot's length and width, unless ``length_m`` and
    ``width_m`` are given.
    """
    path = Path(path)
    file = read_wgs84(path)
    features = wgs84_features(file.document, path)
    try:
        ids = plot_ids(features, plot_id)
    except IdProblem as problem:
        raise MetadataError(str(problem), path=path, remedy=problem.remedy) from problem
    unused = _unused(features, ids.field, path)
    plots: list[SitePlot] = []
    shapes = tuple(feature.parts[0] if feature.kind == "Polygon" else None for feature in features)
    towards: float | None = None
    problems: dict[str, list[str]] = {}
    for feature, name in zip(features, ids.ids, strict=True):
        try:
            plot, from_shape = _plot(feature, name, towards)
        except ValueError as error:  # Pydantic's is one
            why = sentence(error) if isinstance(error, ValidationError) else str(error)
            problems.setdefault(why, []).append(f"feature {feature.number}")
            continue
        if from_shape and towards is None:
            towards = plot.row_heading_deg
        plots.append(plot)
    if problems:
        message = "; ".join(f"{listed(those)}: {why}" for why, those in problems.items())
        raise MetadataError(message, path=path, remedy=PLOTS_REMEDY)
    return PlotsFile(tuple(plots), shapes, ids, file, unused)


def _unused(features: Sequence[Feature], id_field: str | None, path: Path) -> tuple[str, ...]:
    """The columns that are not used; one that nearly is a property of plots is an error."""
    columns = dict.fromkeys(name for feature in features for name in feature.properties)
    others = [name for name in columns if name not in (*_PROPERTIES, id_field) and name.casefold() not in ID_FIELDS]
    for name in others:
        plain = re.sub(r"\W+", "_", name.casefold()).strip("_")
        near = _OTHERWISE.get(plain) or nearest(plain, [p for p in _PROPERTIES if p not in columns], _NEAR)
        if near is not None:
            raise MetadataError(
                f'has a column "{name}", which is not used. {MISSPELT.looks_like.format(near)}',
                path=path,
                remedy=f"Name it {near} (metres and degrees), or otherwise than a property of plots.",
            )
    return tuple(others)


def _without(properties: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in properties.items() if key.casefold() != name}


def _plot(feature: Feature, name: Any, towards: float | None) -> tuple[SitePlot, bool]:
    """A feature as a plot, and whether its heading is from its shape.

    ``towards`` is the heading that a shape's direction is to be near to.
    """
    given = feature.properties
    if len(feature.parts) > 1:
        raise ValueError("has several parts; a plot is one polygon")
    ring = feature.parts[0]
    latitude, longitude = ring[0]
    heading = given.get("row_heading_deg")
    from_shape = feature.kind == "Polygon" and heading is None
    shape = None
    if feature.kind == "Polygon":
        shape = plot_shape(ring)
        latitude, longitude = shape.latitude_deg, shape.longitude_deg
        if from_shape:
            if shape.nearly_square:
                raise ValueError("is nearly square, so that its row_heading_deg must be given")
            heading = heading_near(shape.side_deg, 45.0 if towards is None else towards)
    elif heading is None:
        raise ValueError("is a point without row_heading_deg, the compass heading of the plan's x axis")
    if feature.height_m and "height_m" not in given:
        raise ValueError(
            f"has the height {feature.height_m:g} in its coordinates, which files mean differently: "
            "give height_m and datum as properties"
        )
    values = {"name": name, "latitude_deg": latitude, "longitude_deg": longitude, "row_heading_deg": heading}
    values |= {key: given[key] for key in _AS_THEY_ARE if key in given}
    if "length_m" in given or "width_m" in given:
        values |= {key: given[key] for key in ("length_m", "width_m") if key in given}
    elif shape is not None and isinstance(heading, int | float) and abs(heading) <= 360:
        length, width = shape.along_m(float(heading))
        if _SIDES_M[0] <= width <= _SIDES_M[1] and _SIDES_M[0] <= length <= _SIDES_M[1]:
            values |= {"length_m": length, "width_m": width}
    return SitePlot.model_validate(values), from_shape


@dataclass(frozen=True)
class PlotShape:
    """What a polygon says of a plot."""

    latitude_deg: float
    longitude_deg: float
    """Of its centroid, WGS 84."""
    side_deg: float
    """Compass heading of the longer side of its least rotated rectangle, in [0, 180): a side has two directions."""
    sides_m: tuple[float, float]
    """Of the least such rectangle about the centroid that holds the polygon, the longer one first."""

    def along_m(self, heading_deg: float) -> tuple[float, float]:
        """Length and width of that rectangle for a plot whose x axis points to a heading.

        The length is that of the side which is nearer to the heading.
        """
        off = abs(heading_near(self.side_deg, heading_deg) - heading_deg % 360.0)
        long, short = self.sides_m
        return (long, short) if min(off, 360.0 - off) <= 45.0 else (short, long)

    @property
    def nearly_square(self) -> bool:
        """Whether the longer side is less than 5 % longer, so that the drawing decides which one it is."""
        return self.sides_m[0] < _SQUARE * self.sides_m[1]


def plot_shape(corners: Sequence[tuple[float, float]]) -> PlotShape:
    """The middle and direction of a polygon of corners (latitude, longitude) in degrees, the last not the first again.

    Computed in the plane that touches the ellipsoid at the centroid.
    """
    ring = np.array(corners, dtype=np.float64)
    middle = (float(ring[0, 0]), float(ring[0, 1]))
    for _ in range(2):  # about its first corner, then about its centroid: at the poles headings change within a plot
        frame = LocalFrame(*middle)
        local = frame.to_local(ring[:, 0], ring[:, 1], 0.0)[:, :2]
        if np.abs(local).max() > _LARGEST_M:
            raise ValueError(f"is wider than {_LARGEST_M / 1000:.0f} km; a plot is a few metres")
        polygon = shapely.Polygon(local)
        if not polygon.is_valid or polygon.area <= 0.0:
            raise ValueError("is a polygon that crosses itself or has no area")
        latitude, longitude, _ = frame.to_geodetic((polygon.centroid.x, polygon.centroid.y, 0.0))
        middle = (float(latitude[0]), float(longitude[0]))
    edges = np.diff(shapely.get_coordinates(shapely.oriented_envelope(polygon))[:3], axis=0)
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    east, north = edges[int(np.argmax(lengths))]
    heading = math.degrees(math.atan2(east, north)) % 180.0 % 180.0
    along = np.array([east, north]) / lengths.max()
    reach = 2.0 * np.abs(
        (local - shapely.get_coordinates(polygon.centroid)) @ np.array([along, [-along[1], along[0]]]).T
    )
    sides = sorted(reach.max(axis=0).tolist())
    return PlotShape(*middle, heading, (sides[1], sides[0]))


def drawn_outline(plot: SitePlot, shape: Ring | None, source: SourceFrame) -> Ring | None:
    """Corners (x, y) of a plot in the plot frame that a source frame leads into, from the polygon that it is drawn as,
    or else its length and width; None where nobody said either, or the source lies nowhere on Earth.
    """
    if source.origin is None:
        return None
    if shape is not None:
        latitude, longitude = np.array(shape, dtype=np.float64).T
    elif plot.size_m is not None:
        own = LocalFrame(plot.latitude_deg, plot.longitude_deg, source.origin.altitude_m, source.origin.datum)
        x, y = 0.5 * plot.size_m[0], 0.5 * plot.size_m[1]
        ring = np.array([(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)]) @ plot_from_enu(plot.row_heading_deg)
        latitude, longitude, _ = own.to_geodetic(ring)
    else:
        return None
    corners = source.from_source.apply(source.origin.to_local(latitude, longitude, source.origin.altitude_m))
    return tuple((float(x), float(y)) for x, y, _ in corners)


def heading_near(side_deg: float, towards_deg: float) -> float:
    """The one of a side's two directions that is nearer to a heading, in [0, 360)."""
    turn = (side_deg - towards_deg + 90.0) % 180.0 - 90.0
    return (towards_deg + turn) % 360.0 % 360.0
