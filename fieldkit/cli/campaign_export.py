"""fieldkit campaign export."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from typer import Option

from fieldkit.cli.common import CampaignArgument, JsonOption, OverwriteOption, answer, campaign_folder, emit_json
from fieldkit.wording import count


def command(
    output: Annotated[Path, Option("--output", "-o")],
    folder: CampaignArgument = None,
    rasters: bool = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a campaign's table for spreadsheets (CSV) or QGIS (GeoPackage, GeoJSON).

    One row or feature per plot and date, at the plot's polygon or point, with rank, scores, plant figures, errors and
    notes. The GeoPackage has a second layer, plots, with each plot's latest figures.

    With --rasters, OUTPUT is a folder with the height models of all visits of a campaign that makes them (campaign init
    --rasters, or rasters = true in campaign.toml), in the same colours, and the GeoPackage. rasters.csv has a row per
    visit, and says why one has none.

    Args:
        output: File to write: .csv, .geojson or .gpkg; with --rasters a folder.
        rasters: Canopy height and surface models of all plots and dates, in a folder for QGIS.

    Examples:
        fieldkit campaign export season -o season.gpkg
        fieldkit campaign export -o season.csv --overwrite
        fieldkit campaign export season -o season-maps --rasters
    """
    folder = campaign_folder(folder)
    from fieldkit.campaign.reading import read_campaign

    campaign = read_campaign(folder)
    counts = {"visits": len(campaign.visits), "plots": len(campaign.plots)}
    if rasters:
        from fieldkit.campaign.raster_export import export_rasters, without_rasters

        rows = export_rasters(campaign, output, overwrite=overwrite)
        if as_json:
            emit_json({"output": output, "format": "rasters", **counts, "rasters": [asdict(row) for row in rows]})
            return
        answer(f"{output}: rasters of {sum(not row.no_rasters for row in rows)} of {len(rows)} visits")
        for sentence in without_rasters(rows):
            answer(sentence)
        return
    from fieldkit.campaign.export import export_campaign

    written = export_campaign(campaign, output, overwrite=overwrite)
    if as_json:
        emit_json({"output": output, "format": written, **counts})
    else:
        answer(f"{output}: {count(counts['visits'], 'visit')} of {count(counts['plots'], 'plot')}")
