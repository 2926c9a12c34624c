"""From a pattern, a vehicle and a site to flights: lines over the field, clear of everything, split by battery."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.errors import UsageError
from fieldkit.missions.autopilots.execution import Execution
from fieldkit.missions.coverage import coverage
from fieldkit.missions.export import Routed, RoutedFlight, mission_over, whole_way, with_less
from fieldkit.results.finding import Finding, Refused, Severity
from fieldkit.results.mission import GeoPoint, Home, MissionPasses, Passing, Shot, Via
from fieldkit.results.pattern import Pattern
from fieldkit.routing.flights import FileCapacity, Flight
from fieldkit.routing.legs import leg_of
from fieldkit.routing.motion import FlightTime
from fieldkit.routing.obstacles import Obstacles
from fieldkit.routing.passes import Line, PassFlight, fastest_mps, lines_over, pass_flights, rows_direction
from fieldkit.sites.fit import plants_known
from fieldkit.sites.placement import SiteFrame, ground_below, landing_of
from fieldkit.sites.plot_plants import plants_on
from fieldkit.sites.site import Site
from fieldkit.sites.site_obstacles import Canopy, site_obstacles
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.wording import listed

_TERRAIN_M = 0.2
"""Height by which a line may be off the ground's shape, metres: less would take a waypoint for every ripple."""


@dataclass(frozen=True, eq=False)
class _Placed:
    """A line where it is flown, site frame."""

    number: int
    """Of all lines of the pattern, from 0."""
    first: int
    """Number of its first photograph among those of all lines, from 0."""
    line: Line
    """With heights above home."""
    way_m: FloatArray
    """(k, 3) its waypoints."""
    ground_m: FloatArray
    """(n,) heights above home of the ground below its photographs."""


def passes_over(pattern: Pattern, site: Site, vehicle: Vehicle) -> MissionPasses:
    """A pattern over the plots of a site that are flown: over their convex hull, by the mean direction of rows."""
    hull = shapely.union_all(list(_flown_outlines(site).values())).convex_hull
    corners = np.array(hull.exterior.coords)[:-1]
    latitudes, longitudes, _ = SiteFrame(site.home).to_geodetic(np.column_stack([corners, np.zeros(len(corners))]))
    ring = tuple((round(a, 9), round(b, 9)) for a, b in zip(latitudes.tolist(), longitudes.tolist(), strict=True))
    rows_deg = rows_direction([plot.row_heading_deg for plot in site.plots])
    return MissionPasses(pattern=pattern, outline=ring, rows_deg=rows_deg, speed_mps=_speed(pattern, site, vehicle))


def _flown_outlines(site: Site) -> dict[str, shapely.Polygon]:
    """By plot that is flown."""
    outlines = site.outlines
    return {plot.name: outlines[plot.name] for plot in site.plots}


def _speed(pattern: Pattern, site: Site, vehicle: Vehicle) -> float:
    tallest_m = max((plot.plant_height_m or 0.0 for plot in site.plots), default=0.0)
    return min(pattern.speed_mps, fastest_mps(pattern, vehicle, tallest_m))


