"""The next visit of a campaign: stations for every plot from its own last visit's cloud, by the geometric score."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.campaign.reading import PLANS_FOLDER, Campaign, visit_cloud
from fieldkit.clouds import Cloud, read_cloud
from fieldkit.clouds.plants_apart import tell_apart
from fieldkit.clouds.volume import Volume
from fieldkit.errors import MissionError, UsageError
from fieldkit.files import atomic_folder
from fieldkit.missions.export_mission import ExportedMission, export_mission
from fieldkit.missions.settings import MissionSettings
from fieldkit.planning.methods.optimise import Effort, optimise
from fieldkit.planning.plan_settings import EnvelopeSettings
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.run.flyable import vehicle_envelope
from fieldkit.planning.run.outcome import plants_of
from fieldkit.planning.score.cost_model import CostModel
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.planning.space.plots import Plot
from fieldkit.results.plan import Plan, PlanMethod, PlanPlants, PlanSource
from fieldkit.results.plan_file import plan_from_poses, save_plan
from fieldkit.runtime.context import Context
from fieldkit.sites.fitted import fitted_to_height
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.sites.plot_plants import PlanFacts, PlantHeight, heights_taken, plants_on, with_plant_height
from fieldkit.sites.site import Site, SitePlot
from fieldkit.sites.site_file import named_plots, with_plots
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit.vocabulary import WEIGHTS

GROWTH = 1.15
"""Factor by which plants are taken to have grown since the last visit, where nobody says."""
_MARGIN_M = 0.03
"""Width of the box about the plants beyond them, metres."""
_STEP_M = 0.10
"""Step between the points that stand for a plot's box, metres."""
_RIM = 0.3
"""Of the clearance, by which points lie beyond and above an outline's upper edges, so that spheres hold the corner."""
_AROUND, _ANYWHERE = Effort(moves=600), Effort(designs=16, starts=2, moves=600)
"""Searches from the plan that was flown, and from elsewhere."""


@dataclass(frozen=True)
class NextPlan:
    """What is flown over one plot."""

    plot: str
    plan: Plan
    date: str | None = None
    """Of the visit whose cloud it was made of; None where the plot has none and keeps the campaign's plan."""
    expected_m: float | None = None
    """What the geometric score expects of the plan on the grown plants; None without a cloud."""
    carried_m: float | None = None
    """What it expects of the campaign's plan there."""
    seconds: float = 0.0


def next_plans(
    campaign: Campaign, vehicle: Vehicle | None, context: Context, *, growth: float = GROWTH
) -> tuple[NextPlan, ...]:
    """A plan for every plot of a campaign, in the plots' order; nothing is photographed.

    Plants of the last visit with a cloud are made taller and wider by ``growth``: each about its foot where they can
    be told apart, else all of them about the plot's middle. The stations are the better optimum of the geometric score
    of two: looked for from the campaign's plan, and from anywhere. So no plot has a worse score than the carried plan,
    unless that stands too near. Where the site knows a plot's outline and plants' height, they keep clear of all of it,
    as its mission has to.
    """
    if not 1.0 <= growth <= 3.0:
        raise UsageError(f"plants grow by a factor from 1 to 3, not {growth:g}", remedy="Give --growth 1.15.")
    if campaign.plan.camera is None:
        raise MissionError(
            "the campaign's plan does not say which camera it is for",
            path=campaign.plan_file,
            remedy="Make it again with fieldkit plan.",
        )
    known = [_cloud_of(campaign, plot.name) for plot in campaign.site.plots]
    make = partial(_next_plan, vehicle, growth, context.seed)
    items = [
        (campaign.carried_plan(plot.name), plot, *found) for plot, found in zip(campaign.site.plots, known, strict=True)
    ]
    with context.progress.stage("Planning the next visit", len(items)) as advance:
        return tuple(context.map(make, items, advance))


def grown(cloud: Cloud, growth: float) -> Cloud:
    """Plants that have grown by a factor, about their feet where they can be told apart, else about their middle."""
    apart = tell_apart(cloud)
    low, high = cloud.points.min(axis=0), cloud.points.max(axis=0)
    middle = np.array([*(0.5 * (low + high))[:2], low[2]])
    feet = np.vstack([middle, apart.feet_m])[apart.numbers] if apart.count else middle
    return Cloud(feet + growth * (cloud.points - feet), cloud.colors, cloud.normals)


