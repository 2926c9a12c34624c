"""fieldkit check-mission."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from fieldkit.cli.common import (
    DebugOption,
    FitOption,
    JsonOption,
    PlotIdOption,
    PlotsOption,
    emit_json,
    say,
    vehicles_like,
)
from fieldkit.cli.mission_findings import finding_entries, show_findings, station_entry
from fieldkit.errors import EXIT_OK, MissionError, UsageError
from fieldkit.figures.style import format_length, format_seconds
from fieldkit.wording import count

if TYPE_CHECKING:
    from fieldkit.missions.files.read_mission import ReadMission
    from fieldkit.missions.findings import Report
    from fieldkit.sites.site import Site
    from fieldkit.vehicles.vehicle import Vehicle


def command(
    file: Annotated[Path, Argument(help="A .plan, .waypoints, .kmz (DJI WPML) or Litchi .csv file.")],
    vehicle: Annotated[
        str, Option("--vehicle", autocompletion=vehicles_like, help="Vehicle profile: a name or a TOML file.")
    ],
    plan: Annotated[Path | None, Option("--plan", help="plan.json: compare the photographs with its stations.")] = None,
    site: Annotated[
        Path | None, Option("--site", help="Site file: check legs against its fence, zones and obstacles.")
    ] = None,
    plots: PlotsOption = None,
    plot_id: PlotIdOption = None,
    fit: FitOption = None,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> int:
    """Check a mission file: what it would photograph, and what speaks against flying it.

    The items are carried out as the vehicle's autopilot does, also in files that other programs wrote. Ends with exit
    code 5 where there is an error.

    Examples:
        fieldkit check-mission plot.plan --vehicle ardupilot-pitch --plan plan.json --site site.toml
        fieldkit check-mission from_qgc.waypoints --vehicle ./my_drone.toml --json

    Exit codes:
        0  no errors
        2  wrong usage
        3  a file cannot be used
        5  there are errors: the mission must not be flown

    See Also:
        fieldkit export-mission, fieldkit upload
    """
    for option, given in (("--plan", plan), ("--plots", plots)):
        if given is not None and site is None:
            raise UsageError(
                f"{option} says nothing without --site", remedy="Give the site file that says where home is."
            )
    from fieldkit.documents.mistaken import check_order
    from fieldkit.missions.check import check_mission
    from fieldkit.missions.files.reading import read_mission
    from fieldkit.sites.site_file import load_site
    from fieldkit.vehicles.vehicle_file import load_vehicle

    if plan is not None and site is not None:
        check_order(plan, site)
    flown_by = load_vehicle(vehicle)
    read = read_mission(file)
    place = None if site is None else load_site(site, plots, plot_id, tell=None if as_json else say)
    report = check_mission(read, flown_by) if place is None else _on_site(read, flown_by, plan, place, fit)
    if as_json:
        emit_json({"file": file, "format": read.format, "vehicle": flown_by.title, **_facts(report)})
    else:
        _show(report, file)
    return EXIT_OK if report.ok else MissionError.exit_code


def _facts(report: Report) -> dict[str, Any]:
    deviations = {d.photograph: d for d in report.deviations}
    poses = []
    for shot in report.photographs:
        near = deviations.get(shot.station)
        poses.append({
            "photograph": shot.station + 1,
            **station_entry(None if near is None else near.planned),
            "item": shot.item,
            "taken": not shot.never,
            "latitude_deg": None if shot.place is None else shot.place.latitude_deg,
            "longitude_deg": None if shot.place is None else shot.place.longitude_deg,
            "height_above_home_m": None if shot.place is None else shot.place.height_m,
            "heading_deg": shot.heading_deg,
            "pitch_deg": shot.pitch_deg,
            "moving": shot.moving,
            "settled_s": shot.settled_s,
            "after_s": shot.after_s,
            "planned": None if near is None else near.planned.name,
            "off_plan_m": None if near is None else near.metres,
        })  # fmt: skip
    return {
        "ok": report.ok,
        "photographs": len(report.taken),
        "findings": finding_entries(report.findings),
        "poses": poses,
        "length_m": report.length_m,
        "time_s": report.seconds,
    }


def _show(report: Report, file: Path) -> None:
    if report.findings:
        show_findings(report.findings, file)
    if report.deviations:
        farthest = max(report.deviations, key=lambda d: d.metres)
        those = count(len(report.deviations), "photograph matches", "photographs match")
        say(f"{those} the plan, at most {format_length(farthest.metres)} off")
    errors = sum(finding.severity == "error" for finding in report.findings)
    verdict = "may be flown" if report.ok else f"must not be flown: {count(errors, 'error')}"
    taken = count(len(report.taken), "photograph")
    way = f"{format_length(report.length_m)} and about {format_seconds(report.seconds)} from take-off to landing"
    say(f"{file.name}: {taken}, {way}; {verdict}")


def _on_site(read: ReadMission, vehicle: Vehicle, plan: Path | None, site: Site, fit: bool | None) -> Report:
    """A check against the plan's photographs, as near as the vehicle comes to them, and all that the site says."""
    from fieldkit.missions.check import check_mission
    from fieldkit.results.plan_file import load_plan
    from fieldkit.sites.fitted import flown_plans
    from fieldkit.sites.placement import grounds_m, home_of, place
    from fieldkit.sites.reach import nearest
    from fieldkit.sites.site_obstacles import site_obstacles

    plans = None if plan is None else flown_plans(load_plan(plan), site.plots, fit)
    obstacles = site_obstacles(site, vehicle.clearance_m, plans)
    shots, moved = nearest(() if plans is None else place(plans, site), site, vehicle, obstacles)
    return check_mission(
        read, vehicle, planned=shots, grounds=grounds_m(site, shots).tolist(), obstacles=obstacles,
        origin=home_of(site), moved=moved,
    )  # fmt: skip
