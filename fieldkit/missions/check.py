"""Checking a mission: what it would photograph, where it would fly, and what speaks against it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fieldkit.errors import MissionError
from fieldkit.figures.style import format_seconds
from fieldkit.missions.autopilots.effects import Shoot, Stay, cannot_say
from fieldkit.missions.autopilots.execution import Execution, distance
from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.check_items import FAR_M, item_findings, place_findings
from fieldkit.missions.check_photographs import (
    adjusted_findings,
    burst_findings,
    coverage_findings,
    deviations,
    photograph_findings,
    plan_findings,
    usual_burst,
)
from fieldkit.missions.coverage import coverage
from fieldkit.missions.files.limits import APPS, LEAST_WAYPOINTS, LONGEST_STAY_S, MOST_WAYPOINTS
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.files.wpml import dji_model
from fieldkit.missions.findings import Report, error, warning
from fieldkit.missions.ground import Ground, ground_of
from fieldkit.results.finding import Finding
from fieldkit.routing.mission import NO_FENCE, Fence, GeoPoint, Home, Shot
from fieldkit.routing.obstacles import Obstacles, Volume
from fieldkit.sites.placement import SiteFrame, ground_below, grounds_m, place
from fieldkit.sites.reach import Unreachable, nearest, needs_rtk
from fieldkit.sites.site import Site
from fieldkit.sites.site_obstacles import Canopy, site_obstacles
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit.wording import count, listed

_PROFILES: dict[str, str] = {"ardupilot": "ardupilot-pitch", "px4": "px4-gimbal"}
_NO_LEVEL = "how high above home it is flown is not known everywhere"
_OF_A_PROFILE = frozenset({
    "too-low", "endurance", "too-many-items", "pitch-limit", "no-settle", "short-settle", "short-delay"
})  # fmt: skip
"""Codes of findings that only a profile says."""
_MOST_LEG_FINDINGS = 50
"""Most findings about legs; the others are counted."""
_FILM_MM = 43.27
"""Diagonal of 35 mm film."""
_ZOOMED = 1.2
"""A focal length of so many times the camera's own is a zoom's: makers round theirs."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is known of the place that a mission is flown at, and of the photographs that it should take."""

    planned: Sequence[Shot] = ()
    """Photographs as they should be; nothing is compared without."""
    grounds: Sequence[float] = ()
    """Heights above home of the ground below these; home's own height where not given."""
    obstacles: Obstacles | None = None
    """That legs keep clear of, metres east and north of ``origin`` and above it, beside the file's own fence."""
    origin: Home | None = None
    """Home as the site has it; stands in for a home that the file lacks."""
    moved: Sequence[Unreachable] = ()
    """Of ``planned``, those that the vehicle cannot take and are the nearest poses that it can (`nearest`)."""
    unchecked: Mapping[str, str] | None = None
    """Plots whose plants are not among ``obstacles``, and why; None where no plots are known."""
    canopy: Canopy | None = None
    """The plants, in the obstacles' frame."""
    site: Site | None = None
    """Whose plots say where the ground is below other photographs; home's own height without."""


def check_mission(
    read: ReadMission, vehicle: Vehicle, around: Surroundings | None = None, *, burst: int | None = None
) -> Report:
    """Everything that can be said of a mission without flying it.

    Args:
        vehicle: that is to fly it; its dialect says how items are understood.
        around: where; None where nothing is known.
        burst: photographs that each station should have; None: as many as most have.
    """
    around = around or Surroundings()
    planned, origin, site, unchecked = around.planned, around.origin, around.site, around.unchecked
    if read.home is None and origin is not None:
        read = replace(read, home=origin)
    elif read.home is not None and origin is not None and origin.amsl_m is not None:
        read = replace(read, home=replace(read.home, amsl_m=origin.amsl_m))
    findings = [*read.remarks, *_fit(read, vehicle)]
    dialect = vehicle.dialect if vehicle.dialect != "dji" else read.firmware or "ardupilot"
    flown = interpret(read, vehicle, dialect)
    findings += [error("unknown-item", message, number) for number, message in flown.refused]
    if read.items:
        findings += item_findings(read, vehicle, dialect)
    findings += place_findings(read, origin)
    if site is not None and not all(math.isfinite(leg.end.height_m) for leg in flown.legs):
        unchecked = {plot.name: _NO_LEVEL for plot in site.all_plots} | dict(unchecked or {})
    places = {leg.item: leg.end for leg in flown.legs}
    home = origin or read.home
    burst = burst or usual_burst(flown.photographs)
    matched = deviations(flown.photographs, planned, home, burst) if planned and home is not None else ()
    above = dict(zip((shot.name for shot in planned), around.grounds, strict=False))
    at = {shot.station: shot.place for shot in flown.photographs if shot.place is not None}
    below = {} if site is None else dict(zip(at, ground_below(site, list(at.values())).tolist(), strict=True))
    below |= {d.photograph: above[d.planned.name] for d in matched if d.planned.name in above}
    findings += photograph_findings(flown, vehicle, places, below)
    findings += burst_findings(flown.photographs, matched, burst)
    cover = None
    if home is not None:
        taken = [shot for shot in flown.photographs if not shot.never]
        grounds = [below.get(shot.station, 0.0) for shot in taken]
        cover = coverage(taken, flown.legs, vehicle, _frame(home), grounds, site)
        findings += coverage_findings(cover, vehicle)
    findings += _stop_findings(read, vehicle)
    findings += _leg_findings(read, flown, around.obstacles, home)
    findings += _rtk_findings(flown, home, around.canopy, vehicle)
    usable = vehicle.battery.usable_s
    if flown.seconds > usable:
        message = (
            f"takes about {format_seconds(flown.seconds)}; a battery gives {format_seconds(usable)} with its reserve"
        )
        findings.append(error("endurance", message))
    if planned and home is not None:
        findings += plan_findings(matched, flown.photographs, planned)
        findings += adjusted_findings(matched, around.moved)
    findings += _unchecked_findings(unchecked or {})
    findings.sort(key=lambda f: (f.severity != "error", -1 if f.item is None else f.item, f.code))
    return Report(flown.photographs, tuple(findings), matched, flown.seconds, flown.length_m, unchecked, burst, cover)