def _cloud_of(campaign: Campaign, plot: str) -> tuple[str | None, Path | None]:
    """Date and cloud of the plot's last visit that has one."""
    visits = [visit for visit in campaign.visits if visit.plot == plot]
    for visit in sorted(visits, key=lambda visit: visit.date, reverse=True):
        file = visit_cloud(campaign.folder, visit)
        if file is not None:
            return visit.date, file
    return None, None


def _next_plan(
    vehicle: Vehicle | None, growth: float, seed: int, item: tuple[Plan, SitePlot, str | None, Path | None]
) -> NextPlan:
    plan, plot, date, file = item
    if file is None:
        return NextPlan(plot.name, plan)
    begun = time.perf_counter()
    name = f"{plot.name} of {date}"
    plants = grown(read_cloud(file), growth)
    plot = _at_least(plot, float(plants.points[:, 2].max()))
    made, carried_m = plan_for_plants(plan, plants, name, vehicle=vehicle, seed=seed, plot=plot)
    assert made.method is not None
    return NextPlan(plot.name, made, date, made.method.expected_m, carried_m, time.perf_counter() - begun)


def heights_flown(
    stated: Site, plan: Plan, given: PlantHeight | None, tops_m: Mapping[str, float | None]
) -> tuple[Site, Site]:
    """The site with what was measured of its plots' plants, and with heights of all, as a mission keeps clear of them.

    Plots of which nobody knows anything may be taller than measured ones, too, and none is lower than stated.
    """

    def raised(site: Site) -> Site:
        return site.with_each(lambda plot: _at_least(plot, tops_m.get(plot.name)))

    before = {plot.name: plot.plant_height_m for plot in with_plant_height(stated, plan, given).all_plots}
    measured = raised(stated)
    filled = raised(with_plant_height(measured, plan, given))
    return measured, filled.with_each(lambda plot: _at_least(plot, before[plot.name]))


def _at_least(plot: SitePlot, height_m: float | None) -> SitePlot:
    """A plot whose plants are at least so high: what its site says may be of an earlier date."""
    if height_m is None or (plot.plant_height_m or 0.0) >= height_m:
        return plot
    return plot.model_copy(update={"plant_height_m": height_m})


def plan_for_plants(
    plan: Plan,
    plants: Cloud,
    name: str,
    *,
    vehicle: Vehicle | None = None,
    seed: int = 0,
    plot: SitePlot | None = None,
) -> tuple[Plan, float]:
    """Stations for known plants by the geometric score, as many as a carried plan has.

    Also what the score expects there of the carried one, metres; the plan is fitted to the plants' height if it is made
    for that.
    """
    with suppress(MissionError):  # too different: searched for from where the plan's cameras are
        plan = fitted_to_height(plan, float(plants.points[:, 2].max()))
    problem = _problem(plan, vehicle, plants, plot)
    weights = WEIGHTS if plan.method is None or plan.method.weights is None else plan.method.weights
    cost_model = CostModel(problem)

    def expected_m(cameras: Cameras) -> float:
        return cost_model.expected_m(cameras, weights)

    def cost(cameras: Cameras, plots: Sequence[int]) -> FloatArray:
        return cost_model.costs_m(cameras, weights, plots)

    carried = problem.nearest(Cameras.from_poses(station.pose for station in plan.stations))
    found = [
        problem.nearest(optimise(problem, cost, seed, _AROUND, [carried])),
        problem.nearest(optimise(problem, cost, seed, _ANYWHERE)),
    ]
    best = min(found, key=expected_m)
    method = PlanMethod(name="score", seed=seed, evaluations=0, repeats=0, expected_m=expected_m(best), weights=weights)
    made = plan.model_copy(
        update={
            "stations": plan_from_poses(best.poses()).stations,
            "envelope": problem.envelope.in_plan(),
            "plants": plants_of(problem),
            "plant_height_m": None,
            "fit": None,
            "source": PlanSource(kind="captures", name=name),
            "method": method,
        }
    )
    return made, expected_m(carried)


def _problem(plan: Plan, vehicle: Vehicle | None, plants: Cloud, plot: SitePlot | None) -> PlanningProblem:
    assert plan.camera is not None
    limits = _limits(plan) if vehicle is None else vehicle_envelope(vehicle, EnvelopeSettings())
    volume = Volume.around(plants.points, margin_m=_MARGIN_M)
    kept_clear = (
        plants
        if plot is None
        else Cloud(np.vstack([plants.points, _beyond(plan, plants, plot, _RIM * limits.clearance_m)]))
    )
    envelope = Envelope.around(kept_clear, volume, **limits.model_dump())
    camera = plan.camera.without_distortion()
    return PlanningProblem(len(plan.stations), envelope, camera, (Plot(plants),))


