"""The mission that flies some stations of a plan again. They keep the numbers that they have in the plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fieldkit.errors import UsageError
from fieldkit.missions.export import Routed
from fieldkit.missions.export_mission import (
    flown_plans,
    mission_file,
    route_for_files,
    write_mission,
)
from fieldkit.results.plan import Plan, station_number
from fieldkit.results.plan_file import load_plan
from fieldkit.routing.mission import Mission, Shot
from fieldkit.sites.fitted import flown_plan
from fieldkit.sites.site import Site
from fieldkit.sites.site_file import load_site, with_plots
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit.wording import listed


def write_refly(
    stations: Sequence[int],
    plan: Path | Plan,
    vehicle: str | Path | Vehicle,
    site: Path | Site,
    output: Path,
    *,
    plot: str | None = None,
    format: str | None = None,  # noqa: A002
    fit: bool | None = None,
    adjust: bool = False,
    burst: int = 1,
    overwrite: bool = False,
    seed: int = 0,
) -> tuple[Path, ...]:
    """Write missions of a part of a plan's stations over one plot of a site: mission.json and routes beside them.

    Args:
        stations: indices in the plan, from 0.
        plot: of the site; None takes the only one.
        fit: whether the plan was fitted to the plot, as of `fieldkit.missions.export_mission.export_mission`.
    """
    output, format = mission_file(output, format)  # noqa: A001
    loaded = plan if isinstance(plan, Plan) else load_plan(plan)
    profile = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    place = _one_plot(site if isinstance(site, Site) else load_site(site), plot)
    flown = flown_plan(loaded, place.plots[0], fit)
    own = {} if flown is loaded else {place.plots[0].name: flown}
    place = place.model_copy(update={"name": f"{place.name}, again"})
    routed = route_for_files(
        part_of_plan(flown, stations), profile, place, format, fit=False, adjust=adjust, seed=seed, burst=burst
    )
    return write_mission(
        _renumbered(routed, sorted(set(stations))), profile, place, output, format,
        plans=flown_plans(plan, loaded, place, own), overwrite=overwrite,
        profile=None if isinstance(vehicle, Vehicle) else Path(vehicle).name,
    )  # fmt: skip


def part_of_plan(plan: Plan, stations: Sequence[int]) -> Plan:
    """The plan with these of its stations only, in its order."""
    chosen = sorted(set(stations))
    if not chosen:
        raise UsageError("there is no station to fly again", remedy="Nothing needs to be written.")
    if chosen[0] < 0 or chosen[-1] >= len(plan.stations):
        raise UsageError(
            f"the plan has no station {station_number(chosen[0] if chosen[0] < 0 else chosen[-1])}",
            remedy=f"Its stations are 1 to {len(plan.stations)}.",
        )
    return plan.model_copy(update={"stations": tuple(plan.stations[k] for k in chosen)})


def _one_plot(site: Site, name: str | None) -> Site:
    if name is None:
        if len(site.plots) > 1:
            raise UsageError(f"the site has {len(site.plots)} plots", remedy="Say with --plot which is flown again.")
        return site
    plot = next((each for each in site.plots if each.name == name), None)
    if plot is None:
        known = listed([each.name for each in site.plots], 40)
        raise UsageError(f"the site has no plot {name!r}", remedy=f"Its plots are {known}.")
    return with_plots(site, [plot])


def _renumbered(routed: Routed, numbers: Sequence[int]) -> Routed:
    """The flights with the whole plan's numbers."""

    def numbered(mission: Mission) -> Mission:
        stops = (replace(s, station=numbers[s.station]) if isinstance(s, Shot) else s for s in mission.stops)
        return replace(mission, stops=tuple(stops))

    return replace(routed, flights=tuple(replace(each, mission=numbered(each.mission)) for each in routed.flights))
