"""fieldkit campaign show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from fieldkit.cli.common import CampaignArgument, JsonOption, campaign_folder, emit_json, show


def command(
    folder: CampaignArgument = None,
    measured: Annotated[Path | None, Option(metavar="CSV")] = None,
    as_json: JsonOption = False,
) -> None:
    """Show a campaign: its plots and dates, which plots are best, and what changed over the dates.

    Ranks are by chamfer distance, measured against the plot's own reference or predicted without one. Plots that differ
    less than the figures scatter share a rank. Changes are told from noise where that is known.

    Args:
        measured: Heights by hand: plot, date, height_m. Kept for later, and reports.

    Examples:
        fieldkit campaign show season
        fieldkit campaign show season --measured heights.csv
        fieldkit campaign show --json
    """
    folder = campaign_folder(folder)
    from fieldkit.campaign.overview import MOST_SHOWN, campaign_object, campaign_tables, remarks, verdict
    from fieldkit.campaign.reading import read_campaign

    campaign = read_campaign(folder)
    if measured is not None:
        from fieldkit.campaign.measured import keep_measured

        keep_measured(measured, campaign)
    if as_json:
        emit_json(campaign_object(campaign))
        return
    from fieldkit.figures.terminal.blocks import rendered

    show([f"{verdict(campaign)[0]}.\n", *rendered(campaign_tables(campaign), most_rows=MOST_SHOWN)], *remarks(campaign))
