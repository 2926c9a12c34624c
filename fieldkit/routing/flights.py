"""From stops to flights: the order of plots and stations, legs clear of obstacles, as many flights as batteries take.

Plots are visited whole. Within a plot the tour over the stations is exact for every first and last station (Held and
Karp). The order of plots comes from PyVRP: as one closed tour and, where that does not fit into one battery, as routes
under the battery's limit; each is then cut into flights by exact dynamic programming over the stations that plots are
entered and left by, and the better one is taken. Between plots, to the first and from the last one the vehicle keeps
at least the transit height.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.errors import MissionError
from fieldkit.results.finding import Finding, Refused
from fieldkit.results.plan import station_number
from fieldkit.routing.legs import Leg, Place, leg_of, legs_between, no_way
from fieldkit.routing.motion import FlightTime, flight_time, landing_s, takeoff_s
from fieldkit.routing.obstacles import Obstacles
from fieldkit.routing.plot_tours import (
    Costs,
    Group,
    PlotTour,
    Split,
    Ways,
    plot_tour,
    representatives,
    split,
    turn_deg,
    ways_between,
)
from fieldkit.routing.tour import EXACT_PLACES, grouped_routes, ordered, shortest_tour
from fieldkit.runtime.progress import Advance, ignore
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.wording import by_key

AMONG_NEIGHBOURS = "among-neighbours"
"""Codes of a stop that is among the plants of its plot or of another, or nearer to them than the clearance."""

Given = TypeVar("Given")
Made = TypeVar("Made")


@dataclass(frozen=True)
class FileCapacity:
    """What the mission of one flight may hold."""

    most: int | None
    """Of what is counted; None for no limit."""
    what: str = "mission items that the vehicle stores"
    """For people."""
    a_stop: int = 5
    """Counted for a photograph; items are gimbal, heading, waypoint, shutter and delay. A place that is passed is 1."""
    a_flight: int = 10
    """Counted for take-off, home and landing, at most."""

    def spare(self, stops: int) -> float:
        """How many places may be passed in a flight over so many stops; negative where they alone are too many."""
        return math.inf if self.most is None else self.most - self.a_flight - self.a_stop * stops


@dataclass(frozen=True)
class Stop:
    """A place where one photograph is taken."""

    position_m: Place
    """East and north of home and height above it."""
    yaw_deg: float
    """Heading of the vehicle there, degrees in any range."""
    pause_s: float
    """Standing still: settling and exposure."""
    plot: str
    """That it is of; a plot's stops are flown one after the other."""
    station: int | None = None
    """Of the plot's plan, from 0; its place among the stops unless given."""


@dataclass(frozen=True)
class Flight:
    """What is flown on one battery."""

    stops: tuple[int, ...]
    """Indices of the stops in order."""
    legs: tuple[Leg, ...]
    """One more than stops: from above the take-off place, between stops, and to above the landing place."""
    plots: tuple[str, ...]
    """Names in order."""
    length_m: float
    """From the take-off's ground to the landing's."""
    time: FlightTime
    """Its parts and the share of a battery that it takes."""


def plan_flights(
    stops: Sequence[Stop],
    home: Place,
    landing: Place,
    obstacles: Obstacles,
    vehicle: Vehicle,
    *,
    takeoff_m: float,
    transit_m: float,
    seed: int = 0,
    capacity: FileCapacity | None = None,
    advance: Advance = ignore,
) -> tuple[Flight, ...]:
    """The flights over all stops: as few as battery and mission allow, of these short ones.

    Deterministic for a seed. Every stretch of every leg, and the ways straight up at home and down at the landing, are
    checked once more at the end, however they came about.

    Args:
        stops: one or more, of all plots.
        home: on the ground; legs start ``takeoff_m`` above it.
        landing: on the ground; legs end ``transit_m`` above it.
        obstacles: every leg is clear of them.
        vehicle: its speeds and battery.
        takeoff_m: height above home that is climbed to before anything else.
        transit_m: least height above home of the ways between plots and to and from them.
        seed: of the search for the order of plots.
        capacity: of each flight's mission; None for the items that the vehicle stores.
        advance: is told of plots whose tours are found, and of those with ways from take-off and to landing.
    """
    if not stops:
        raise MissionError("there are no stations to fly to", remedy="Give a plan with stations.")
    if against := objections(stops, home, landing, obstacles, takeoff_m=takeoff_m, transit_m=transit_m):
        raise Refused(against)
    names = [
        f"station {station_number(k if s.station is None else s.station)} of {s.plot}" for k, s in enumerate(stops)
    ]
    start, finish = _ends(home, landing, takeoff_m, transit_m)
    members = by_key((stop.plot, index) for index, stop in enumerate(stops))
    groups = [_group(plot, [stops[k] for k in rows], [names[k] for k in rows]) for plot, rows in members.items()]
    plots = _each(lambda group: plot_tour(group, obstacles, vehicle.speeds, seed=seed), groups, advance)
    ends = (_end("take-off", start), _end("landing", finish))
    field = _Field(plots, ends, obstacles, vehicle, transit_m, capacity or FileCapacity(vehicle.max_items), advance)
    flights = [_flight(field, order, list(members.values()), stops) for order in _flights_of_plots(field, seed)]
    _check(flights, obstacles)
    return tuple(flights)


