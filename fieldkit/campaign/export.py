"""A campaign's table for spreadsheets (CSV) and geographic information systems (GeoJSON, GeoPackage).

One row or feature per plot and date; coordinates are WGS 84. The GeoPackage has two layers: ``visits`` with a feature
per plot and date, and ``plots`` with a feature per plot and its latest figures, to colour a map by.
"""

from __future__ import annotations

import importlib.util
import io
import json
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args, get_type_hints

import numpy as np
import shapely

from fieldkit.campaign.ranks import Ranked, ranking
from fieldkit.campaign.reading import Campaign, CampaignPlot, visit_files
from fieldkit.documents.csv_text import csv_text
from fieldkit.errors import MetadataError, StorageError, UsageError
from fieldkit.evaluation.rasters import (
    CANOPY_FILE,
    REFUSED_TAG,
    SURFACE_FILE,
    color_span,
    require_rasters,
    write_style,
)
from fieldkit.figures.registry import F_SCORE
from fieldkit.files import atomic_folder, check_writable, write_atomic
from fieldkit.regular_files import check_replaceable
from fieldkit.results.evaluation import distance_key
from fieldkit.results.report_files import EVALUATION_FILE, load_evaluation_report
from fieldkit.results.traits import PlantEntry, TraitsEntry
from fieldkit.results.visit import CAMPAIGN_FILE, Visit
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.wording import by_key, listed

Format = Literal["csv", "geojson", "gpkg"]
SUFFIXES: Mapping[str, Format] = {".csv": "csv", ".geojson": "geojson", ".json": "geojson", ".gpkg": "gpkg"}
VISITS_LAYER, PLOTS_LAYER, PLANTS_LAYER = "visits", "plots", "plants"
_LATEST = ("chamfer_m", "predicted_chamfer_m", "predicted_low_m", "predicted_high_m")
_TEXTS = ("captures", "folder", "error")
_GEOPACKAGE = "1.2"  # GDAL 3.12 writes 1.4 by itself, of which that of QGIS 3.22 warns
_PLACE = ("latitude_deg", "longitude_deg", "row_heading_deg")
_HINTS = {
    **get_type_hints(PlantEntry),
    **get_type_hints(TraitsEntry),
    **get_type_hints(Visit),
    **dict.fromkeys(_PLACE, float),
    **dict.fromkeys(("rank", "predicted_rank", "visits"), int),
}
"""Types of columns, by name."""

Values = dict[str, Any]


def export_campaign(campaign: Campaign, output: Path, *, overwrite: bool = False) -> Format:
    """Write a campaign's table."""
    output = Path(output)
    chosen = SUFFIXES.get(output.suffix.lower())
    if chosen is None:
        raise UsageError(f"which format is {output.name}?", remedy="End its name in .csv, .geojson or .gpkg.")
    check_replaceable(output, overwrite=overwrite)
    check_writable(output.parent)
    writers: Mapping[Format, Callable[[Campaign], str | bytes]] = {
        "csv": campaign_csv,
        "geojson": campaign_geojson,
        "gpkg": campaign_geopackage,
    }
    write_atomic(output, writers[chosen](campaign))
    return chosen


def visit_rows(campaign: Campaign) -> list[Values]:
    """A row of plain values per visit, in the table's order; every row has the same keys."""
    distances = [distance_key(d) for d in campaign.evaluation.distances_m]
    ranks = {
        (entry.visit.plot, date): entry
        for date in campaign.dates
        for entry in ranking(campaign.visits, campaign.plan, date)
    }
    plots = {plot.name: plot for plot in campaign.plots}
    return [_row(v, plots.get(v.plot), ranks.get((v.plot, v.date)), distances) for v in campaign.visits]


def plot_rows(campaign: Campaign) -> list[Values]:
    """A row of plain values per plot of the site: where it is, how often it was visited, its latest figures."""
    result = []
    visits = by_key((visit.plot, visit) for visit in campaign.visits)
    for plot in campaign.plots:
        own = visits.get(plot.name, [])
        last = max(own, key=lambda visit: visit.date, default=None)
        result.append(
            {
                "plot": plot.name,
                **_place(plot),
                "visits": len(own),
                "date": last and last.date,
                **{name: last and getattr(last, name) for name in _LATEST},
                **((last and last.traits) or TraitsEntry()).row(),
                "error": last.error if last else "",
            }
        )
    return result


def plant_rows(campaign: Campaign) -> list[Values]:
    """A row of plain values per plant of each visit whose evaluation is there and knows where it stands on Earth."""
    folders = [(visit, campaign.folder / visit.folder) for visit in campaign.visits if visit.folder]
    return [
        {"plot": visit.plot, "date": visit.date, **plant.model_dump()}
        for visit, folder in folders
        if (folder / EVALUATION_FILE).is_file()
        for plot in load_evaluation_report(folder).plots
        for plant in plot.plants
        if plant.latitude_deg is not None
    ]


def campaign_csv(campaign: Campaign) -> str:
    """The visits as CSV: UTF-8, commas, decimal points, empty where there is no value."""
    # The columns are the same without a row.
    return csv_text(_columns(campaign), (row.values() for row in visit_rows(campaign)))