def route_passes(
    passes: MissionPasses,
    vehicle: Vehicle,
    site: Site,
    *,
    adjust: bool = False,
    only: Sequence[int] | None = None,
    capacity: FileCapacity,
    timed: Callable[[RoutedFlight], RoutedFlight],
) -> Routed:
    """Lay a pattern's lines over a field, and find the flights over them.

    Places on Earth follow from the pattern, the outline and the direction of rows alone. Heights follow the ground.

    Args:
        adjust: take the nearest pitch where the vehicle cannot take a look's.
        only: fly these lines, from 0.
        capacity: of each flight's mission.
        timed: gives a flight the time that its file takes.

    Raises:
        Refused: plants' heights are not known, a pitch is out of reach, or a leg meets what is kept clear of.
    """
    findings = [finding for plot in site.all_plots for finding in plants_known(None, plot)]
    looks = [replace(look, pitch_deg=vehicle.mount.nearest_deg(look.pitch_deg)) for look in passes.pattern.looks]
    for look, taken in zip(passes.pattern.looks, looks, strict=True):
        if not vehicle.mount.reaches(look.pitch_deg):
            message = f"a pitch of {look.pitch_deg:.1f}° is beyond the mount ({vehicle.mount.range_text})"
            remedy = f"Give --adjust to fly {taken.pitch_deg:g}°."
            findings.append(_finding("out-of-reach", message, remedy, severity="warning" if adjust else "error"))
    pattern = replace(passes.pattern, looks=tuple(looks))
    passes = passes.model_copy(update={"pattern": pattern, "speed_mps": _speed(pattern, site, vehicle)})
    _require(findings)
    placed = _placed(passes, site)
    if only is not None:
        if missing := sorted(set(only) - set(range(len(placed)))):
            raise UsageError(
                f"no such line: {listed([str(k + 1) for k in missing])}", remedy=f"Lines are 1 to {len(placed)}."
            )
        placed = [line for line in placed if line.number in only]
    obstacles = site_obstacles(site, vehicle.clearance_m)
    most = None
    if capacity.most is not None:
        most = max(1, (capacity.most - capacity.a_flight) // max(_counted(line, capacity, vehicle) for line in placed))
    planned_for = vehicle
    while True:
        parts = pass_flights([line.line for line in placed], planned_for, passes.speed_mps, (0.0, 0.0), most)
        routed = [
            timed(_flight([placed[k] for k in part.lines], part, number, len(parts), passes, site, vehicle))
            for number, part in enumerate(parts, 1)
        ]
        over = max(each.flight.time.battery for each in routed)
        if over <= 1.0 or all(len(part.lines) == 1 for part in parts):
            break
        planned_for = with_less(planned_for, over)
    if over > 1.0:
        findings.append(_finding("battery", "one line takes more than a battery"))
    ways = [np.array(each.flight.legs[0].points) for each in routed]
    findings += [finding for each in routed for finding in _met(whole_way(each.flight), obstacles)]
    _require(findings)
    known = {plot.name: plants_on(None, plot) for plot in site.all_plots}
    return Routed(
        flights=tuple(routed),
        moved=(),
        lowest_m=min(float((line.line.stations_m[:, 2] - line.ground_m).min()) for line in placed),
        plants_m=Canopy.of(site, None).nearest_m(ways),
        plants_of={},
        clear_m={name: None if plants is None else plants.clear_m for name, plants in known.items()},
        fit=tuple(findings),
        passes=passes,
    )


def foreseen(each: RoutedFlight, flown: Execution, site: Site, vehicle: Vehicle) -> RoutedFlight:
    """A flight with the photographs in passing that its file gives, carried out, in place of the planned ones."""
    taken = [(shot, shot.place) for shot in flown.photographs if shot.repeat is not None and shot.place is not None]
    lines = list(dict.fromkeys(passing.line for passing in each.mission.passings))
    if not lines or not taken:
        return each
    grounds = ground_below(site, [place for _, place in taken]).tolist()
    shots = [shot for shot, _ in taken]
    shown = coverage(shots, flown.legs, vehicle, SiteFrame(site.home), grounds, site).plots
    names = {plot.name for plot in site.plots}
    given = [
        Passing(
            *_numbers(place),
            lines[shot.repeat or 0],
            shot.heading_deg or 0.0,
            shot.pitch_deg or 0.0,
            tuple(name for name in plots if name in names),
            round(shot.time_s, 2),
        )
        for (shot, place), plots in zip(taken, shown, strict=True)
    ]
    planned, stops = Counter(passing.line for passing in each.mission.passings), list[Shot | Via | Passing]()
    for stop in each.mission.stops:
        if not isinstance(stop, Passing):
            stops.append(stop)
            continue
        planned[stop.line] -= 1
        while given and given[0].line == stop.line:
            stops.append(given.pop(0))
            if planned[stop.line]:  # what there is beyond the planned ones follows the last one
                break
    plots = tuple(dict.fromkeys(name for stop in stops if isinstance(stop, Passing) for name in stop.plots))
    return replace(each, foreseen=tuple(stops), flight=replace(each.flight, plots=plots))


def _require(findings: Sequence[Finding]) -> None:
    if any(finding.severity == "error" for finding in findings):
        raise Refused(findings)


def _finding(code: str, message: str, remedy: str = "", severity: Severity = "error") -> Finding:
    return Finding("", code, message, severity=severity, remedy=remedy)


def _placed(passes: MissionPasses, site: Site) -> list[_Placed]:
    """All lines. They are laid about the outline's first corner, wherever home is."""
    anchor, frame = SiteFrame(Home(*passes.outline[0])), SiteFrame(site.home)
    field = shapely.Polygon(anchor.outline(passes.outline))
    lines = lines_over(passes.pattern, field, passes.rows_deg)
    places = [np.vstack([line.stations_m, line.ends_m[1:]]) for line in lines]
    latitudes, longitudes, _ = anchor.to_geodetic(np.concatenate(places))
    whole = frame.to_local(latitudes, longitudes, 0.0)
    whole_ground = ground_below(site, [GeoPoint(a, b, 0.0) for a, b in zip(latitudes, longitudes, strict=True)])
    whole[:, 2] = whole_ground + passes.pattern.height_m
    cuts = np.cumsum([len(of_line) for of_line in places])[:-1]
    placed = list[_Placed]()
    for number, (line, local, grounds) in enumerate(
        zip(lines, np.split(whole, cuts), np.split(whole_ground, cuts), strict=True)
    ):
        along = np.linalg.norm(local[:, :2] - local[0, :2], axis=1)
        bends = shapely.get_coordinates(shapely.LineString(np.column_stack([along, local[:, 2]])).simplify(_TERRAIN_M))
        local[:, 2] = np.interp(along, *bends.T)
        way = local[np.isin(along, bends[:, 0])]
        first = placed[-1].first + len(placed[-1].ground_m) if placed else 0
        placed.append(_Placed(number, first, replace(line, stations_m=local[:-1]), way, grounds[:-1]))
    return placed


def _counted(line: _Placed, capacity: FileCapacity, vehicle: Vehicle) -> int:
    """Of what the capacity counts, for a line at most: two items for a waypoint and three more, or waypoints."""
    if vehicle.trigger.passing == "never":
        return capacity.a_stop * len(line.ground_m)
    return len(line.way_m) if capacity.a_stop == 1 else 2 * len(line.way_m) + 3


def _flight(
    placed: Sequence[_Placed],
    part: PassFlight,
    number: int,
    count: int,
    passes: MissionPasses,
    site: Site,
    vehicle: Vehicle,
) -> RoutedFlight:
    by = vehicle.trigger.passing
    stops = [stop for line in placed for stop in _stops(line, site, stands=by == "never")]
    first, last = placed[0].way_m[0], placed[-1].way_m[-1]
    takeoff_m, end_m = max(site.takeoff_m, float(first[2])), max(site.transit_m, float(last[2]))
    landing = np.array([*landing_of(site)[:2], end_m])
    places = np.vstack([[0.0, 0.0, takeoff_m], *(line.way_m for line in placed), landing])
    leg = leg_of(places, vehicle.speeds)
    along_m = passes.pattern.along_m
    mission = replace(
        mission_over(stops, landing, number, count, site, vehicle),
        takeoff_m=takeoff_m,
        speed_mps=passes.speed_mps,
        spacing_m=0.0 if by == "time" else along_m,
        every_s=along_m / passes.speed_mps if by == "time" else 0.0,
    )
    time = FlightTime.of(part.seconds, vehicle)
    return RoutedFlight(mission, Flight((), (leg,), (), leg.length_m, time))


def _stops(line: _Placed, site: Site, *, stands: bool) -> list[Shot | Via | Passing]:
    """A line's waypoints with the photographs between them; or where it ``stands``, stations."""
    frame, of = SiteFrame(site.home), line.line
    places = [_numbers(place) for place in frame.places(of.stations_m)]
    if stands:
        return [
            Shot.at(GeoPoint(*place), of.yaw_deg, of.pitch_deg, plot, line.first + k)
            for k, (place, plot) in enumerate(zip(places, _aimed_at(line, site), strict=True))
        ]
    stops: list[Shot | Via | Passing] = []
    vias = [Via(*_numbers(place)) for place in frame.places(line.way_m)]
    along, bends = (np.linalg.norm(p[:, :2] - line.way_m[0, :2], axis=1) for p in (of.stations_m, line.way_m))
    for place, metres in zip(places, along, strict=True):
        stops += [vias[k] for k in np.flatnonzero(bends == metres)]
        stops.append(Passing(*place, line.number, of.yaw_deg, of.pitch_deg))
    return [*stops, vias[-1]]


def _aimed_at(line: _Placed, site: Site) -> list[str]:
    """The plots nearest to what a line's photographs point at."""
    of, outlines = line.line, _flown_outlines(site)
    yaw, down = np.radians(of.yaw_deg), np.radians(-of.pitch_deg)
    ahead = (of.stations_m[:, 2] - line.ground_m)[:, None] / np.tan(down) * (np.sin(yaw), np.cos(yaw))
    nearest = shapely.STRtree(list(outlines.values())).nearest(shapely.points(of.stations_m[:, :2] + ahead))
    return [list(outlines)[k] for k in nearest.tolist()]


def _numbers(place: GeoPoint) -> tuple[float, float, float]:
    """Of a place, as far as they mean something."""
    return round(place.latitude_deg, 9), round(place.longitude_deg, 9), round(place.height_m, 4)


def _met(whole: FloatArray, obstacles: Obstacles) -> list[Finding]:
    """What a flight meets, from the ground to the ground."""
    findings = []
    for k in np.flatnonzero(obstacles.blocked(whole[:-1], whole[1:])).tolist():
        for problem in obstacles.leg_problems(whole[k], whole[k + 1])[:1]:
            remedy = "Fly higher: plan passes for this vehicle and these plants."
            if problem.kind != "plants":
                remedy = "Move home, correct the site file, or leave plots out (--only)."
            findings.append(_finding("no-way", f"a line or turn {problem}", remedy))
    return findings