def objections(
    stops: Sequence[Stop], home: Place, landing: Place, obstacles: Obstacles, *, takeoff_m: float, transit_m: float
) -> list[Finding]:
    """What speaks against stops, home and landing by themselves; arguments as of `plan_flights`."""
    found: list[Finding] = []

    def against(code: str, message: str, remedy: str) -> None:
        found.append(Finding("", code, message, severity="error", remedy=remedy))

    for what, height in (("take-off", takeoff_m), ("transit", transit_m)):
        if not height <= obstacles.highest_m:
            above = f"the {what} height of {height:g} m above home is above the ceiling of {obstacles.ceiling_m} m"
            against("height", above, "Fly lower, or correct the ceiling.")
    start, finish = _ends(home, landing, takeoff_m, transit_m)
    for name, ground, top in (("take-off", np.array(home), start), ("landing", np.array(landing), finish)):
        for problem in [p for p in obstacles.leg_problems(ground, top) if p.kind != "ceiling"][:1]:
            what = f"the {name}'s way between the ground and {top[2]:.2f} m {problem}"
            against("home", what, "Move it, or correct the site file.")
    places = np.array([stop.position_m for stop in stops], dtype=np.float64).reshape(-1, 3)
    found += [_objection(k, stops[k], obstacles) for k in np.flatnonzero(obstacles.blocked(places, places)).tolist()]
    return found


def _objection(index: int, stop: Stop, obstacles: Obstacles) -> Finding:
    """What a stop is in, and of plants from where it is clear."""
    problem = obstacles.leg_problems(stop.position_m, stop.position_m)[0]
    east, north, up = problem.place
    if problem.kind == "plants":
        top = obstacles.plants_top_m(problem.place)
        own = problem.name == stop.plot
        code = "among-plants" if own else AMONG_NEIGHBOURS
        where = (
            f"is {top - up:.2f} m too low over the plants of {problem.name}, which are kept clear of up to {top:.2f} m"
        )
        remedy = "Give --adjust to fly above them: the air below leaves counts as plants, too."
        if own:
            remedy = f"Plan for this vehicle (fieldkit plan --vehicle), or fit the plan to them (--fit). {remedy}"
    else:
        code, remedy = "in-obstacle", "Move it, or correct the site file."
        where = {
            "obstacle": f"is in {problem.name}, or nearer to it than the clearance",
            "no-fly zone": f"is in the no-fly zone {problem.name}, or nearer to it than the clearance",
            "fence": "is outside the fence, or nearer to it than the clearance",
            "ceiling": "is above the ceiling",
        }[problem.kind]
    return Finding(
        stop.plot,
        code,
        f"{where}: {east:.2f} m east, {north:.2f} m north, {up:.2f} m above home",
        severity="error",
        remedy=remedy,
        station=index if stop.station is None else stop.station,
    )


def _ends(home: Place, landing: Place, takeoff_m: float, transit_m: float) -> tuple[FloatArray, FloatArray]:
    """Where legs begin, and where they end."""
    return np.array([*home[:2], home[2] + takeoff_m]), np.array([*landing[:2], max(transit_m, landing[2])])


def _each(made: Callable[[Given], Made], of: Iterable[Given], advance: Advance) -> list[Made]:
    """What is made of each; what speaks against any is raised together."""
    found, against = list[Made](), list[Finding]()
    for each in of:
        try:
            found.append(made(each))
        except Refused as refused:
            against += refused.findings
        advance(1)
    if against:
        raise Refused(against)
    return found