def _beyond(plan: Plan, plants: Cloud, plot: SitePlot, rim_m: float) -> FloatArray:
    """(m, 3) points that fill what a mission over a plot takes to be plants beyond the known ones."""
    low, high = plants.points.min(axis=0).tolist(), plants.points.max(axis=0).tolist()
    known = plan.model_copy(update={"plants": PlanPlants(points_m=(tuple(low), tuple(high)), cell_m=_STEP_M)})
    found = plants_on(PlanFacts(known), plot)
    filled = [np.zeros((0, 3))]
    for block in () if found is None else found.blocks:
        top = max(high[2], block.top_m)
        filled.append(_grid((*block.low, 0.0), (*block.high, top)))
        # A mission keeps clear of a box whose upper edges are sharp, and of spheres about these points.
        rim = _grid((*np.subtract(block.low, rim_m), top + rim_m), (*np.add(block.high, rim_m), top + rim_m))
        filled.append(rim[((rim[:, :2] < block.low) | (rim[:, :2] > block.high)).any(axis=1)])
    return np.vstack(filled)


def _grid(low: Sequence[float], high: Sequence[float]) -> FloatArray:
    """(n, 3) points that fill a box."""
    axes = [np.linspace(start, end, 2 + int((end - start) / _STEP_M)) for start, end in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _limits(plan: Plan) -> EnvelopeSettings:
    """Those that the plan was made in, as far as it says."""
    usual, own = EnvelopeSettings(), plan.envelope
    if own is None:
        return usual
    given = {
        "clearance_m": own.plant_distance_m,
        "separation_m": own.station_distance_m,
        "pitch_deg": own.pitch_deg,
        "height_m": None if own.lower_m is None or own.upper_m is None else (own.lower_m[2], own.upper_m[2]),
    }
    return usual.model_copy(update={key: value for key, value in given.items() if value is not None})


@dataclass(frozen=True, eq=False)
class NextVisit:
    """A planned visit."""

    plans: tuple[NextPlan, ...]
    """Of all plots, in the campaign's order."""
    mission: ExportedMission
    """Over all of them."""


def plan_next_visit(
    campaign: Campaign,
    date: str,
    output: Path,
    settings: MissionSettings,
    context: Context,
    *,
    vehicle: str | None = None,
    growth: float = GROWTH,
    overwrite: bool = False,
) -> NextVisit:
    """`next_plans`, kept in the campaign's folder (plans/DATE/PLOT.json), and one mission over all plots.

    ``settings`` may name the only plots that are flown. Plants are at least as high as the grown ones of each plot's
    plan.
    """
    folder = campaign.folder / PLANS_FOLDER / date
    if folder.exists() and not overwrite:
        raise UsageError("exists already", path=folder, remedy="Give --overwrite to plan this visit anew.")
    given = campaign.vehicle_file if vehicle is None else vehicle
    if given is None:
        raise UsageError(
            "which vehicle flies? The campaign does not say", remedy="Give --vehicle NAME, as for export-mission."
        )
    profile = load_vehicle(given)
    stated = campaign.site
    if settings.only is not None:
        stated = with_plots(stated, named_plots(stated, settings.only))
    site = with_plant_height(stated, campaign.plan, settings.plant_height)
    context = replace(context, seed=settings.seed)
    plans = next_plans(replace(campaign, site=site), profile, context, growth=growth)
    tops = {each.plot: PlanFacts(each.plan).top_m for each in plans if each.date is not None}
    for plot in site.neighbours:
        _, cloud = _cloud_of(campaign, plot.name)
        if cloud is not None:
            tops[plot.name] = growth * float(read_cloud(cloud).points[:, 2].max())
    measured, flown = heights_flown(stated, campaign.plan, settings.plant_height, tops)
    mission = export_mission(
        {each.plot: each.plan for each in plans},
        profile,
        flown,
        output,
        replace(settings, only=None, plant_height=None),
        context,
        plans=False,
        overwrite=overwrite,
    )
    taken = heights_taken(measured, flown, settings.plant_height)
    mission = replace(mission, routed=replace(mission.routed, fit=(*taken, *mission.routed.fit)))
    with atomic_folder(folder, overwrite=overwrite) as made:
        for each in plans:
            if each.plan != campaign.carried_plan(each.plot):
                save_plan(made / f"{plot_file_name(each.plot)}.json", each.plan)
    return NextVisit(plans, mission)
