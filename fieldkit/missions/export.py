"""From a plan, a vehicle and a site to flights: placed, in reach, routed clear of everything, and split by battery."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Pose
from fieldkit.results.finding import Finding
from fieldkit.results.mission import MissionPasses
from fieldkit.results.plan import Plan, Plans
from fieldkit.routing.flights import FileCapacity, Flight, plan_flights
from fieldkit.routing.mission import Fence, GeoPoint, Mission, Passing, Shot, Via, burst_s
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.sites.fit import PLOTS_NEAR, fit_report
from fieldkit.sites.placement import PlotFrame, SiteFrame, grounds_m, landing_of
from fieldkit.sites.plot_plants import facts_of, plants_on
from fieldkit.sites.reach import Unreachable
from fieldkit.sites.site import Site
from fieldkit.vehicles.vehicle import Vehicle

_BEYOND = 1.002
"""By what more flights are cut than they are too long, so that one more attempt is mostly enough."""


@dataclass(frozen=True)
class RoutedFlight:
    """A flight with its mission."""

    mission: Mission
    """What autopilots get."""
    flight: Flight
    """Its route in the site frame, times and battery."""
    foreseen: tuple[Shot | Via | Passing, ...] = ()
    """Its stops with the photographs in passing as its file gives them."""

    @property
    def stops(self) -> tuple[Shot | Via | Passing, ...]:
        """As they will be."""
        return self.foreseen or self.mission.stops

    @property
    def photographs(self) -> int:
        """How many are taken."""
        return len(self.mission.shots) * self.mission.burst + sum(isinstance(stop, Passing) for stop in self.stops)


@dataclass(frozen=True, eq=False)
class Routed:
    """All flights of a plan on a site."""

    flights: tuple[RoutedFlight, ...]
    """In the order they are flown."""
    moved: tuple[Unreachable, ...]
    """Poses that were out of the vehicle's reach and have been replaced by the nearest ones."""
    lowest_m: float
    """Least height of a photograph above its plot's ground."""
    plants_m: float | None
    """Least distance between the plants of any plot and anything that is flown, from the ground to the ground; None
    where nobody says where plants are.
    """
    plants_of: Mapping[str, FloatArray]
    """(m, 3) by plot, site frame; as high as they are taken to be there."""
    clear_m: Mapping[str, float | None]
    """By plot, the height of plants that all of it keeps clear of; None where nobody says where they stand."""
    fit: tuple[Finding, ...] = ()
    """What does not fit on which plot, or is worth knowing; errors are none of it."""
    own: Mapping[str, Plan] = field(default_factory=dict)
    """Plans of plots that are not flown by the one plan that was given."""
    passes: MissionPasses | None = None
    """Where flights are those of a pattern."""

    @property
    def plants(self) -> FloatArray:
        """(m, 3) of all plots, site frame."""
        return np.concatenate([np.zeros((0, 3)), *self.plants_of.values()])

    @property
    def least_clear_m(self) -> float | None:
        """The height of plants that everything keeps clear of on every plot; None where that is not known of one."""
        known = [clear_m for clear_m in self.clear_m.values() if clear_m is not None]
        return min(known) if len(known) == len(self.clear_m) else None

    @property
    def stations(self) -> int:
        """Of all flights."""
        return sum(len(each.mission.shots) for each in self.flights)

    @property
    def photographs(self) -> int:
        """Of all flights."""
        return sum(each.photographs for each in self.flights)

    @property
    def bursts_s(self) -> float:
        """In the air for more than one photograph at each station."""
        return sum(len(m.shots) * burst_s(m.burst, m.exposure_s) for m in (each.mission for each in self.flights))

    @property
    def length_m(self) -> float:
        """Of all flights, each from take-off to landing."""
        return sum(each.flight.length_m for each in self.flights)

    @property
    def time_s(self) -> float:
        """In the air: of all flights, each from take-off to landing."""
        return sum(each.flight.time.total_s for each in self.flights)

    def legs(self) -> list[FloatArray]:
        """(k, 3) places of every leg, site frame, in the order they are flown."""
        return [np.array(leg.points) for each in self.flights for leg in each.flight.legs]

    def cameras(self, site: Site) -> list[Pose]:
        """Of all photographs in the order they are taken, site frame."""
        frame = SiteFrame(site.home)
        shots = [stop for each in self.flights for stop in each.mission.stops if not isinstance(stop, Via)]
        points = frame.points(shot.place for shot in shots)
        return [Pose.from_yaw_pitch(p, s.yaw_deg, s.pitch_deg) for p, s in zip(points, shots, strict=True)]


