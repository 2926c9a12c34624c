"""`fieldkit export-mission` as a function: mission files, their record, their route as GeoJSON, and a picture."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fieldkit.clouds.cloud import Cloud
from fieldkit.errors import MetadataError, UsageError
from fieldkit.figures.style import format_length, format_seconds
from fieldkit.files import write_atomic
from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.export import Routed, RoutedFlight, route_plan
from fieldkit.missions.export_passes import foreseen, passes_over, route_passes
from fieldkit.missions.export_record import geojson_bytes, mission_record
from fieldkit.missions.files.formats import FORMATS, mission_bytes, read_mission_bytes
from fieldkit.missions.files.limits import APPS, MOST_WAYPOINTS
from fieldkit.missions.settings import MissionSettings
from fieldkit.regular_files import check_replaceable, read_regular
from fieldkit.results.mission import (
    MISSION_FILE,
    FlownPlan,
    MissionPasses,
    MissionRecord,
    Shot,
    Via,
    load_mission,
    record_bytes,
    record_path,
)
from fieldkit.results.plan import Plan, Plans, station_number
from fieldkit.results.plan_file import PLAN_FILE, load_plan, plan_bytes
from fieldkit.routing.flights import FileCapacity
from fieldkit.routing.motion import FlightTime
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.sites.placement import SiteFrame
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.sites.plot_plants import heights_taken, with_plant_height
from fieldkit.sites.plots_file import load_plots
from fieldkit.sites.site import Site
from fieldkit.sites.site_file import load_site, named_plots, with_plots
from fieldkit.sites.site_obstacles import without_plots
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit.wording import count


@dataclass(frozen=True, eq=False)
class ExportedMission:
    """What was written."""

    routed: Routed
    files: tuple[Path, ...]
    """Mission files first, one per flight in order; then mission.json, routes, fitted plans, the picture."""
    plans: Mapping[str, Path] = field(default_factory=dict)
    """By plot, files of plans that are its own."""


def export_mission(
    plan: Path | str | Plans,
    vehicle: str | Path | Vehicle,
    site: Path | str | Site,
    output: Path | str,
    settings: MissionSettings | None = None,
    context: Context | None = None,
    *,
    plots: Path | str | None = None,
    plot_id: str | None = None,
    picture: bool = True,
    plans: bool = True,
    overwrite: bool = False,
) -> ExportedMission:
    """Write a plan as missions that a vehicle flies over every plot of a site.

    Everything is computed before anything is written. Several flights are numbered: mission-1.plan, mission-2.plan …
    Beside them mission.json (`fieldkit.results.mission`) says what is flown: NAME.mission.json for another name.

    Args:
        plan: plan.json, its folder, or a plan; or each plot's own plan by its name.
        output: the mission file; its suffix may be left out.
        settings: choices; None takes the defaults. It is an error where no plot says how high its plants are, and the
            settings do not either (`with_plant_height`). Fitted plans (`flown_plans`) are written, those of plots alike
            once, as MISSION-PLOT.json by the first one: `evaluate --plan` and `check` have to be given these.
        context: to whom progress is told.
        plots: in place of the site's, with ``plot_id`` as the field of their ids.
        picture: draw all flights from above and from the side.
        plans: write the plans of plots that have their own.

    Raises:
        UsageError: no such format, another format's suffix, or a file is there.
        MetadataError: a file that is given cannot be used.
        MissionError: see `route_plan`; or the vehicle's dialect or the format does not take the mission.
        StorageError: the place is full or not writable.
    """
    settings, progress = settings or MissionSettings(), (context or Context()).progress
    plan = Path(plan) if isinstance(plan, str) else plan
    site = Path(site) if isinstance(site, str) else site
    plots = None if plots is None else Path(plots)
    output, format = mission_file(Path(output), settings.format)  # noqa: A001
    loaded, again = _loaded(plan)
    profile = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    place = site if isinstance(site, Site) else load_site(site, plots, plot_id)
    if isinstance(site, Site) and plots is not None:
        place = with_plots(site, load_plots(plots, plot_id))
    if settings.only is not None:
        place = with_plots(place, named_plots(place, settings.only))
    stated, place = place, with_plant_height(place, loaded, settings.plant_height)
    routed = route_for_files(
        loaded, profile, place, format, settings, progress, None if again is None else again.passes
    )
    routed = replace(routed, fit=(*heights_taken(stated, place, settings.plant_height), *routed.fit))
    stem = output.stem
    first, written = dict[int, str](), dict[str, Path]()
    for plot, own in routed.own.items() if plans else ():
        written[plot] = output.with_name(f"{stem}-{plot_file_name(first.setdefault(id(own), plot))}.json")
    more = {written[plot]: plan_bytes(routed.own[plot]) for plot in first.values()}
    if picture:
        more[output.with_suffix(".png")] = picture_bytes(routed, place, profile)
    if again is None:
        flown = flown_plans(plan, loaded, place, routed.own, written)
    else:
        flown = {each.name: again.plots[0].plan for each in place.plots}
    files = write_mission(
        routed,
        profile,
        place,
        output,
        format,
        plans=flown,
        more=more,
        overwrite=overwrite,
        profile=None if isinstance(vehicle, Vehicle) else Path(vehicle).name,
    )
    return ExportedMission(routed, files, written)


def _loaded(plan: Path | Plans) -> tuple[Plans, MissionRecord | None]:
    """A plan, and the record of the mission that is flown again where that was given in a plan's place."""
    if not isinstance(plan, Path):
        return plan, None
    if not plan.name.endswith(MISSION_FILE):
        return load_plan(plan, patterns=True), None
    record = load_mission(plan)
    if record.passes is None:
        raise MetadataError(
            "is no mission of passes", path=plan, remedy="Give the plan that it was exported from, to fly it again."
        )
    return Plan(fieldkit=record.fieldkit, pattern=record.passes.pattern), record


