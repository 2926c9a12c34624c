"""Site files (TOML), with the plots, fences and no-fly zones that may lie beside them, as a GIS writes them.

missions/README.md lists the keys. Everything is checked against home, so that swapped coordinates are found here and
not in the field.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import ValidationError

from fieldkit.documents.mistaken import SWAPPED, look_swapped, refuse_other
from fieldkit.documents.toml_file import read_versioned, sentence, validated_toml
from fieldkit.errors import MetadataError
from fieldkit.files import file_beside
from fieldkit.geometry.geodesy import LocalFrame, great_circle_m
from fieldkit.regular_files import open_regular
from fieldkit.runtime.shipped import shipped_page
from fieldkit.sites.plot_ids import ID_FIELDS, IdProblem, PlotIds, plot_ids
from fieldkit.sites.plot_shapes import heading_near, plot_shape
from fieldkit.sites.site import Site, SiteHome, SitePlot
from fieldkit.sites.vector_files import NUMBERS, Feature, VectorFile, read_features, read_wgs84, wgs84_features
from fieldkit.wording import listed

FARTHEST_M = 100_000.0
"""From home; what lies farther away is not where it was meant to be."""
_MAX_BYTES = 256 << 10
_REMEDY = f"A site file is TOML with format = 1, [home] and plots: {shipped_page('missions/README.md')} lists its keys."
_PLOTS_REMEDY = "Plots are polygons or points; height_m, row_heading_deg … are properties, in metres and degrees."
_AS_THEY_ARE = (
    "height_m", "datum", "slope_percent", "slope_deg", "uphill_heading_deg", "plant_height_m", "row_spacing_m"
)  # fmt: skip
_PROPERTIES = (*NUMBERS, "datum", "ground_points")
_NEAR = 0.87
"""Likeness from which a column's name is a slip: plant_heigth_m and lenght_m are, height and length are not."""
_MOST_COLUMNS = 12
_SIDES_M = (0.1, 1000.0)
_NO_PLOTS = 'Give it [[plots]], or plots = "plots.geojson"; --plots takes such a file, too.'

Tell = Callable[[str], None]
"""Takes a sentence for people."""


@dataclass(frozen=True, eq=False)
class PlotsFile:
    """A plots file, read."""

    plots: tuple[SitePlot, ...]
    """In the file's order."""
    ids: PlotIds
    """Which field their names are from."""
    file: VectorFile
    """As GeoJSON in WGS 84."""
    unused: tuple[str, ...] = ()
    """Columns that say nothing of a plot here."""

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


def load_site(
    path: Path, plots: Path | None = None, plot_id: str | None = None, *, tell: Tell | None = None
) -> Site:  # fmt: skip
    """Read a site file.

    ``geofence``, ``no_fly`` and ``plots`` may name files (`read_features`), relative to the site file and in its folder
    or below it; only an absolute path may lead elsewhere.

    Args:
        path: the TOML file.
        plots: a file whose plots take the place of the site's own.
        plot_id: field of the plots file that holds the plots' ids. None takes the site file's ``plot_id`` for the file
            that it names itself, and else looks for one (`plot_ids`).
        tell: is told where the ids are from, before they are used.

    Raises:
        MetadataError: a file is missing or malformed, a key is missing, unknown or wrong, a polygon crosses itself, two
            plots have one name, heights lack the datum that would connect them, or something lies more than
            `FARTHEST_M` from home.
    """
    path = Path(path)
    refuse_other(path, "site file", _REMEDY)
    _require_no_json(path)
    document = read_versioned(path, "site file", _REMEDY, _MAX_BYTES)
    document.setdefault("name", path.stem)
    own = document.get("plots")
    if plots is None and isinstance(own, str):
        plots, plot_id = _beside(own, path, "plots"), plot_id or document.get("plot_id")
    if plots is None and not own:
        raise MetadataError("has no plots", path=path, remedy=_NO_PLOTS)
    if plots is not None:
        document["plots"] = [{"latitude_deg": 0.0, "longitude_deg": 0.0}]  # until with_plots takes its place
    for key in ("geofence", "no_fly"):
        if isinstance(document.get(key), str):
            document[key] = list(_zones(_beside(document[key], path, key), named=key == "no_fly"))
    site = validated_toml(Site, document, path, _REMEDY)
    _check_places(site.home, _surroundings(site), path)
    _check_polygons(site, path)
    if plots is not None:
        found = read_plots(plots, plot_id)
        if tell is not None:
            tell(f"{found.ids.sentence()}.")
            if found.unused:
                tell(f"Columns that are not used: {listed(list(found.unused), _MOST_COLUMNS)}.")
        return with_plots(site, found.plots, path=plots)
    if plot_id is not None:
        raise MetadataError(
            "lists its plots itself, so there is no field for --plot-id", path=path, remedy="Leave --plot-id out."
        )
    _check_places(site.home, _origins(site.plots), path)
    return site