def check_on_ground(
    read: ReadMission, vehicle: Vehicle, ground: Ground | None, *, compare: bool = False, burst: int | None = None
) -> Report:
    """`check_mission` on plots, as far as they are known.

    ``compare`` does so with the plans' photographs, as near as the vehicle comes to them; of every plot there has to be
    one.
    """
    if ground is None:
        return check_mission(read, vehicle, burst=burst)
    site, obstacles = ground.site, site_obstacles(ground.site, vehicle.clearance_m, ground.plans)
    shots, moved = nearest(place(ground.plans, site) if compare else (), site, vehicle, obstacles)
    around = Surroundings(
        planned=shots,
        grounds=grounds_m(site, shots).tolist(),
        obstacles=obstacles,
        origin=site.home,
        moved=moved,
        unchecked=ground.unchecked,
        canopy=Canopy.of(site, ground.plans),
        site=site,
    )
    report = check_mission(read, vehicle, around, burst=burst)
    return replace(report, findings=(*report.findings, *ground.taken))


def _rtk_findings(flown: Execution, home: Home | None, canopy: Canopy | None, vehicle: Vehicle) -> Iterator[Finding]:
    """What takes RTK: stations nearer to each other or to plants than the vehicle's GNSS holds."""
    if home is not None:
        places = _frame(home).points(p.place for p in flown.photographs if p.place and not p.never and not p.moving)
        stations = places[np.isfinite(places).all(axis=1)]
        near_m = math.inf if canopy is None else canopy.near_m(stations)
        yield from (warning("needs-rtk", why) for why in needs_rtk(stations, near_m, vehicle))


def _unchecked_findings(unchecked: Mapping[str, str]) -> Iterator[Finding]:
    for why in dict.fromkeys(unchecked.values()):
        plots = [plot for plot, reason in unchecked.items() if reason == why]
        yield warning("plants-unchecked", f"not checked against the plants of {listed(plots)}: {why}")


def _fit(read: ReadMission, vehicle: Vehicle) -> Iterator[Finding]:
    """Whether file and vehicle belong together."""
    if not read.items and not read.stops:
        yield error("empty", "the mission has no items")
    if (vehicle.dialect == "dji") != (read.firmware == "dji") and (read.items or read.stops):
        yield error("wrong-vehicle", f"{vehicle.title} does not fly {read.format} files")
    elif read.firmware not in (None, vehicle.dialect):
        yield warning("wrong-vehicle", f"the file was made for {read.firmware}, the vehicle is {vehicle.dialect}")
    if read.model is not None and vehicle.dialect == "dji":
        yield from _model_findings(read.model, vehicle)


def _model_findings(named: tuple[int | None, ...], vehicle: Vehicle) -> Iterator[Finding]:
    """Whether a file is for the profile's model and camera, where WPML has numbers for them."""
    try:
        known = dji_model(vehicle)
    except MissionError:
        return
    own = (*known.drone, known.payload)
    if any(number not in (None, mine) for number, mine in zip(named, own, strict=True)):
        theirs, ours = ("-".join("?" if n is None else str(n) for n in numbers) for numbers in (named, own))
        message = f"the file is for DJI's model and camera {theirs}, {vehicle.title} is {ours}"
        yield (error if named[0] not in (None, own[0]) else warning)("wrong-vehicle", message)


