"""Why a plan is refused on a plot, and what else is worth knowing of it there: one list, `CODES`, and its checks.

Errors are what is unsafe or cannot be flown; one is enough to refuse the plan, and `fit_report` collects all. The rest
is said, for only the people there know what they want of a plot: warnings, where the reconstruction will be another
than the plan's, and notes. What the site file does not say is not checked, but for plants' heights.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Intrinsics
from fieldkit.results.finding import Finding, Refused, Severity
from fieldkit.results.plan import Plan, Plans
from fieldkit.routing.flights import AMONG_NEIGHBOURS, Stop, objections
from fieldkit.routing.mission import Shot
from fieldkit.routing.obstacles import Obstacles
from fieldkit.runtime.progress import Advance, ignore
from fieldkit.sites.fitted import flown_plans
from fieldkit.sites.placement import PlotFrame, SiteFrame, landing_of, place, stops_of
from fieldkit.sites.plot_plants import BESIDE_M, HEIGHT_TAKEN, PlanFacts, facts_of, other_spacing, plants_on
from fieldkit.sites.reach import RTK_REMEDY, Unreachable, nearest, needs_rtk
from fieldkit.sites.site import Site, SitePlot
from fieldkit.sites.site_obstacles import Canopy, site_obstacles
from fieldkit.vehicles.vehicle import Vehicle

PLOTS_NEAR = "plots-near"
"""Code of plots so near to each other that stations stand over or behind others."""
CODES: dict[str, Severity] = {
    # The plan on the plot.
    "plant-height-unknown": "error",
    HEIGHT_TAKEN: "warning",  # the tallest stated ones and 30 %
    "plants-unknown": "warning",  # nobody says where they stand
    "plants-higher": "warning",
    "plants-outgrown": "warning",  # measured on the photographs
    "plot-size": "warning",  # the plot reaches beyond the plan's plants
    "row-spacing": "warning",
    "slope-steep": "warning",
    # The vehicle there.
    "out-of-reach": "error",  # pitch beyond the mount, or too low above the ground; --adjust flies the nearest pose
    "among-plants": "error",  # nearer to them than the clearance, or below leaves
    "among-neighbours": "error",  # of another plot
    "plots-too-near": "error",  # the same in one sentence
    PLOTS_NEAR: "warning",  # stations stand over or behind other plots
    "in-obstacle": "error",  # or in a no-fly zone, outside the fence, above the ceiling
    "height": "error",  # of take-off or transit, above the ceiling
    "home": "error",  # the way straight up at home or down at the landing is not clear
    "other-camera": "error",  # the vehicle's sees much more or less than the plan's
    "needs-rtk": "warning",  # stations nearer to each other or to plants than the vehicle's GNSS can hold
    # Found while routing (fieldkit.routing.flights).
    "no-way": "error",  # no leg between two stations is clear
    "battery": "error",  # one plot takes more than a battery
    "items": "error",  # one plot takes more mission items than the vehicle stores
}
"""How grave each finding is. docs/vehicles-and-sites.md says more of them."""
STEEP_PERCENT = 10.0
"""Up to here plans have been tried on slopes (docs/vehicles-and-sites.md)."""
HIGHER_M = 0.05
"""By which plants may be higher than the plan's: points of plan.json stand for cells of this size."""
_VIEWS_APART = 1.33
"""Ratio of field widths from which cameras differ."""
_SIGHTS = 60
"""Places of a plot's plants that its stations are asked to see."""
_IN_PLOT = np.array([(x, y) for x in (-0.8, 0.0, 0.8) for y in (-0.8, 0.0, 0.8)])
"""Such places, in shares of half a plot's sides, where no plan says where plants are."""
_HIDDEN = 0.05
"""Share of hidden sight lines that is worth knowing."""


@dataclass(frozen=True, eq=False)
class FitReport:
    """A plan on the plots of a site, with all that speaks against it before its flights are looked for."""

    findings: tuple[Finding, ...]
    """In the plots' order; those of stations behind those of plots."""
    plans: Plans
    """As they are flown: fitted to the plots."""
    shots: tuple[Shot, ...]
    """Their photographs; with ``adjust`` those that the vehicle can take."""
    moved: tuple[Unreachable, ...]
    """What was adjusted."""
    stops: tuple[Stop, ...]
    obstacles: Obstacles
    canopy: Canopy
    """Of all plots."""

    def require(self) -> None:
        """Raise Refused where there is an error."""
        if any(finding.severity == "error" for finding in self.findings):
            raise Refused(self.findings)