def plots_file_beside(path: Path) -> Path | None:
    """The file that a site file names for its plots; None where it lists them itself, or has none."""
    own = read_versioned(path, "site file", _REMEDY, _MAX_BYTES).get("plots")
    return _beside(own, path, "plots") if isinstance(own, str) else None


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

    Args:
        path: of any kind that `read_features` reads.
        plot_id: field that holds the plots' ids; None looks for one (`plot_ids`).

    Raises:
        MetadataError: as `read_features`; no field gives every plot an id; a property is wrong, a point has no heading,
            a polygon is nearly square and has none, crosses itself or has several parts, a height has no datum.
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
    towards: float | None = None
    for feature, name in zip(features, ids.ids, strict=True):
        try:
            plot, from_shape = _plot(feature, name, towards)
        except ValidationError as error:
            raise _bad_plot(feature, sentence(error), path) from error
        except ValueError as error:
            raise _bad_plot(feature, str(error), path) from error
        if from_shape and towards is None:
            towards = plot.row_heading_deg
        plots.append(plot)
    return PlotsFile(tuple(plots), ids, file, unused)


def _unused(features: Sequence[Feature], id_field: str | None, path: Path) -> tuple[str, ...]:
    """The columns that are not used; one that nearly is a property of plots is an error."""
    columns = dict.fromkeys(name for feature in features for name in feature.properties)
    others = [name for name in columns if name not in (*_PROPERTIES, id_field) and name.casefold() not in ID_FIELDS]
    for name in others:
        plain = re.sub(r"\W+", "_", name.casefold()).strip("_")
        near = get_close_matches(plain, [known for known in _PROPERTIES if known not in columns], n=1, cutoff=_NEAR)
        if near:
            raise MetadataError(
                f'has a column "{name}", which is not used: is {near[0]} meant?', path=path,
                remedy=f"Name it {near[0]} (metres and degrees), or otherwise than a property of plots.",
            )  # fmt: skip
    return tuple(others)


def with_plots(site: Site, plots: Sequence[SitePlot], *, path: Path | None = None) -> Site:
    """The site with other plots in place of its own.

    Args:
        site: its home, fence and all else.
        plots: one or more.
        path: of the file they are from, for errors.
    """
    fields = {name: getattr(site, name) for name in type(site).model_fields}
    try:
        changed = Site.model_validate(fields | {"plots": tuple(plots)})
    except ValidationError as error:
        raise MetadataError(sentence(error), path=path, remedy=_PLOTS_REMEDY) from error
    _check_places(changed.home, _origins(changed.plots), path)
    return changed


def _require_no_json(path: Path) -> None:
    """Say it where another of fieldkit's files is given as the site."""
    try:
        with open_regular(path) as file:
            start = file.read(64).lstrip()
    except (OSError, ValueError):
        return  # reading it says what is wrong
    if start.startswith(b"{"):
        raise MetadataError(
            "is JSON, not a site file", path=path,
            remedy="--site takes the TOML file with [home]; the plan comes first, plots are given with --plots.",
        )  # fmt: skip


def _without(properties: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in properties.items() if key.casefold() != name}


def _plot(feature: Feature, name: Any, towards: float | None) -> tuple[SitePlot, bool]:
    """A feature as a plot, and whether its heading is from its shape.

    Args:
        feature: of a plots file.
        name: its id.
        towards: heading that a shape's direction is to be near to.
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
    values = {
        "name": name,
        "latitude_deg": latitude,
        "longitude_deg": longitude,
        "row_heading_deg": heading,
    }
    values |= {key: given[key] for key in _AS_THEY_ARE if key in given}
    if "ground_points" in given:
        values["ground_points"] = _latitude_first(given["ground_points"])
    if "length_m" in given or "width_m" in given:
        values |= {key: given[key] for key in ("length_m", "width_m") if key in given}
    elif shape is not None and isinstance(heading, int | float) and abs(heading) <= 360:
        length, width = shape.along_m(float(heading))
        if _SIDES_M[0] <= width <= _SIDES_M[1] and _SIDES_M[0] <= length <= _SIDES_M[1]:
            values |= {"length_m": length, "width_m": width}
    return SitePlot.model_validate(values), from_shape


def _latitude_first(points: Any) -> Any:
    """GeoJSON's positions [longitude, latitude, height] as a site file has them; anything else as it is."""
    if not isinstance(points, list):
        return points
    return [[p[1], p[0], *p[2:]] if isinstance(p, list) and len(p) > 1 else p for p in points]