def _stop_findings(read: ReadMission, vehicle: Vehicle) -> Iterator[Finding]:
    count, app = len(read.stops), APPS.get(read.format, "DJI")
    if count and count < LEAST_WAYPOINTS.get(read.format, 0):
        least = LEAST_WAYPOINTS[read.format]
        yield error("too-few-waypoints", f"{app} takes missions of at least {least} waypoints; this one has {count}")
    if count > MOST_WAYPOINTS.get(read.format, count):
        most = MOST_WAYPOINTS[read.format]
        yield error("too-many-items", f"the mission has {count} waypoints; {app} takes at most {most}")
    longest = LONGEST_STAY_S.get(read.format, math.inf)
    camera = vehicle.camera
    own_mm = _FILM_MM * camera.fx / math.hypot(camera.width, camera.height)
    for stop in read.stops:
        for action in stop.actions:
            if isinstance(action, Stay) and action.seconds > longest:
                what = f"stays for {action.seconds:g} s; {app} pauses for at most {longest:g} s"
                yield error("long-stay", what, stop.number)
            elif isinstance(action, Shoot) and action.focal_mm > _ZOOMED * own_mm:
                what = f"a photograph at {action.focal_mm:g} mm, and the profile's camera has {own_mm:.0f} mm"
                yield error("unknown-item", cannot_say(f"waypoint {stop.number} has {what}"), stop.number)
        if stop.height_from != "home":
            what = f"its height is above the {stop.height_from}, not above take-off: what it comes to is not known"
            yield warning("datum", what, stop.number)


def _leg_findings(
    read: ReadMission, flown: Execution, obstacles: Obstacles | None, origin: Home | None
) -> Iterator[Finding]:
    """What the legs meet; every leg is tested along its whole length."""
    if origin is None:
        return
    frame = _frame(origin)
    everything = [] if obstacles is None else [obstacles]
    if read.fence != NO_FENCE:
        try:
            everything.append(_fence(read.fence, frame))
        except MissionError as refused:
            yield warning("fence", f"the file's fence cannot be checked: {refused.message}")
    ground = GeoPoint(origin.latitude_deg, origin.longitude_deg, 0.0)
    legs = [
        leg
        for leg in flown.legs
        if all(abs(e.height_m) <= FAR_M and distance(ground, e)[0] <= FAR_M for e in (leg.start, leg.end))
    ]  # those left out are spoken of elsewhere: another datum, or far from home
    if not legs:
        return
    starts, ends = (frame.points(getattr(leg, end) for leg in legs) for end in ("start", "end"))
    reported = left = 0
    for each in everything:
        for k in np.flatnonzero(each.blocked(starts, ends)):
            if reported >= _MOST_LEG_FINDINGS:
                left += 1
                continue
            for problem in each.leg_problems(starts[k], ends[k]):
                reported += 1
                item = legs[k].item
                yield error(_LEG_CODES[problem.kind], f"the leg to item {item} {problem}", item)
    if left:
        yield error("legs", f"{count(left, 'more leg meets', 'more legs meet')} something")


def _frame(home: Home) -> SiteFrame:
    """The frame of the obstacles; a height of home that is none on Earth is taken as not known."""
    amsl = home.amsl_m if home.amsl_m is not None and -1000.0 <= home.amsl_m <= 10_000.0 else None
    return SiteFrame(replace(home, amsl_m=amsl))


_LEG_CODES = {
    "plants": "leg-plants",
    "obstacle": "leg-obstacle",
    "no-fly zone": "leg-no-fly",
    "fence": "leg-fence",
    "ceiling": "leg-ceiling",
}


def _fence(fence: Fence, frame: SiteFrame) -> Obstacles:
    """A file's fence in the local frame."""
    zones = tuple(Volume.no_fly(f"{k} of the file", frame.outline(ring)) for k, ring in enumerate(fence.outside, 1))
    return Obstacles(zones, tuple(map(frame.outline, fence.inside)), ceiling_m=fence.ceiling_m)


def findings_by_dialect(
    read: ReadMission, vehicle: Vehicle | None = None, site: Site | None = None, *, file: Path | None = None
) -> dict[str, tuple[Finding, ...]]:
    """What speaks against flying a mission, by the autopilot that it may be for.

    Without a vehicle, what only its profile says is not looked at: its mount, its least height and battery, its times.
    Plots that cannot be checked against plants speak against it, too. The file's items count from 1
    (`ReadMission.behind_home`).
    """
    if vehicle is not None:
        return {vehicle.dialect: _findings(read, vehicle, site, file)}
    dialects = [name for name in _PROFILES if read.firmware in (None, name)] or list(_PROFILES)
    found = {name: _findings(read, load_vehicle(_PROFILES[name]), site, file) for name in dialects}
    return {name: tuple(f for f in findings if f.code not in _OF_A_PROFILE) for name, findings in found.items()}


def _findings(read: ReadMission, vehicle: Vehicle, site: Site | None, file: Path | None) -> tuple[Finding, ...]:
    found = check_on_ground(read, vehicle, ground_of(file, site, vehicle.clearance_m)).findings
    return tuple(replace(f, severity="error") if f.code == "plants-unchecked" else f for f in found)