def fit_report(
    plan: Plans,
    site: Site,
    vehicle: Vehicle,
    *,
    fit: bool | None = None,
    adjust: bool = False,
    advance: Advance = ignore,
) -> FitReport:
    """Put a plan on every plot of a site, and say all that speaks against it there.

    ``advance`` is told of plots that are done with.
    """
    plans, findings = flown_plans(plan, site.plots, fit), list[Finding]()
    for plot, facts in facts_of(plans, site):
        if facts is None:
            findings += plants_known(facts, plot)
        else:
            findings += fit_plot(facts, plot)
            findings += other_camera(facts.plan, plot, vehicle)
        advance(1)
    shots, obstacles = place(plans, site), site_obstacles(site, vehicle.clearance_m, plans)
    changed, problems = nearest(shots, site, vehicle, obstacles if adjust else None)
    if not adjust:
        findings += [problem.finding for problem in problems]
        changed, problems = shots, ()
    stops = stops_of(changed, site, vehicle)
    against = objections(
        stops, (0.0, 0.0, 0.0), landing_of(site), obstacles, takeoff_m=site.takeoff_m, transit_m=site.transit_m
    )
    findings += against
    canopy = Canopy.of(site, plans)
    for plot in site.plots:
        stations = np.array([stop.position_m for stop in stops if stop.plot == plot.name])
        why = needs_rtk(stations, canopy.near_m(stations), vehicle)
        findings += [_finding(plot, "needs-rtk", each, RTK_REMEDY) for each in why]
    findings[:0] = _crowding(plans, stops, site, canopy, against, vehicle.clearance_m)
    return FitReport(tuple(findings), plans, changed, problems, stops, obstacles, canopy)


def _crowding(
    plans: Plans, stops: Sequence[Stop], site: Site, canopy: Canopy, against: Sequence[Finding], clearance_m: float
) -> Iterator[Finding]:
    """Plots so near to each other that stations stand over, among or behind the plants of others."""
    frame, over, hidden, reach_m = SiteFrame(site.home), 0, 0.0, 0.0
    for index, (plot, facts) in enumerate(facts_of(plans, site)):
        stations = np.array([stop.position_m for stop in stops if stop.plot == plot.name]).reshape(-1, 3)
        plants = plants_on(facts, plot)
        if not len(stations) or plants is None or plot.size_m is None:
            continue
        to_plot, side = PlotFrame.of(site, plot), 0.5 * np.array(plot.size_m)
        own = plants.points[(np.abs(plants.points[:, :2]) < side).all(axis=1)]
        if not len(own):
            own = np.array([(x, y, 0.5 * (plot.plant_height_m or 0.0)) for x, y in _IN_PLOT * side])
        own = own[np.linspace(0, len(own) - 1, _SIGHTS).astype(int)]
        count, share = canopy.crowding(index, stations, frame.to_local(*to_plot.to_geodetic(own)))
        over, hidden = over + count, hidden + share * len(stations) / len(stops)
        beyond = np.abs(to_plot.to_plot(*frame.to_geodetic(stations))[:, :2]) - side
        reach_m = max(reach_m, float(np.hypot(*np.maximum(beyond, 0.0).T).max()))
    low = sum(finding.code == AMONG_NEIGHBOURS for finding in against)
    if over or low or hidden > _HIDDEN:
        near = f", and {low} come nearer to these than {clearance_m:g} m" if low else ""
        yield _finding(
            "",
            "plots-too-near" if low else PLOTS_NEAR,
            f"{over} of {len(stops)} stations stand over other plots, whose plants hide {hidden:.0%} of the sight lines"
            f"{near}: plots nearer than {math.ceil(10 * reach_m) / 10:.1f} m need another way of flying",
        )


def fit_plot(facts: PlanFacts, plot: SitePlot) -> tuple[Finding, ...]:
    """What does not fit of a plan on a plot, or is worth knowing; without the vehicle's limits but its clearance."""
    parts = (plants_known(facts, plot), _size(facts, plot), _spacing(facts, plot), _slope(plot))
    return tuple(finding for part in parts for finding in part)


def _finding(plot: SitePlot | str, code: str, message: str, remedy: str = "") -> Finding:
    name = plot if isinstance(plot, str) else plot.name
    return Finding(name, code, message, severity=CODES[code], remedy=remedy)


