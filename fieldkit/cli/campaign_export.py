"""fieldkit campaign export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from typer import Option

from fieldkit.cli.common import CampaignArgument, DebugOption, JsonOption, OverwriteOption, emit_json, say
from fieldkit.wording import count

Format = Literal["csv", "geojson", "gpkg"]


def command(
    output: Annotated[Path, Option("--output", "-o", help="File to write: .csv, .geojson or .gpkg.")],
    folder: CampaignArgument = None,
    format_: Annotated[Format | None, Option("--format", help="Where the file's name does not say it.")] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Write a campaign's table for spreadsheets (CSV) or QGIS (GeoPackage, GeoJSON).

    One row or feature per plot and date, at the plot's polygon or point, with rank, scores, plant figures, errors and
    notes. The GeoPackage has a second layer, plots, with each plot's latest figures.

    Examples:
        fieldkit campaign export season -o season.gpkg
        fieldkit campaign export -o season.csv --overwrite

    Exit codes:
        0  done
        2  wrong usage, or the file exists already
        3  a file of the campaign cannot be used

    See Also:
        fieldkit campaign show, fieldkit report
    """
    from fieldkit.campaign.export import export_campaign
    from fieldkit.campaign.reading import campaign_folder, read_campaign

    campaign = read_campaign(campaign_folder(folder))
    written = export_campaign(campaign, output, format_=format_, overwrite=overwrite)
    if as_json:
        emit_json({"output": output, "format": written, "visits": len(campaign.visits), "plots": len(campaign.plots)})
    else:
        say(f"{output}: {count(len(campaign.visits), 'visit')} of {count(len(campaign.plots), 'plot')}")
