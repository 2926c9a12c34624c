"""The mission that flies some stations of a plan again. They keep the numbers that they have in the plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fieldkit.errors import UsageError
from fieldkit.files import write_atomic
from fieldkit.missions.export import Routed, route_plan
from fieldkit.missions.files.writing import FORMATS, mission_bytes
from fieldkit.missions.mission import Mission, Shot
from fieldkit.missions.plan_site.site import Site
from fieldkit.missions.plan_site.site_file import load_site, with_plots
from fieldkit.missions.plan_site.vehicle import Vehicle
from fieldkit.missions.plan_site.vehicle_file import load_vehicle
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import load_plan


def write_refly(
    stations: Sequence[int],
    plan: Path | Plan,
    vehicle: str | Path | Vehicle,
    site: Path | Site,
    output: Path,
    *,
    plot: str | None = None,
    format: str = "plan",  # noqa: A002
    adjust: bool = False,
    overwrite: bool = False,
    seed: int = 0,
) -> tuple[Path, ...]:
    """Write missions of a part of a plan's stations, each with its route as GeoJSON, over one plot of a site.

    Args:
        stations: numbers in the plan, from 0.
        plan: plan.json, its folder, or a plan.
        vehicle: a profile's name or file, or a profile.
        site: a site file, or a site.
        output: the mission file; its suffix may be left out.
        plot: of the site; None takes the only one.
        format: as `fieldkit.missions.export_mission.export_mission`.
        adjust: fly the nearest poses where the vehicle cannot take the plan's.
        overwrite: replace files that are there.
        seed: of the search for the order.

    Raises:
        UsageError: no stations, one that the plan does not have, no such plot or format, or a file is there.
        MetadataError: a file that is given cannot be used.
        MissionError: see `fieldkit.missions.export.route_plan`; stations are named by the plan's numbers.
        StorageError: the place is full or not writable.
    """
    if format not in FORMATS:
        raise UsageError(f"no such format: {format}", remedy=f"Choose one of {', '.join(FORMATS)}.")
    suffix = FORMATS[format][0]
    if output.suffix and output.suffix != suffix:
        raise UsageError(
            f"{format} missions are {suffix} files", path=output, remedy=f"Name it {output.with_suffix(suffix).name}."
        )
    loaded = plan if isinstance(plan, Plan) else load_plan(plan)
    profile = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    place = _one_plot(site if isinstance(site, Site) else load_site(site), plot)
    routed = route_plan(part_of_plan(loaded, stations), profile, place, adjust=adjust, seed=seed)
    contents: dict[Path, bytes] = {}
    for number, mission in enumerate(_missions(routed, sorted(set(stations))), 1):
        stem = output.stem if len(routed.flights) == 1 else f"{output.stem}-{number}"
        file = output.with_name(stem + suffix)
        contents[file] = mission_bytes(format, mission, profile)
        contents[file.with_suffix(".geojson")] = mission_bytes("geojson", mission, profile)
    for file in contents:
        if file.exists() and not overwrite:
            raise UsageError("exists already", path=file, remedy="Give --overwrite to replace it, or another name.")
    for file, content in contents.items():
        write_atomic(file, content)
    return tuple(contents)


def part_of_plan(plan: Plan, stations: Sequence[int]) -> Plan:
    """The plan with these of its stations only, in its order.

    Raises:
        UsageError: no stations, or one that the plan does not have.
    """
    chosen = sorted(set(stations))
    if not chosen:
        raise UsageError("there is no station to fly again", remedy="Nothing needs to be written.")
    if chosen[0] < 0 or chosen[-1] >= len(plan.stations):
        raise UsageError(
            f"the plan has no station {chosen[0] if chosen[0] < 0 else chosen[-1]}",
            remedy=f"Its stations are 0 to {len(plan.stations) - 1}.",
        )
    return plan.model_copy(update={"stations": tuple(plan.stations[k] for k in chosen)})


def _one_plot(site: Site, name: str | None) -> Site:
    if name is None:
        if len(site.plots) > 1:
            raise UsageError(f"the site has {len(site.plots)} plots", remedy="Say with --plot which is flown again.")
        return site
    plot = next((each for each in site.plots if each.name == name), None)
    if plot is None:
        raise UsageError(f"the site has no plot {name!r}", remedy="Name one of the site file's plots.")
    return with_plots(site, [plot])


def _missions(routed: Routed, numbers: Sequence[int]) -> list[Mission]:
    """The flights' missions, with the whole plan's numbers."""
    return [
        replace(
            each.mission,
            name=f"{each.mission.name}, again",
            stops=tuple(
                replace(stop, station=numbers[stop.station]) if isinstance(stop, Shot) else stop
                for stop in each.mission.stops
            ),
        )
        for each in routed.flights
    ]
