"""The mission that flies some stations of a plan again. They keep the numbers that they have in the plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fieldkit.fieldcheck.check import plot_of
from fieldkit.missions.export import Routed
from fieldkit.missions.export_mission import flown_plans, mission_file, route_for_files, write_mission
from fieldkit.missions.settings import MissionSettings
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import load_plan
from fieldkit.routing.mission import Mission, Shot
from fieldkit.sites.fitted import flown_plan
from fieldkit.sites.plot_plants import with_plant_height
from fieldkit.sites.site import Site
from fieldkit.sites.site_file import load_site, with_plots
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.vehicles.vehicle_file import load_vehicle


def write_refly(
    stations: Sequence[int],
    plan: Path | Plan,
    vehicle: str | Path | Vehicle,
    site: Path | Site,
    output: Path,
    settings: MissionSettings,
    *,
    plot: str | None = None,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Write missions of a part of a plan's stations over one plot of a site: mission.json and routes beside them.

    Args:
        stations: indices in the plan, from 0.
        settings: as of `fieldkit.missions.export_mission`.
    """
    output, format = mission_file(output, settings.format)  # noqa: A001
    loaded = plan if isinstance(plan, Plan) else load_plan(plan)
    profile = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    whole = with_plant_height(site if isinstance(site, Site) else load_site(site), loaded, settings.plant_height)
    chosen = plot_of(whole, plot)
    flown = flown_plan(loaded, chosen, settings.fit)
    own = {} if flown is loaded else {chosen.name: flown}
    place = with_plots(whole, [chosen]).model_copy(update={"name": f"{whole.name}, again"})
    numbers = sorted(set(stations))
    part = flown.model_copy(update={"stations": tuple(flown.stations[k] for k in numbers)})
    routed = route_for_files(part, profile, place, format, replace(settings, fit=False))
    return write_mission(
        _renumbered(routed, numbers),
        profile,
        place,
        output,
        format,
        plans=flown_plans(plan, loaded, place, own),
        overwrite=overwrite,
        profile=None if isinstance(vehicle, Vehicle) else Path(vehicle).name,
    )


def _renumbered(routed: Routed, numbers: Sequence[int]) -> Routed:
    """The flights with the whole plan's numbers."""

    def numbered(mission: Mission) -> Mission:
        stops = (replace(s, station=numbers[s.station]) if isinstance(s, Shot) else s for s in mission.stops)
        return replace(mission, stops=tuple(stops))

    return replace(routed, flights=tuple(replace(each, mission=numbered(each.mission)) for each in routed.flights))