def _bad_plot(feature: Feature, problem: str, path: Path) -> MetadataError:
    return MetadataError(f"feature {feature.number}: {problem}", path=path, remedy=_PLOTS_REMEDY)


def _zones(path: Path, *, named: bool) -> Iterator[Any]:
    """The polygons of a file as a site file has them inline."""
    for feature in read_features(path):
        if feature.kind != "Polygon":
            raise MetadataError(
                f"feature {feature.number}: is a point, not a polygon", path=path, remedy="Draw the zone as a polygon."
            )
        for ring in feature.parts:
            if not named:
                yield ring
                continue
            name = feature.properties.get("name", f"zone {feature.number}")
            yield {"name": name.strip() if isinstance(name, str) else str(name)[:80], "corners": ring}


def _beside(name: str, site: Path, key: str) -> Path:
    """The file that a site file names."""
    if not name or "\0" in name or len(name) > 1000:
        raise MetadataError(f"{key}: is not a path", path=site, remedy="Name a file beside the site file.")
    try:
        found = file_beside(Path(name), site)
    except (OSError, RuntimeError) as error:  # links in a circle
        raise MetadataError(f"{key}: {name} cannot be followed", path=site, remedy="Check the links there.") from error
    if found is None:
        raise MetadataError(
            f"{key}: {name} leads out of the site file's folder", path=site,
            remedy="Copy the file beside the site file, or give its absolute path.",
        )  # fmt: skip
    return found


def _origins(plots: Sequence[SitePlot]) -> list[tuple[str, float, float]]:
    return [(f'plot "{plot.name}"', plot.latitude_deg, plot.longitude_deg) for plot in plots]


def _surroundings(site: Site) -> list[tuple[str, float, float]]:
    """What a site has beside its plots: (name, latitude, longitude)."""
    places = [("landing", site.landing)] if site.landing else []
    places += [(f"rally {n}", place) for n, place in enumerate(site.rally, 1)]
    found = [(name, place.latitude_deg, place.longitude_deg) for name, place in places]
    found += [(f'obstacle "{each.name}"', each.latitude_deg, each.longitude_deg) for each in site.obstacles]
    for name, ring in _polygons(site):
        found += [(f"a corner of {name}", *corner) for corner in ring]
    return found


def _polygons(site: Site) -> Iterator[tuple[str, tuple[tuple[float, float], ...]]]:
    yield from ((f"geofence {n}", ring) for n, ring in enumerate(site.fence, 1))
    yield from ((f'no_fly "{zone.name}"', zone.corners) for zone in site.no_fly)


_ZONE_DEG, _NEAR_DEG = 6.0, 0.3
"""Width of a UTM zone, and how well a place read in the zone beside keeps to it."""


def _check_places(home: SiteHome, places: Sequence[tuple[str, float, float]], path: Path | None) -> None:
    """Refuse places too far from home; where they would be near it with their coordinates swapped, say so."""
    if not places:
        return
    origin = (home.latitude_deg, home.longitude_deg)
    latitudes, longitudes = (np.array([place[k] for place in places], dtype=np.float64) for k in (1, 2))
    away = great_circle_m(latitudes, longitudes, *origin)
    if (away <= FARTHEST_M).all():
        return
    first = int(np.argmax(away > FARTHEST_M))
    name, latitude, longitude = places[first]
    message = f"{name} lies {away[first] / 1000:,.0f} km from home"
    remedy = "Check its coordinates and home's."
    if look_swapped(latitude, longitude, origin, FARTHEST_M):
        message += f": its {SWAPPED.looks_like}"
        remedy = SWAPPED.remedy
    elif abs(latitude - origin[0]) < _NEAR_DEG and abs(abs(longitude - origin[1]) - _ZONE_DEG) < _NEAR_DEG:
        zone = int((origin[1] + 180.0) // _ZONE_DEG) + 1
        message += ", about six degrees of longitude: the CRS looks like that of the UTM zone beside"
        code = (32600 if origin[0] >= 0 else 32700) + zone
        remedy = f"Home lies in zone {zone}: EPSG:{code}, if the file is in WGS 84 / UTM."
    raise MetadataError(message, path=path, remedy=remedy)


def _check_polygons(site: Site, path: Path) -> None:
    for name, ring in _polygons(site):
        corners = np.array(ring, dtype=np.float64)
        local = LocalFrame(*ring[0]).to_local(corners[:, 0], corners[:, 1], 0.0)[:, :2]
        polygon = shapely.Polygon(local)
        if not polygon.is_valid or polygon.area <= 0.0:
            raise MetadataError(
                f"{name} crosses itself or has no area", path=path, remedy="List its corners in order along its edge."
            )
