"""fieldkit campaign init, show and export."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from typer import Option

from fieldkit.cli.common import (
    CampaignArgument,
    JsonOption,
    OverwriteOption,
    PlotIdOption,
    PlotsOption,
    VehicleOption,
    answer,
    campaign_folder,
    emit_json,
    say,
    show,
)
from fieldkit.cli.reconstruction_options import RECONSTRUCTION, TiesOption, with_ties
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.wording import count


def campaign_init(
    folder: Path,
    plan: Annotated[Path, Option()],
    site: Annotated[Path, Option()],
    *,
    plots: PlotsOption = None,
    plot_id: PlotIdOption = None,
    vehicle: VehicleOption = None,
    camera: Annotated[Path | None, Option("--camera-file")] = None,
    reference: Annotated[list[str] | None, Option(metavar="PLOT=REF")] = None,
    settings: Annotated[EvaluationSettings, RECONSTRUCTION],
    ties: TiesOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make a campaign: a folder that carries one plan from plot to plot and from date to date.

    Holds campaign.toml (every setting, to be edited), copies of the plan, the site and its plots, and the vehicle's
    profile. `fieldkit evaluate CAPTURES` in it sorts photographs into plots and dates and scores them. To add plots,
    edit plots.geojson there.

    Args:
        folder: The campaign's folder: new, or empty.
        plan: plan.json, or its folder: flown over every plot.
        site: Site file: home, fence, plots.
        camera: camera.toml for photographs that have none beside them.
        reference: A plot's own reference. May be given several times.

    Examples:
        fieldkit campaign init season --plan plan/plan.json --site field.toml --plots plots.gpkg
        fieldkit campaign init season --plan plan --site field.toml --vehicle px4-gimbal --rasters
    """
    _ = settings.wanted_rasters  # refuses what is not installed
    from fieldkit.campaign.create import CampaignSources, init_campaign, split_references
    from fieldkit.sites.site_file import load_site
    from fieldkit.wording import count

    references = {}
    if reference:
        references = split_references(reference, [plot.name for plot in load_site(site, plots, plot_id).plots])
    sources = CampaignSources(plan, site, plots, vehicle, camera, references, plot_id)
    made = init_campaign(folder, sources, with_ties(settings, ties), tell=None if as_json else say)
    if as_json:
        emit_json(
            {
                "output": folder,
                "campaign": made.name,
                "plots": [plot.name for plot in made.plots],
                "stations": len(made.plan.stations),
                "references": sorted(references),
            }
        )
    else:
        answer(f"{folder}: {count(len(made.plots), 'plot')}, {count(len(made.plan.stations), 'station')} each")
        answer(f"Next: fieldkit evaluate CAPTURES --campaign {folder}")


def campaign_show(
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
    from fieldkit.figures.terminal import rendered

    show([f"{verdict(campaign)[0]}.\n", *rendered(campaign_tables(campaign), most_rows=MOST_SHOWN)], *remarks(campaign))


def campaign_export(
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
        from fieldkit.campaign.export import export_rasters, without_rasters

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
