"""A campaign's height models in one folder, to be opened in QGIS: named by plot and date, in the same colours."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from fieldkit.campaign.export import campaign_geopackage
from fieldkit.campaign.reading import Campaign, visit_files
from fieldkit.documents.csv_text import csv_text
from fieldkit.errors import MetadataError, UsageError
from fieldkit.evaluation.rasters import (
    CANOPY_FILE,
    REFUSED_TAG,
    SURFACE_FILE,
    color_span,
    require_rasters,
    write_style,
)
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.results.report_files import load_evaluation_report
from fieldkit.results.visit import CAMPAIGN_FILE, Visit
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.wording import by_key, listed

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
