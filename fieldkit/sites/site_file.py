"""Site files (TOML), with the plots, fences and no-fly zones that may lie beside them, as a GIS writes them.

missions/README.md lists the keys. Everything is checked against home, so that swapped coordinates are found here and
not in the field.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import ValidationError

from fieldkit.documents.mistaken import nearest, refuse_other
from fieldkit.documents.toml_file import read_versioned, sentence, validated_toml
from fieldkit.errors import MetadataError, UsageError, about
from fieldkit.files import named_file
from fieldkit.geometry.geodesy import LocalFrame, great_circle_m
from fieldkit.routing.mission import Home
from fieldkit.runtime.shipped import shipped_page
from fieldkit.sites.plots_file import PLOTS_REMEDY, load_plots, read_plots
from fieldkit.sites.site import Site, SitePlot
from fieldkit.sites.vector_files import read_wgs84, wgs84_features
from fieldkit.wording import listed

FARTHEST_M = 100_000.0
"""From home; what lies farther away is not where it was meant to be."""
MAX_BYTES = 256 << 10
"""Largest site file that is read, bytes."""
_REMEDY = f"A site file is TOML with format = 1, [home] and plots: {shipped_page('missions/README.md')} lists its keys."
_NO_PLOTS = 'Give it [[plots]], or plots = "plots.geojson"; --plots takes such a file, too.'

Tell = Callable[[str], None]
"""Takes a sentence for people."""


def load_site(
    path: Path,
    plots: Path | None = None,
    plot_id: str | None = None,
    *,
    tell: Tell | None = None,
    converted: bool = False,
) -> Site:
    """Read a site file.

    ``geofence``, ``no_fly``, ``plots`` and ``neighbours`` may name files (`read_wgs84`), relative to the site file
    and in its folder or below it; only an absolute path may lead elsewhere.

    Args:
        plots: a file whose plots are flown in place of the site's own, which become their neighbours.
        plot_id: field of the plots file that holds the plots' ids. None takes the site file's ``plot_id`` for the file
            that it names itself, and else looks for one (`plot_ids`).
        tell: is told where the ids are from, before they are used, and datums of files that are not WGS 84.
        converted: ``plots`` may hold what the site's own file held, where that is missing, as in a campaign.
    """
    with about(path := Path(path), _REMEDY):
        return _load(path, plots, plot_id, tell or _nobody, converted)


def _load(path: Path, plots: Path | None, plot_id: str | None, tell: Tell, converted: bool) -> Site:
    refuse_other(path, "site file")
    document = read_versioned(path, "site file", MAX_BYTES)
    document.setdefault("name", path.stem)
    own, beside = document.get("plots"), document.get("neighbours")
    if isinstance(own, str):
        file = named_file(own, path, "plots", what="site file")
        if plots is None:
            plots, plot_id = file, plot_id or document.get("plot_id")
        own = (
            load_plots(file, document.get("plot_id"))
            if plots != file and not (converted and not file.exists())
            else None
        )
    if plots is None and not own:
        raise MetadataError("has no plots", remedy=_NO_PLOTS)
    if own is None or isinstance(own, tuple):
        document["plots"] = [{"latitude_deg": 0.0, "longitude_deg": 0.0}]  # until others take its place
    if isinstance(beside, str):
        del document["neighbours"]
    for key in ("geofence", "no_fly"):
        if isinstance(document.get(key), str):
            zones = named_file(document[key], path, key, what="site file")
            document[key] = list(_zones(zones, tell, named=key == "no_fly"))
    site = validated_toml(Site, document)
    _check_places(site.home, _surroundings(site))
    _check_polygons(site)
    neighbours = site.neighbours
    if isinstance(beside, str):
        others = read_plots(named_file(beside, path, "neighbours", what="site file"))
        neighbours = others.plots
        for text in others.file.told:
            tell(text)
    if own and (isinstance(own, tuple) or isinstance(beside, str)):
        site = _changed(site, plots=own if isinstance(own, tuple) else site.plots, neighbours=neighbours)
    if plots is not None:
        found = read_plots(plots, plot_id)
        for text in found.told:
            tell(text)
        if own:
            return with_plots(site, found.plots, path=plots)
        with about(plots):
            return _changed(site, plots=found.plots, neighbours=neighbours)
    if plot_id is not None:
        raise MetadataError("lists its plots itself, so there is no field for --plot-id", remedy="Leave --plot-id out.")
    _check_places(site.home, _origins(site.all_plots))
    return site


def plots_file_beside(path: Path) -> Path | None:
    """The file that a site file names for its plots; None where it lists them itself, or has none."""
    own = plots_named(path)
    return None if own is None else named_file(own, path, "plots", what="site file")


def plots_named(path: Path) -> str | None:
    """The same as the site file names it."""
    with about(path, _REMEDY):
        own = read_versioned(path, "site file", MAX_BYTES).get("plots")
    return own if isinstance(own, str) else None


def with_plots(site: Site, plots: Sequence[SitePlot], *, path: Path | None = None) -> Site:
    """The site with other plots to fly; of its own, those that these do not cover are neighbours."""
    with nullcontext() if path is None else about(path):
        _check_places(site.home, _origins(plots))
        return _changed(site, plots=tuple(plots), neighbours=site.neighbours_of(plots))


def _changed(site: Site, **plots: tuple[SitePlot, ...]) -> Site:
    """The site with other plots or neighbours, from a file."""
    fields = {name: getattr(site, name) for name in type(site).model_fields}
    try:
        changed = Site.model_validate(fields | plots)
    except ValidationError as error:
        raise MetadataError(sentence(error), remedy=PLOTS_REMEDY) from error
    _check_places(changed.home, _origins(changed.all_plots))
    return changed


def named_plots(site: Site, names: Sequence[str]) -> tuple[SitePlot, ...]:
    """A site's plots of these names, in the site's order. Raises UsageError where one is none of its plots."""
    known = [plot.name for plot in site.plots]
    if not names:
        raise UsageError("no plot is named", remedy="Name one or more of the site's plots.")
    if wrong := [name for name in dict.fromkeys(names) if name not in known]:
        near = list(dict.fromkeys(name for name in (nearest(each, known) for each in wrong) if name))
        meant = f"Is {' or '.join(near)} meant? " if near else ""
        remedy = f"{meant}Its plots are {listed(known)}."
        raise UsageError(f"the site has no plot {' or '.join(wrong[:5])}", remedy=remedy)
    return tuple(plot for plot in site.plots if plot.name in names)


def _nobody(text: str) -> None:
    """Listens to nothing."""


def _zones(path: Path, tell: Tell, *, named: bool) -> Iterator[Any]:
    """The polygons of a file as a site file has them inline; ``tell`` is told their datum where it is not WGS 84."""
    file = read_wgs84(path)
    for text in file.told:
        tell(text)
    for feature in wgs84_features(file.document, path):
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


def _check_places(home: Home, places: Sequence[tuple[str, float, float]]) -> None:
    """Refuse places too far from home; where they would be near it with their coordinates swapped, say so."""
    if not places:
        return
    origin = (home.latitude_deg, home.longitude_deg)
    latitudes, longitudes = (np.array([place[k] for place in places], dtype=np.float64) for k in (1, 2))
    away = great_circle_m(latitudes, longitudes, *origin)
    if (away <= FARTHEST_M).all():
        return
    first = int(np.argmax(away > FARTHEST_M))
    name = places[first][0]
    raise MetadataError(
        f"{name} lies {away[first] / 1000:,.0f} km from home",
        remedy="Check its coordinates and home's: latitude comes first in a site file, longitude in GeoJSON.",
    )


def _check_polygons(site: Site) -> None:
    for name, ring in _polygons(site):
        corners = np.array(ring, dtype=np.float64)
        local = LocalFrame(*ring[0]).to_local(corners[:, 0], corners[:, 1], 0.0)[:, :2]
        polygon = shapely.Polygon(local)
        if not polygon.is_valid or polygon.area <= 0.0:
            raise MetadataError(
                f"{name} crosses itself or has no area", remedy="List its corners in order along its edge."
            )
