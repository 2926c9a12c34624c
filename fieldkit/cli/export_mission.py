"""fieldkit export-mission."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from fieldkit.cli.boundary import finding_entry
from fieldkit.cli.common import (
    MISSION,
    RUN,
    SEED,
    VEHICLE,
    JsonOption,
    MissionOutputOption,
    OverwriteOption,
    PlotIdOption,
    PlotsOption,
    answer,
    emit_json,
    line_numbers,
    say,
    show,
    table,
    tell_fit,
)
from fieldkit.cli.options import Panels
from fieldkit.cli.reconstruction_options import run_context
from fieldkit.figures.style import format_length, format_seconds
from fieldkit.missions.settings import MissionSettings
from fieldkit.wording import by_key, count, listed

if TYPE_CHECKING:
    from fieldkit.missions.export_mission import ExportedMission

SETTINGS: Panels = {
    "Options": {
        **MISSION,
        "fit": Option("--fit/--no-fit"),
        "burst": Option(metavar="K", min=1, max=30),
        "lines": Annotated[str | None, Option(metavar="LINE[,LINE…]", parser=line_numbers)],
    },
    RUN: {"seed": SEED},
}


def command(
    plan: Path,
    vehicle: Annotated[str, VEHICLE],
    site: Annotated[Path, Option()],
    output: MissionOutputOption,
    settings: Annotated[MissionSettings, SETTINGS],
    plots: PlotsOption = None,
    plot_id: PlotIdOption = None,
    no_picture: bool = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a plan as missions that a vehicle flies over the plots of a site.

    Photographs have the plan's heading and gimbal pitch, each after standing still; legs keep clear of the plots'
    plants, whose height has to be known, of fences and obstacles; several flights are numbered where one battery does
    not do. Beside them mission.json says what is flown where; each route is written as GeoJSON, and one picture of all
    flights is drawn. Whatever is unsafe or out of reach is an error; where a plot is sloping, larger or planted
    otherwise than the plan's, that is said.

    Args:
        plan: plan.json, or the folder that holds it; or mission.json of passes, to fly the same lines again.
        site: Site file: home, plots, fence, obstacles.
        no_picture: Do not draw the flights.

    Examples:
        fieldkit export-mission maize-plan --vehicle ardupilot-pitch --site site.toml -o mission.plan
        fieldkit export-mission maize-plan --vehicle ardupilot-pitch --site site.toml --plant-height 1.6 -o mission.plan
        fieldkit export-mission maize-plan --vehicle px4-gimbal --site site.toml --plots plots.gpkg --fit -o field
        fieldkit export-mission maize-plan --vehicle dji-mini-4-pro --site site.toml --format litchi --adjust -o field
    """
    from fieldkit.missions.export_mission import export_mission
    from fieldkit.sites.site_file import load_site

    place = load_site(site, plots, plot_id, tell=None if as_json else say)
    with run_context(as_json=as_json) as context:
        done = export_mission(
            plan, vehicle, place, output, settings, context, picture=not no_picture, overwrite=overwrite
        )
    if as_json:
        emit_json(_facts(done))
    else:
        _answer(done)
        tell_fit(done.routed)
        _tell_fitted(done)
        _show_flights(done)


def _facts(done: ExportedMission) -> dict[str, object]:
    routed = done.routed
    return {
        "stations": routed.stations,
        "photographs": routed.photographs,
        "length_m": routed.length_m,
        "time_s": routed.time_s,
        **({"bursts_s": routed.bursts_s} if routed.photographs > routed.stations else {}),
        "files": list(done.files),
        "flights": [
            {
                "file": file,
                "photographs": each.photographs,
                "plots": list(each.flight.plots),
                "length_m": each.flight.length_m,
                "time_s": each.flight.time.total_s,
                "battery": each.flight.time.battery,
            }
            for file, each in zip(done.files, routed.flights, strict=False)
        ],
        "lowest_m": routed.lowest_m,
        "nearest_plant_m": routed.plants_m,
        "clear_of_plants_m": routed.least_clear_m,
        "plants": [{"plot": plot, "clear_m": clear_m} for plot, clear_m in routed.clear_m.items()],
        "moved": [str(each) for each in routed.moved],
        "fit": [finding_entry(each) for each in routed.fit],
        "fitted": [own.fit.model_dump() | {"plot": plot} for plot, own in routed.own.items() if own.fit is not None],
    }


def _tell_fitted(done: ExportedMission) -> None:
    """Which plans are fitted to which plots."""
    routed = done.routed
    for names in by_key((id(own), name) for name, own in routed.own.items()).values():
        flown = routed.own[names[0]]
        assert flown.fit is not None
        factors = {"high": flown.fit.height, "far along": flown.fit.length, "far across": flown.fit.width}
        changed = ", ".join(f"{by:.2f} times as {what}" for what, by in factors.items() if abs(by - 1.0) > 1e-9)
        file = done.plans[names[0]].name
        answer(f"Fitted to {listed(names)}: plants {changed}; evaluate their photographs with --plan {file}.")


def _answer(done: ExportedMission) -> None:
    routed = done.routed
    plants = _plants([*routed.clear_m.values()], routed.plants_m)
    in_the_air = (
        f"{count(routed.photographs, 'photograph')}, {format_length(routed.length_m)} and "
        f"{format_seconds(routed.time_s)} from take-off to landing, "
        f"{count(len(routed.flights), 'battery', 'batteries')}; lowest camera {format_length(routed.lowest_m)} above "
        f"the ground; {plants}."
    )
    if routed.passes is not None:
        lines = {shot.line for each in routed.flights for shot in each.mission.passings}
        answer(
            f"{count(len(lines), 'line')} over {count(len(routed.clear_m), 'plot')} at "
            f"{routed.passes.speed_mps:.2f} m/s: {in_the_air}"
        )
        return
    plots = len({shot.plot for each in routed.flights for shot in each.mission.shots})
    answer(f"{count(routed.stations // plots, 'station')} on {count(plots, 'plot')}: " + in_the_air)
    mission = routed.flights[0].mission
    if mission.burst > 1:
        more = format_seconds(routed.bursts_s)
        answer(f"{mission.burst} photographs per station, {mission.interval_s:g} s apart: {more} more in the air.")


def _show_flights(done: ExportedMission) -> None:
    rows = [
        (
            file.name,
            str(len(each.flight.plots)),
            str(each.photographs),
            format_length(each.flight.length_m),
            format_seconds(each.flight.time.total_s),
            f"{each.flight.time.battery:.0%}",
        )
        for file, each in zip(done.files, done.routed.flights, strict=False)
    ]
    flights = table("Flights", ["flight", "plots>", "photographs>", "length>", "time>", "battery>"], rows)
    show(flights, "Battery: share of its usable time, reserve left out.", *done.files)


def _plants(clear_m: Sequence[float | None], nearest_m: float | None) -> str:
    heights = sorted({round(each, 2) for each in clear_m if each is not None})
    if None in clear_m:
        return "not checked against plants"
    each_plots = f"each plot's plants, {heights[0]:.2f}" if len(heights) > 1 else "plants up"
    nearest = "" if nearest_m is None else f", the nearest {format_length(nearest_m)} away"
    return f"clear of {each_plots} to {format_length(heights[-1])} high{nearest}"