def route_for_files(
    plan: Plans,
    vehicle: Vehicle,
    site: Site,
    format: str,  # noqa: A002
    settings: MissionSettings,
    progress: Progress | None = None,
    passes: MissionPasses | None = None,
) -> Routed:
    """As `route_plan` or `route_passes`, with the time that the files take and the length of their way.

    Both are as check-mission tells them. Files take some seconds more than the flights that are planned: holds in whole
    seconds and the like. ``passes`` are flown again, on the same lines; a pattern without them is laid anew.
    """
    suffix = FORMATS[format][0]

    def timed(each: RoutedFlight) -> RoutedFlight:
        """A flight with the time and length of its file, carried out as it is read."""
        read = read_mission_bytes(mission_bytes(format, each.mission, vehicle), suffix)
        flown = interpret(replace(read, home=read.home or each.mission.home), vehicle, vehicle.dialect)
        flight = replace(each.flight, time=FlightTime.of(flown.seconds, vehicle), length_m=flown.length_m)
        return foreseen(replace(each, flight=flight), flown, site, vehicle)

    if format in MOST_WAYPOINTS:
        most = min(MOST_WAYPOINTS[format], vehicle.max_items or MOST_WAYPOINTS[format])
        capacity = FileCapacity(most, f"waypoints that {APPS[format]} takes", a_stop=1, a_flight=2)
    else:
        capacity = FileCapacity(vehicle.max_items, a_stop=FileCapacity(None).a_stop + 2 * (settings.burst - 1))
    if isinstance(plan, Plan) and plan.pattern is not None:
        return route_passes(
            passes or passes_over(plan.pattern, site, vehicle),
            vehicle,
            site,
            adjust=settings.adjust,
            only=settings.lines and [number - 1 for number in settings.lines],
            capacity=capacity,
            timed=timed,
        )
    if settings.lines is not None:
        raise UsageError("--lines is for patterns: stations have none", remedy="Leave it out.")
    return route_plan(
        plan,
        vehicle,
        site,
        fit=settings.fit,
        adjust=settings.adjust,
        seed=settings.seed,
        burst=settings.burst,
        capacity=capacity,
        timed=timed,
        progress=progress,
    )


def mission_file(output: Path, format: str | None) -> tuple[Path, str]:  # noqa: A002
    """The mission file, also given without its suffix, and its format: what is asked for, the suffix's, or "plan"."""
    suffixes = {suffix: name for name, (suffix, _) in FORMATS.items()}
    form = format or suffixes.get(output.suffix.lower(), "plan")
    if form not in FORMATS:
        raise UsageError(f"no such format: {form}", remedy=f"Choose one of {', '.join(FORMATS)}.")
    suffix = FORMATS[form][0]
    if output.suffix and output.suffix != suffix:
        raise UsageError(
            f"{form} missions are {suffix} files", path=output, remedy=f"Name it {output.with_suffix(suffix).name}."
        )
    return output.with_suffix(suffix), form


