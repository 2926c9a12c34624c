"""fieldkit check-mission."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from fieldkit.cli.boundary import finding_entry
from fieldkit.cli.common import (
    VEHICLE,
    FitOption,
    JsonOption,
    SiteOptions,
    answer,
    emit_json,
    plant_height,
    say,
    show,
    show_findings,
    table,
)
from fieldkit.errors import EXIT_OK, MissionError, UsageError
from fieldkit.figures.style import format_length, format_seconds
from fieldkit.wording import count, listed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import RenderableType

    from fieldkit.missions.coverage import Coverage
    from fieldkit.missions.findings import Report
    from fieldkit.missions.ground import Ground


def command(
    file: Path,
    vehicle: Annotated[str, VEHICLE],
    plan: Path | None = None,
    *,
    place: SiteOptions,
    height: Annotated[Any, Option("--plant-height", metavar="METRES", parser=plant_height)] = None,
    burst: Annotated[int | None, Option(metavar="K", min=1)] = None,
    fit: FitOption = None,
    as_json: JsonOption = False,
) -> int:
    """Check a mission file: what it would photograph, and what speaks against flying it.

    The items are carried out as the vehicle's autopilot does, also in files that other programs wrote. Plants fill each
    plot's outline up to plant_height_m, also of plots that are not flown; leaves of a plan may make it higher. What is
    not checked against plants is never said to be fit to fly.

    Args:
        file: A .plan, .waypoints, .kmz (DJI WPML) or Litchi .csv file.
        plan: plan.json: compare the photographs with its stations.
        height: Height of the highest plants of all plots; or "unknown", where plots do not say theirs, for 30 % more
            than the plan's. Without: plant_height_m of the plots.
        burst: Photographs per station. Without: as most have.

    Examples:
        fieldkit check-mission plot.plan --vehicle ardupilot-pitch --plan plan.json --site site.toml
        fieldkit check-mission from_qgc.waypoints --vehicle ./my_drone.toml --json
    """
    from fieldkit.cli.progress import open_progress
    from fieldkit.missions.check import check_on_ground
    from fieldkit.missions.files.formats import read_mission
    from fieldkit.missions.ground import ground_of
    from fieldkit.results.plan_file import load_plan
    from fieldkit.vehicles.vehicle_file import load_vehicle

    site, flown_by = place.load(tell=None if as_json else say), load_vehicle(vehicle)
    read = read_mission(file)
    with open_progress(as_json=as_json):
        ground = ground_of(
            file,
            site,
            flown_by.clearance_m,
            plans=None if plan is None else load_plan(plan),
            fit=fit,
            plant_height=height,
        )
        if plan is not None and ground is None:
            raise UsageError("--plan says nothing without --site", remedy="Give the site file that says where home is.")
        report = check_on_ground(read, flown_by, ground, compare=plan is not None, burst=burst)
    if as_json:
        emit_json({"file": file, "format": read.format, "vehicle": flown_by.title, **_facts(report, ground)})
    else:
        _show(report, file)
    unknown = report.may_be_flown is None and ground is not None
    return EXIT_OK if report.ok and not unknown else MissionError.exit_code


def _facts(report: Report, ground: Ground | None) -> dict[str, Any]:
    from fieldkit.results.plan import station_number

    deviations, cover = {d.photograph: d for d in report.deviations}, report.coverage
    shown = () if cover is None else zip(report.taken, cover.lines, cover.plots, strict=True)
    seen = {shot.station: (line, plots) for shot, line, plots in shown}
    poses = []
    for shot in report.photographs:
        near, (line, plots) = deviations.get(shot.station), seen.get(shot.station, (None, ()))
        poses.append(
            {
                "photograph": shot.station + 1,
                "plot": None if near is None else near.planned.plot,
                "station": None if near is None else station_number(near.planned.station),
                "item": shot.item,
                "taken": not shot.never,
                "latitude_deg": None if shot.place is None else shot.place.latitude_deg,
                "longitude_deg": None if shot.place is None else shot.place.longitude_deg,
                "height_above_home_m": None if shot.place is None else shot.place.height_m,
                "heading_deg": shot.heading_deg,
                "pitch_deg": shot.pitch_deg,
                "time_s": shot.time_s,
                "line": None if line is None else line + 1,
                "plots": plots,
                "speed_mps": shot.speed_mps,
                "moving": shot.moving,
                "settled_s": shot.settled_s,
                "after_s": shot.after_s,
                "planned": None if near is None else near.planned.name,
                "off_plan_m": None if near is None else near.metres,
            }
        )
    return {
        "ok": report.may_be_flown,
        "checked_against_plants": report.unchecked == {},
        "plants": _plants(report, ground),
        "photographs": len(report.taken),
        "findings": [finding_entry(finding) for finding in report.findings],
        "poses": poses,
        "coverage": None
        if cover is None
        else {
            "plots": dict(cover.photographs),
            "overlap_along": cover.along,
            "overlap_between": cover.between,
            "interval_s": cover.interval_s,
            "blur_px": cover.blur_px,
        },
        "length_m": report.length_m,
        "time_s": report.seconds,
    }


def _show(report: Report, file: Path) -> None:
    taken = count(len(report.taken), "photograph") + (f", {report.burst} per station" if report.burst > 1 else "")
    way = f"{format_length(report.length_m)} and about {format_seconds(report.seconds)} from take-off to landing"
    answer(f"{file.name}: {taken}, {way}; {_verdict(report)}")
    if report.deviations:
        farthest = max(report.deviations, key=lambda d: d.metres)
        those = count(len(report.deviations), "photograph matches", "photographs match")
        answer(f"{those} the plan, at most {format_length(farthest.metres)} off")
    if report.coverage is not None and report.coverage.blur_px is not None:
        show(_in_flight(report.coverage))
    if report.findings:
        show_findings(report.findings, file)


def _in_flight(cover: Coverage) -> Iterator[RenderableType]:
    """Of photographs in flight."""
    from fieldkit.figures.style import DASH, decimal, percent

    numbers = sorted(cover.photographs.values())
    each = DASH if not numbers else f"{numbers[0]} to {numbers[-1]}"
    row = (
        str(len({*cover.lines} - {None})),
        percent(cover.along, 0),
        percent(cover.between, 0),
        decimal(cover.interval_s),
        decimal(cover.blur_px, 1),
        each,
    )
    columns = ("lines>", "along, %>", "between, %>", "apart, s>", "blur, px>", "photographs of a plot>")
    return table("Photographs in flight: least overlap and time, most blur", columns, [row])


def _plants(report: Report, ground: Ground | None) -> list[dict[str, Any]]:
    """By plot, whether it is checked against its plants."""
    if ground is None:
        return []
    heights = {plot.name: plot.plant_height_m for plot in ground.site.all_plots}
    unchecked = report.unchecked or {}
    return [
        {
            "plot": name,
            "plant_height_m": heights.get(name),
            "checked": name not in unchecked,
            "why_not": unchecked.get(name),
        }
        for name in dict.fromkeys([*heights, *unchecked])
    ]


def _verdict(report: Report) -> str:
    from fieldkit.missions.ground import NO_PLOTS

    if report.may_be_flown is None:
        unchecked = report.unchecked
        return f"not checked against plants: {NO_PLOTS if unchecked is None else listed(list(unchecked))}"
    errors = sum(finding.severity == "error" for finding in report.findings)
    return "may be flown" if report.may_be_flown else f"must not be flown: {count(errors, 'error')}"