def other_camera(plan: Plan, plot: SitePlot, vehicle: Vehicle) -> Iterator[Finding]:
    """Where the vehicle's camera sees a third more than the plan's across or up, or a quarter less."""
    if plan.camera is None:
        return
    planned, own = (_view_deg(camera) for camera in (plan.camera, vehicle.camera))
    ratio = np.tan(np.radians(own) / 2.0) / np.tan(np.radians(planned) / 2.0)
    if ratio.max() > _VIEWS_APART or ratio.min() < 1.0 / _VIEWS_APART:
        yield _finding(
            plot,
            "other-camera",
            f"the plan's camera sees {planned[0]:.0f} × {planned[1]:.0f}°, and that of {vehicle.title} "
            f"{own[0]:.0f} × {own[1]:.0f}°",
            "Plan for this vehicle: fieldkit plan --vehicle NAME.",
        )


def _view_deg(camera: Intrinsics) -> FloatArray:
    """Of a camera across and up."""
    width, height = camera.width, camera.height
    return np.asarray(np.degrees(2.0 * np.arctan(0.5 * np.array([width, height]) / np.array([camera.fx, camera.fy]))))


def plants_outgrown(plan: Plan, plant_height_m: float) -> Finding | None:
    """What to say of plants that were measured on photographs of a plan's flight.

    ``plant_height_m`` is that of the highest plants above the ground, as measured. A warning where they are higher than
    those that the plan keeps clear of by more than `HIGHER_M`; else None, as where the plan does not say where plants
    are, or the height is no number.
    """
    top = PlanFacts(plan).top_m
    if top is None or not math.isfinite(plant_height_m) or plant_height_m <= top + HIGHER_M:
        return None
    return _finding(
        "plot",
        "plants-outgrown",
        f"plants are {plant_height_m:.2f} m high, {plant_height_m - top:.2f} m higher than those that the plan keeps "
        f"clear of ({top:.2f} m)",
        f"Give plant_height_m = {math.ceil(20 * plant_height_m) / 20:.2f} for this plot and export the mission again: "
        "it is then flown clear of them, or refused.",
    )


def plants_known(facts: PlanFacts | None, plot: SitePlot) -> Iterator[Finding]:
    """What is not known of a plot's plants, or is otherwise than the plan's."""
    height, plants = plot.plant_height_m, plants_on(facts, plot)
    top = None if facts is None else facts.top_m
    if height is None:
        made_for = "" if top is None else f"; the plan's are {top:.2f} m high"
        yield _finding(
            plot,
            "plant-height-unknown",
            f"nobody says how high its plants are, and a mission has to keep clear of them{made_for}",
            "Measure the highest plants: plant_height_m in the plots file gives each plot's, --plant-height METRES one "
            "for all. --plant-height unknown keeps clear of plants 30 % taller than the plan's.",
        )
        return
    if plants is None:
        yield _finding(
            plot,
            "plants-unknown",
            f"not checked against plants: neither the plan nor the site says where those of {height:.2f} m stand",
            "Make the plan again with fieldkit plan, which writes them into plan.json, or give the plot's outline.",
        )
        return
    if facts is None or top is None:
        return
    if height > top + HIGHER_M:
        yield _finding(
            plot,
            "plants-higher",
            f"plants of {height:.2f} m are {height - top:.2f} m higher than the plan's; the mission keeps clear of "
            "them, but they fill more of the pictures than planned",
            "Fit the plan to them with --fit, or look at what the photographs show.",
        )


def _size(facts: PlanFacts, plot: SitePlot) -> Iterator[Finding]:
    if plot.size_m is None or facts.box is None:
        return
    size, extent = np.array(plot.size_m), facts.box[1] - facts.box[0]
    if (size > extent + 2 * BESIDE_M).any():
        yield _finding(
            plot,
            "plot-size",
            f"the plot of {size[0]:.1f} × {size[1]:.1f} m reaches beyond the plants that the plan knows, on "
            f"{extent[0]:.1f} × {extent[1]:.1f} m",
            "Plan on a plot of this size; one plan photographs one part of a larger plot.",
        )


def _spacing(facts: PlanFacts, plot: SitePlot) -> Iterator[Finding]:
    wanted, known = plot.row_spacing_m, facts.spacing_m if plot.row_spacing_m is not None else None
    if wanted is None or known is None or not other_spacing(known, wanted):
        return
    yield _finding(
        plot,
        "row-spacing",
        f"rows are {wanted:.2f} m apart, the plan's {known:.2f} m: what hides what differs; the mission stays above "
        "all that the plan's plants cover",
        "Compare the scores of such plots with those of the plan's spacing.",
    )


def _slope(plot: SitePlot) -> Iterator[Finding]:
    if plot.slope_percent > STEEP_PERCENT:
        yield _finding(
            plot,
            "slope-steep",
            f"the ground rises by {plot.slope_percent:.1f} %; plans have been tried to {STEEP_PERCENT:g} %",
            "Plan on a plot with this slope.",
        )