class _Field:
    """Plots with their ways to each other and to both ends, made when first asked for."""

    def __init__(
        self,
        plots: Sequence[PlotTour],
        ends: tuple[Group, Group],
        obstacles: Obstacles,
        vehicle: Vehicle,
        transit_m: float,
        capacity: FileCapacity,
        advance: Advance,
    ) -> None:
        self.plots, self.ends, self.obstacles, self.vehicle, self.transit_m = plots, ends, obstacles, vehicle, transit_m
        self.capacity = capacity
        self._between: dict[tuple[int, int], Ways] = {}
        self.outward = _each(lambda plot: self._ways(ends[0], plot.group), plots, advance)
        self.homeward = _each(lambda plot: self._ways(plot.group, ends[1]), plots, advance)
        speeds = vehicle.speeds
        heights = (float(end.places[0, 2]) for end in ends)
        self.fixed_s = takeoff_s(next(heights), speeds) + landing_s(next(heights), speeds)
        self.limit_s = vehicle.battery.usable_s

    def between(self, one: int, other: int) -> Ways:
        """Ways from a plot's stations to another's."""
        if (one, other) not in self._between:
            self._between[one, other] = self._ways(self.plots[one].group, self.plots[other].group)
        return self._between[one, other]

    def costs(self, order: Sequence[int]) -> Costs:
        """Of everything that flights over these plots in order can be made of."""
        return Costs(
            [self.outward[plot].seconds[0] for plot in order],
            [self.plots[plot].seconds for plot in order],
            [self.between(a, b).seconds for a, b in pairwise(order)],
            [self.homeward[plot].seconds[:, 0] for plot in order],
            self.fixed_s,
        )

    def steps(self, order: Sequence[int]) -> list[tuple[Ways, int, int, int]]:
        """Per leg of the flight over these plots: the ways it is one of, its start and stop among them, and the plot
        that it leads to (−1: the landing).
        """
        _, doors = self.costs(order).ends(0, len(order) - 1)
        steps: list[tuple[Ways, int, int, int]] = []
        for k, (plot, (entry, exit_)) in enumerate(zip(order, doors, strict=True)):
            came = self.outward[plot] if k == 0 else self.between(order[k - 1], plot)
            steps.append((came, 0 if k == 0 else doors[k - 1][1], entry, plot))
            inner = self.plots[plot].order(entry, exit_)
            steps.extend((self.plots[plot].ways, a, b, plot) for a, b in pairwise(inner))
        return [*steps, (self.homeward[order[-1]], doors[-1][1], 0, -1)]

    def has_room(self, order: Sequence[int]) -> bool:
        """Whether there is capacity for the mission of a flight over these plots."""
        plots = [self.plots[plot] for plot in order]
        spare = self.capacity.spare(sum(len(plot.group) for plot in plots))
        if spare < 0 or math.isinf(spare):
            return spare > 0
        outer = [self.outward[order[0]], self.homeward[order[-1]], *(self.between(a, b) for a, b in pairwise(order))]
        inner = sum((len(plot.group) - 1) * plot.ways.most_vias for plot in plots)
        if spare >= inner + sum(ways.most_vias for ways in outer):
            return True
        return bool(spare >= sum(ways.legs.via_counts[ways.index(a, b)] for ways, a, b, _ in self.steps(order)))

    def _ways(self, a: Group, b: Group) -> Ways:
        ways = ways_between(a, b, self.obstacles, self.vehicle.speeds, level_m=self.transit_m)
        if np.isinf(ways.seconds).all():
            raise no_way(a.places[0], b.places[0], (a.names[0], b.names[0]), self.obstacles, self.transit_m)
        return ways


def _flights_of_plots(field: _Field, seed: int) -> list[list[int]]:
    """Per flight its plots in order."""
    count = len(field.plots)
    if too_much := [finding for plot in range(count) for finding in _too_much(field, plot)]:
        raise Refused(too_much)
    matrix = _plot_matrix(field)
    order = [plot - 1 for plot in shortest_tour(matrix, seed=seed)[1:]]
    found = [_cut(field, order)]
    if len(found[0][0].flights) > 1:
        service = [0.0, *(float(plot.seconds.min()) for plot in field.plots)]
        routes = grouped_routes(matrix, service, field.limit_s - field.fixed_s, seed=seed)
        found.append(_cut(field, [plot - 1 for route in routes for plot in route]))
    best, order = min(found, key=lambda one: one[0].rank)
    return [_improved(field, order[first : last + 1], matrix) for first, last in best.flights]


def _cut(field: _Field, order: list[int]) -> tuple[Split, list[int]]:
    cut = split(field.costs(order), field.limit_s, lambda first, last: field.has_room(order[first : last + 1]))
    if cut is None:
        raise MissionError("no plot fits into a battery")
    return cut, order