def write_mission(
    routed: Routed,
    vehicle: Vehicle,
    site: Site,
    output: Path,
    format: str,  # noqa: A002
    *,
    plans: Mapping[str, FlownPlan],
    profile: str | None = None,
    more: Mapping[Path, bytes] | None = None,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Write mission files, one per flight in order, mission.json, routes, and what is added; none where one is there.

    Args:
        plans: by plot, what is flown there.
        profile: the vehicle profile's name, or that of its file.
        more: other files that are written beside them.
    """
    names = _names(output, len(routed.flights))
    flown = [(file, each.mission) for file, each in zip(names, routed.flights, strict=True)]
    missions = {file: mission_bytes(format, mission, vehicle) for file, mission in flown}
    others = {
        file.with_suffix(".geojson"): geojson_bytes(each) for file, each in zip(names, routed.flights, strict=True)
    }
    others |= more or {}
    described = {file.name: content for file, content in (missions | others).items()}
    record = mission_record(routed, site, vehicle, profile, [file.name for file in names], plans, described)
    contents = {**missions, record_path(output): record_bytes(record), **others}
    for file in contents:
        check_replaceable(file, overwrite=overwrite)
    for file, content in contents.items():
        write_atomic(file, content)
    return tuple(contents)


def flown_plans(
    given: Path | Plans,
    loaded: Plans,
    site: Site,
    own: Mapping[str, Plan] | None = None,
    written: Mapping[str, Path] | None = None,
) -> dict[str, FlownPlan]:
    """By plot, the plan that is flown there: a file that was given as its bytes are, others as they are written.

    Args:
        given: the plan, its file or that file's folder; or plots' plans.
        loaded: the same, read.
        own: plans of plots that are not flown by that one.
        written: the files that these are written to.
    """
    files = written or {}
    known = dict[int, FlownPlan]()
    for plot, plan in (own or {}).items():
        if id(plan) not in known:
            known[id(plan)] = _flown_plan(plan_bytes(plan), files[plot].name if plot in files else None)
    found = {plot: known[id(plan)] for plot, plan in (own or {}).items()}
    if isinstance(given, Path):
        file = given / PLAN_FILE if given.is_dir() else given
        one = _flown_plan(read_regular(file), file.name)
    elif isinstance(loaded, Plan):
        one = _flown_plan(plan_bytes(loaded), None)
    else:
        return found
    return {plot.name: one for plot in site.plots} | found


def _flown_plan(data: bytes, name: str | None) -> FlownPlan:
    return FlownPlan(name=name, sha256=hashlib.sha256(data).hexdigest())


def picture_bytes(routed: Routed, site: Site, vehicle: Vehicle) -> bytes:
    """PNG of all flights over a site: all of it, and the first plot more closely."""
    from fieldkit.pictures.mission import draw_mission  # these bring Matplotlib along
    from fieldkit.pictures.panels import png

    frame = SiteFrame(site.home)
    outlines = [np.array(frame.outline(corners)) for corners in site.fence]
    outlines += [np.array(volume.footprint) for volume in without_plots(site, 0.0)]
    outlines += [np.array(outline.exterior.coords)[:-1] for outline in site.outlines.values()]
    title = (
        f"{site.name}: {count(routed.photographs, 'photograph')}, {format_length(routed.length_m)}, "
        f"{format_seconds(routed.time_s)} from take-off to landing"
    )
    shots = [stop for each in routed.flights for stop in each.mission.stops if not isinstance(stop, Via)]
    of = [shot.plot if isinstance(shot, Shot) else shot.name for shot in shots]
    first = of[0]
    near = next((k for k, name in enumerate(of) if name != first), len(of))
    figure = draw_mission(
        title,
        routed.legs(),
        routed.cameras(site),
        vehicle.camera,
        Cloud(routed.plants),
        outlines,
        near=near,
        near_plants=Cloud(routed.plants_of.get(first, np.zeros((0, 3)))),
        stations=[str(station_number(shot.station)) for shot in shots if isinstance(shot, Shot)],
        plots=of,
        home=np.zeros(2),
    )
    return png(figure)


def _names(output: Path, flights: int) -> list[Path]:
    if flights == 1:
        return [output]
    width = len(str(flights))
    return [output.with_stem(f"{output.stem}-{number:0{width}}") for number in range(1, flights + 1)]