def campaign_geojson(campaign: Campaign) -> str:
    """The visits as a FeatureCollection (RFC 7946): polygons where plots are drawn so, else points."""
    shapes = {plot.name: shapely.geometry.mapping(_geometry(plot)) for plot in campaign.plots}
    features = [
        {"type": "Feature", "geometry": shapes.get(row["plot"]), "properties": row} for row in visit_rows(campaign)
    ]
    document = {"type": "FeatureCollection", "name": campaign.name, "features": features}
    text = io.StringIO()  # `json.dumps` would hold every word of it at once
    json.dump(document, text, indent=1, ensure_ascii=False, allow_nan=False)
    return text.getvalue() + "\n"


def campaign_geopackage(campaign: Campaign) -> bytes:
    """A GeoPackage in EPSG:4326: the layers ``visits`` and ``plots``, and ``plants`` where their places are known."""
    if importlib.util.find_spec("pyogrio") is None:
        raise UsageError(
            "GeoPackages need the extra 'geo'", remedy="pip install 'fieldkit[geo]', or export CSV or GeoJSON."
        )
    shapes = {plot.name: _geometry(plot) for plot in campaign.plots}
    plot_columns = list(plot_rows(replace(campaign, visits=()))[0])
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        file = Path(folder) / "campaign.gpkg"
        visits, plots, plants = visit_rows(campaign), plot_rows(campaign), plant_rows(campaign)
        _write_layer(file, VISITS_LAYER, visits, _columns(campaign), [shapes.get(row["plot"]) for row in visits])
        _write_layer(file, PLOTS_LAYER, plots, plot_columns, [shapes.get(row["plot"]) for row in plots])
        if plants:
            feet = [shapely.Point(row["longitude_deg"], row["latitude_deg"]) for row in plants]
            _write_layer(file, PLANTS_LAYER, plants, list(plants[0]), feet)
        return file.read_bytes()


def _write_layer(
    file: Path, layer: str, rows: Sequence[Values], columns: Sequence[str], geometry: Sequence[shapely.Geometry | None]
) -> None:
    from pyogrio.errors import DataSourceError, FieldError
    from pyogrio.raw import write

    data, masks = [], []
    for name in columns:
        values = [row[name] for row in rows]
        missing = np.array([value is None for value in values], dtype=bool)
        data.append(_column(name, values))
        masks.append(missing if missing.any() else None)
    kinds = {shape.geom_type for shape in geometry if shape is not None}
    try:
        write(
            str(file),
            geometry=np.array([None if shape is None else shapely.to_wkb(shape) for shape in geometry], dtype=object),
            field_data=data,
            fields=np.array([name.replace(".", "_") for name in columns], dtype=object),
            field_mask=masks,
            layer=layer,
            driver="GPKG",
            geometry_type=kinds.pop() if len(kinds) == 1 else "Unknown",
            crs="EPSG:4326",
            append=file.exists(),
            dataset_options={"VERSION": _GEOPACKAGE},
        )
    except (DataSourceError, FieldError, OSError) as error:
        raise StorageError(
            f"cannot be written: {error}", path=file.parent, remedy="Check the space left for temporary files."
        ) from error


def _column(name: str, values: Sequence[Any]) -> np.ndarray:
    if name == "date":
        return np.array([value or "NaT" for value in values], dtype="datetime64[D]")
    hint = float if name.startswith(F_SCORE) else _HINTS.get(name)
    kinds = {hint, *get_args(hint)}
    if kinds & {int, bool}:
        return np.array([value or 0 for value in values], dtype=np.int32)
    if float in kinds:
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)
    return np.array(["" if value is None else _text(value) for value in values], dtype=object)


def _text(value: str) -> str:
    """Text without what a file's encoding cannot hold."""
    return value.encode("utf-8", "replace").decode().replace("\0", "")


def _row(visit: Visit, plot: CampaignPlot | None, ranked: Ranked | None, distances: Sequence[str]) -> Values:
    """The visit's own row with its plot's place and rank, F-scores a column each, and texts last."""
    own = visit.row()
    texts = {name: _text(own[name]) for name in _TEXTS}
    texts |= {name: _text("; ".join(own[name])) for name in ("notes", "doubts")}
    scores = {F_SCORE + distance: visit.f_score.get(distance) for distance in distances}
    ranks = {} if ranked is None else {"predicted_rank" if ranked.predicted else "rank": ranked.rank}
    row: Values = {"plot": visit.plot, "date": visit.date, **_place(plot), "rank": None, "predicted_rank": None} | ranks
    for name, value in own.items():
        if name not in (*texts, "fieldkit"):
            row |= scores if name == "f_score" else {name: value}
    return row | texts


def _columns(campaign: Campaign) -> list[str]:
    """The keys of every row of `visit_rows`; they are the same without a visit."""
    distances = [distance_key(d) for d in campaign.evaluation.distances_m]
    return list(_row(Visit(plot="", date="0001-01-01"), None, None, distances))


def _place(plot: CampaignPlot | None) -> Values:
    return {name: None if plot is None else getattr(plot, name) for name in _PLACE}


