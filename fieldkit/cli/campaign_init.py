"""fieldkit campaign init."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from fieldkit.cli.common import (
    JsonOption,
    PlotIdOption,
    PlotsOption,
    VehicleOption,
    answer,
    emit_json,
    say,
)
from fieldkit.cli.reconstruction_options import RECONSTRUCTION, TiesOption, with_ties
from fieldkit.evaluation.settings import EvaluationSettings


def command(
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