def _improved(field: _Field, order: list[int], matrix: FloatArray) -> list[int]:
    """A flight's plots in the best order for it alone, where that is quicker."""
    if not 2 < len(order) <= EXACT_PLACES:
        return order
    rows = np.array(order) + 1
    again = [order[k] for k in ordered(matrix[0, rows], matrix[np.ix_(rows, rows)], matrix[rows, 0])]
    last = len(order) - 1
    quicker = field.costs(again).ends(0, last)[0] < field.costs(order).ends(0, last)[0]
    return again if quicker and field.has_room(again) else order


def _plot_matrix(field: _Field) -> FloatArray:
    """(n + 1, n + 1) seconds between plots, by a station near the middle of each; 0 is take-off and landing."""
    places = np.vstack([field.ends[0].places, representatives(field.plots)])
    one, other = np.triu_indices(len(places), 1)
    legs = legs_between(places[one], places[other], field.obstacles, field.vehicle.speeds, level_m=field.transit_m)
    matrix = np.zeros((len(places), len(places)))
    matrix[one, other] = matrix[other, one] = legs.time_s
    matrix[1:, 0] = [ways.seconds.min() for ways in field.homeward]
    for a, b in np.argwhere(np.isinf(matrix))[:1]:
        names = [field.ends[0].names[0], *(plot.group.name for plot in field.plots)]
        raise no_way(places[a], places[b], (names[a], names[b]), field.obstacles, field.transit_m)
    return matrix


def _too_much(field: _Field, plot: int) -> Iterator[Finding]:
    """Why a plot does not fit into a flight of its own."""
    name = field.plots[plot].group.name
    seconds, _ = field.costs([plot]).ends(0, 0)
    if seconds > field.limit_s:
        yield Finding(
            name,
            "battery",
            f"takes {seconds:.0f} s alone, {2.0 * field.homeward[plot].seconds.min():.0f} s of it there and back, "
            f"{math.ceil(seconds - field.limit_s)} s more than the {field.limit_s:.0f} s of flight that a battery has "
            "beside its reserve",
            severity="error",
            remedy="Plan fewer stations, take off nearer to the plot, or use a vehicle with more endurance.",
        )
    if not field.has_room([plot]):
        yield Finding(
            name,
            "items",
            f"takes more than the {field.capacity.most} {field.capacity.what} alone",
            severity="error",
            remedy="Plan fewer stations.",
        )


def _flight(field: _Field, order: list[int], members: list[list[int]], stops: Sequence[Stop]) -> Flight:
    speeds = field.vehicle.speeds
    visited: list[int] = []
    legs: list[Leg] = []
    turns: list[float] = []
    heading = math.nan
    for ways, a, b, plot in field.steps(order):
        legs.append(leg_of(ways.legs.places(ways.index(a, b)), speeds))
        towards = math.nan
        if plot >= 0:
            visited.append(members[plot][b])
            towards = stops[visited[-1]].yaw_deg
        turns.append(turn_deg(heading, towards))
        heading = towards
    pauses = float(sum(stops[k].pause_s for k in visited))
    time = flight_time([leg.points for leg in legs], turns, pauses, field.vehicle)
    names = tuple(field.plots[plot].group.name for plot in order)
    upright = max(legs[0].points[0][2], 0.0) + max(legs[-1].points[-1][2], 0.0)
    return Flight(tuple(visited), tuple(legs), names, float(upright + sum(leg.length_m for leg in legs)), time)


def _group(plot: str, stops: Sequence[Stop], names: Sequence[str]) -> Group:
    return Group(
        plot,
        np.array([stop.position_m for stop in stops], dtype=np.float64),
        np.array([stop.yaw_deg for stop in stops]),
        tuple(names),
        float(sum(stop.pause_s for stop in stops)),
    )


def _end(name: str, place: FloatArray) -> Group:
    return Group(name, place[None], np.full(1, np.nan), (f"the {name}",))


def _check(flights: Sequence[Flight], obstacles: Obstacles) -> None:
    """See that every stretch of every leg is clear."""
    stretches = [(one, other) for flight in flights for leg in flight.legs for one, other in pairwise(leg.points)]
    a, b = (np.array([stretch[end] for stretch in stretches]) for end in (0, 1))
    for row in np.flatnonzero(obstacles.blocked(a, b))[:1]:
        problem = obstacles.leg_problems(a[row], b[row])[0]
        raise MissionError(f"a leg of the route {problem}", remedy="Report this: the route should have avoided it.")
