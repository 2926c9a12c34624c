"""fieldkit campaign plan."""

from __future__ import annotations

import datetime
from typing import Annotated

from typer import Option

from fieldkit.cli.common import (
    MISSION,
    RUN,
    SEED,
    CampaignArgument,
    JsonOption,
    MissionOutputOption,
    OverwriteOption,
    VehicleOption,
    campaign_folder,
    emit_json,
    show,
    table,
    tell_fit,
)
from fieldkit.cli.reconstruction_options import WorkersOption, run_context
from fieldkit.errors import UsageError
from fieldkit.missions.settings import MissionSettings


def command(
    output: MissionOutputOption,
    folder: CampaignArgument = None,
    *,
    date: Annotated[str, Option(metavar="DATE")] = "",
    growth: Annotated[float, Option(metavar="FACTOR")] = 1.15,
    vehicle: VehicleOption = None,
    settings: Annotated[MissionSettings, {"Options": MISSION, RUN: {"seed": SEED}}],
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Plan a campaign's next visit: new stations for every plot, from its own last visit.

    Each plot's last cloud is made taller and wider by an expected growth, and stations are chosen for it by the
    geometric score; nothing is photographed. Plots without a cloud get the campaign's plan. One mission over all plots
    is written as by export-mission. The plans are kept in the campaign, and `fieldkit evaluate` compares visits from
    that date on with them.

    Args:
        date: Of the visit, 2026-07-02; today where not given.
        growth: By which plants have grown since the last visit.

    Examples:
        fieldkit campaign plan season --date 2026-07-02 -o next.plan
        fieldkit campaign plan season --growth 1.3 --vehicle px4-gimbal -o next.plan
    """
    day, folder = _day(date), campaign_folder(folder)
    from fieldkit.campaign.next_visit import plan_next_visit
    from fieldkit.campaign.reading import read_campaign
    from fieldkit.runtime.threads import limit_threads

    limit_threads(1)
    campaign = read_campaign(folder)
    with run_context(as_json=as_json, workers=workers) as context:
        made = plan_next_visit(
            campaign, day, output, settings, context, vehicle=vehicle, growth=growth, overwrite=overwrite
        )
    if as_json:
        plots = [
            {
                "plot": each.plot,
                "made_of": each.date,
                "expected_m": each.expected_m,
                "carried_m": each.carried_m,
                "seconds": each.seconds,
            }
            for each in made.plans
        ]
        emit_json({"date": day, "files": list(made.mission.files), "plots": plots})
        return
    from fieldkit.figures.style import format_length

    tell_fit(made.mission.routed)

    rows = [
        (each.plot, each.date or "none: the campaign's plan", *map(format_length, (each.expected_m, each.carried_m)))
        for each in made.plans
    ]
    plans = table(f"Plans for {day}", ["plot", "last visit", "expected>", "campaign's plan there>"], rows)
    note = "Expected by the geometric score: it ranks sets of one plot, and is no chamfer distance."
    show(plans, note, *made.mission.files)


def _day(date: str) -> str:
    try:
        return (datetime.date.fromisoformat(date) if date else datetime.date.today()).isoformat()
    except ValueError as error:
        raise UsageError(f"--date: {date} is no date", remedy="Write it like --date 2026-07-02.") from error