def _geometry(plot: CampaignPlot) -> shapely.Geometry:
    """Longitude and latitude; a polygon's corners counter-clockwise, as RFC 7946 has it."""
    if plot.shape is None:
        return shapely.Point(plot.longitude_deg, plot.latitude_deg)
    ring = [(longitude, latitude) for latitude, longitude in plot.shape]
    return shapely.orient_polygons(shapely.Polygon(ring))


RASTERS_FILE, GEOPACKAGE_FILE = "rasters.csv", "campaign.gpkg"
_FILES = (CANOPY_FILE, SURFACE_FILE)

Span = tuple[float, float]


@dataclass(frozen=True)
class RasterRow:
    """A visit's height models."""

    plot: str
    date: str
    canopy_height: str = ""
    surface: str = ""
    """Files; "" where there are none."""
    crs_epsg: int | None = None
    cell_m: float | None = None
    """Of both."""
    height_datum: str = ""
    """That the surface's heights are above: ellipsoid, sea level or unknown."""
    height_refused: str = ""
    """Why plants may be higher than the canopy's raster says; "" where its traits give the height."""
    no_rasters: str = ""
    """Why there are none."""
    notes: str = ""


def export_rasters(campaign: Campaign, output: Path, *, overwrite: bool = False) -> tuple[RasterRow, ...]:
    """Write all visits' height models into a folder, with rasters.csv and the GeoPackage of `campaign_geopackage`.

    The rasters are the visits' own, byte for byte. Their styles are made anew: all canopy heights have the same
    colours, and so have all surfaces, so that plots and dates can be compared by eye. Returns a row per visit, as
    rasters.csv has them.
    """
    require_rasters()
    with atomic_folder(Path(output), overwrite=overwrite, marker=RASTERS_FILE) as folder:
        made = [_copied(campaign, visit, folder) for visit in campaign.visits]
        rows = tuple(row for row, _ in made)
        spans = np.array([found for _, found in made if found])  # (visits, canopy and surface, low and high)
        if not len(spans):
            raise UsageError(
                f"no visit has rasters: {'; '.join(without_rasters(rows)[:1]) or 'there are no visits yet'}",
                remedy=f"Write rasters = true under [evaluation] in {campaign.folder / CAMPAIGN_FILE}, and give the "
                "photographs to `fieldkit evaluate` again.",
            )
        canopy, surface = zip(spans[:, :, 0].min(axis=0).tolist(), spans[:, :, 1].max(axis=0).tolist(), strict=True)
        for row in rows:
            if not row.no_rasters:
                write_style(folder / row.canopy_height, canopy, canopy=True)
                write_style(folder / row.surface, surface, canopy=False)
        columns = [field.name for field in fields(RasterRow)]
        write_atomic(folder / RASTERS_FILE, csv_text(columns, (astuple(row) for row in rows)))
        write_atomic(folder / GEOPACKAGE_FILE, campaign_geopackage(campaign))
    return rows


def without_rasters(rows: Iterable[RasterRow]) -> list[str]:
    """Which visits have no rasters, and why: a sentence for each reason."""
    reasons = by_key((row.no_rasters, f"{row.plot} {row.date}") for row in rows if row.no_rasters)
    return [f"no rasters of {listed(visits)}: {reason}" for reason, visits in reasons.items()]


def _copied(campaign: Campaign, visit: Visit, folder: Path) -> tuple[RasterRow, tuple[Span, ...]]:
    """A visit's rasters copied into a folder: its row, and the spans of their colours."""
    import rasterio
    from rasterio.errors import RasterioError

    notes = "; ".join(visit.notes)
    canopy, surface = names = [f"{plot_file_name(visit.plot)}_{visit.date}_{name}" for name in _FILES]
    try:
        files = visit_files(campaign.folder, visit)
        if any(name not in files for name in _FILES):
            reason = visit.error or visit.no_rasters or "evaluated without rasters"
            return RasterRow(visit.plot, visit.date, no_rasters=reason, notes=notes), ()
        spans, tags = [], dict[str, str]()
        for name, file in zip(names, _FILES, strict=True):
            with rasterio.open(files[file]) as raster:
                heights = raster.read(1, masked=True).filled(np.nan)
                spans.append(color_span(heights, canopy=file == CANOPY_FILE))
                epsg = None if raster.crs is None else raster.crs.to_epsg()
                cell_m, tags = float(raster.res[0]), {**tags, **raster.tags()}
            shutil.copyfile(files[file], folder / name)
        frame = load_evaluation_report(campaign.folder / visit.folder).plots[0].frame
    except (MetadataError, RasterioError) as error:
        for name in names:
            (folder / name).unlink(missing_ok=True)
        return RasterRow(visit.plot, visit.date, no_rasters=f"cannot be read: {error}", notes=notes), ()
    datum = "" if frame is None or frame.origin is None else frame.origin.datum
    refused = tags.get(REFUSED_TAG, "")
    return RasterRow(visit.plot, visit.date, canopy, surface, epsg, cell_m, datum, refused, notes=notes), tuple(spans)