def route_plan(
    plan: Plans,
    vehicle: Vehicle,
    site: Site,
    *,
    fit: bool | None = None,
    adjust: bool = False,
    seed: int = 0,
    burst: int = 1,
    capacity: FileCapacity | None = None,
    timed: Callable[[RoutedFlight], RoutedFlight] | None = None,
    progress: Progress | None = None,
) -> Routed:
    """Put a plan on every plot of a site and find the flights over it.

    The photographs' poses are those of `flown_plans`, exactly; only with ``adjust`` are those
    that the vehicle cannot take replaced by the nearest that it can. Flights keep the vehicle's clearance to the plan's
    plants on every leg.

    Args:
        plan: stations in the plot frame; for all plots, or each plot's own by name.
        fit: see `flown_plans`.
        adjust: fly the nearest poses where the plan's cannot be taken.
        burst: photographs at each station, one after the other (`Mission.interval_s`).
        capacity: of each flight's mission, see `plan_flights`.
        timed: gives a flight the time that its file takes. Where that is more than a battery, the flights are planned
            for so much less of one.
    """
    progress = progress or Silent()
    with progress.stage("Fitting the plan to plots", len(site.all_plots)) as advance:
        report = fit_report(plan, site, vehicle, fit=fit, adjust=adjust, advance=advance)
    report.require()
    for finding in report.findings:
        if finding.code == PLOTS_NEAR:
            progress.note(finding.message)
    plans, shots, frame = report.plans, report.shots, SiteFrame(site.home)
    more_s, planned_for = burst_s(burst, vehicle.trigger.exposure_s), vehicle
    stops = tuple(replace(stop, pause_s=stop.pause_s + more_s) for stop in report.stops)
    while True:
        with progress.stage("Looking for ways", 3 * len(site.plots)) as advance:
            flights = plan_flights(
                stops,
                (0.0, 0.0, 0.0),
                landing_of(site),
                report.obstacles,
                planned_for,
                takeoff_m=site.takeoff_m,
                transit_m=site.transit_m,
                seed=seed,
                capacity=capacity,
                advance=advance,
            )
        routed = tuple(
            RoutedFlight(replace(_mission(flight, k, len(flights), shots, frame, site, vehicle), burst=burst), flight)
            for k, flight in enumerate(flights, 1)
        )
        routed = routed if timed is None else tuple(timed(each) for each in routed)
        most = max(each.flight.time.battery for each in routed)
        if timed is None or most <= 1.0:
            break
        planned_for = with_less(planned_for, most)
    on_plots = [(plot, plants_on(each, plot)) for plot, each in facts_of(plans, site)]
    heights = [shot.place.height_m for shot in shots] - grounds_m(site, shots)
    return Routed(
        flights=routed,
        moved=report.moved,
        lowest_m=float(heights.min()),
        plants_m=report.canopy.nearest_m([whole_way(flight) for flight in flights]),
        plants_of={
            plot.name: frame.to_local(*PlotFrame.of(site, plot).to_geodetic(plants.points))
            for plot, plants in on_plots
            if plants is not None and len(plants.points)
        },
        clear_m={plot.name: None if plants is None else plants.clear_m for plot, plants in on_plots},
        fit=report.findings,
        own={} if isinstance(plans, Plan) else {name: each for name, each in plans.items() if each is not plan},
    )


def with_less(vehicle: Vehicle, battery: float) -> Vehicle:
    """A vehicle with so much less endurance as its flights take more than one battery."""
    less = {"endurance_s": vehicle.battery.endurance_s / (_BEYOND * battery)}
    return vehicle.model_copy(update={"battery": vehicle.battery.model_copy(update=less)})


def _mission(
    flight: Flight, number: int, count: int, shots: Sequence[Shot], frame: SiteFrame, site: Site, vehicle: Vehicle
) -> Mission:
    stops: list[Shot | Via] = []
    for leg, index in zip(flight.legs, (*flight.stops, None), strict=True):
        stops += [Via(*astuple(point)) for point in frame.places(np.array(leg.via).reshape(-1, 3))]
        if index is not None:
            stops.append(shots[index])
    return mission_over(stops, np.array(flight.legs[-1].points[-1]), number, count, site, vehicle)


def mission_over(
    stops: Sequence[Shot | Via | Passing], landing: FloatArray, number: int, count: int, site: Site, vehicle: Vehicle
) -> Mission:
    """One of several missions of a site.

    ``landing`` (3,) is where it descends, site frame.
    """
    (end,) = SiteFrame(site.home).places(landing)
    return Mission(
        name=site.name if count == 1 else f"{site.name}, flight {number} of {count}",
        home=site.home,
        takeoff_m=site.takeoff_m,
        stops=tuple(stops),
        landing=end,
        speed_mps=vehicle.speeds.cruise_mps,
        settle_s=vehicle.trigger.settle_s,
        exposure_s=vehicle.trigger.exposure_s,
        rally=tuple(GeoPoint(r.latitude_deg, r.longitude_deg, site.transit_m) for r in site.rally),
        fence=Fence(site.fence, tuple(zone.corners for zone in site.no_fly), site.ceiling_m),
    )


def whole_way(flight: Flight) -> FloatArray:
    """(k, 3) places from the take-off's ground to the landing's, site frame."""
    places = np.concatenate([leg.points for leg in flight.legs])
    return np.vstack([places[:1] * (1.0, 1.0, 0.0), places, places[-1:] * (1.0, 1.0, 0.0)])
