"""What a mission is checked over: plots and their plants, as the site, the plan and the mission.json beside it say."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fieldkit.regular_files import read_regular
from fieldkit.results.finding import Finding
from fieldkit.results.mission import MissionOutline, MissionPlot, MissionRecord, load_mission, record_path
from fieldkit.results.plan import Plan, Plans, plan_on
from fieldkit.results.plan_file import load_plan
from fieldkit.sites.fitted import flown_plans
from fieldkit.sites.placement import PlotFrame
from fieldkit.sites.plot_plants import PlantHeight, facts_of, heights_taken, plants_on, same_height_m, with_plant_height
from fieldkit.sites.site import NoFly, Obstacle, Site, SitePlot

NO_PLOTS = "no plots are given, and no mission.json lies beside the file"
_NO_HEIGHT = "the height of its plants is not known"
_NOWHERE = "neither a plan nor the plot's outline says where its plants stand"
_NOT_GIVEN = "mission.json says that it is flown over, and it is none of the plots given"
_TRANSIT_M = 5.0
"""Height of take-off and transit, which mission.json does not hold, metres."""
_SAME_M = 0.05
"""Distance by which a plot's frame may differ from that in mission.json, metres."""
_SAME_DEG = 0.5
"""Heading by which it may, degrees."""


@dataclass(frozen=True, eq=False)
class Ground:
    """Plots with what is known of their plants."""

    site: Site
    plans: Mapping[str, Plan] = field(default_factory=dict)
    """By plot; of those whose plan is known."""
    unchecked: Mapping[str, str] = field(default_factory=dict)
    """Plots that are not checked against plants, and why."""
    taken: tuple[Finding, ...] = ()
    """Plots whose plants nobody states a height of."""


def ground_of(
    file: Path | None,
    site: Site | None,
    clearance_m: float,
    *,
    plans: Plans | None = None,
    fit: bool | None = None,
    plant_height: PlantHeight | None = None,
) -> Ground | None:
    """What is known of the ground below a mission.

    Leaves are those of the plan, where it is given or lies beside the mission as mission.json says. A plot of unknown
    outline, without a plan, counts as checked where mission.json says that this very file keeps clear of it: of plants
    as high as these, here, and for as much clearance. ``plant_height``, as of `with_plant_height`, comes before what
    the plots and mission.json say. None where there are no plots.
    """
    found = None if file is None else _record_of(file)
    record, unchanged = found if found is not None else (None, False)
    if site is None and record is None:
        return None
    exported = {} if record is None else {plot.name: plot for plot in (*record.plots, *record.neighbours)}
    if site is None:
        assert record is not None
        site = site_of(record)
    else:
        site = site.with_each(lambda plot: _with_height(plot, exported.get(plot.name)))
    stated, site = site, with_plant_height(site, plans, plant_height)
    if plans is not None:
        flown = flown_plans(plans, site.plots, fit)
        by_plot = {plot.name: plan_on(flown, plot.name) for plot in site.plots}
    else:
        by_plot = {} if file is None or record is None else _plans_beside(file, record.plots)
    unchecked = {}
    for plot, facts in facts_of(by_plot, site):
        if plot.plant_height_m is None:
            unchecked[plot.name] = _NO_HEIGHT
        elif plants_on(facts, plot) is None and not (
            unchanged and _kept_clear(exported.get(plot.name), plot, PlotFrame.of(site, plot), clearance_m)
        ):
            unchecked[plot.name] = _NOWHERE
    if record is not None and file is not None:
        over = {plot for flight in record.flights if flight.file == file.name for plot in flight.plots}
        unchecked |= dict.fromkeys(sorted(over - {plot.name for plot in site.all_plots}), _NOT_GIVEN)
    return Ground(site, by_plot, unchecked, heights_taken(stated, site, plant_height))


def _record_of(file: Path) -> tuple[MissionRecord, bool] | None:
    """The mission.json that names a mission file, and whether the file still is what was exported."""
    for mission in (file, file.with_stem(re.sub(r"-\d+$", "", file.stem) or file.stem)):
        if not record_path(mission).is_file():
            continue
        record = load_mission(record_path(mission))
        hashes = [entry.sha256 for entry in record.files if entry.name == file.name]
        if hashes:
            return record, _sha256(file) in hashes
    return None


def _with_height(plot: SitePlot, exported: MissionOutline | None) -> SitePlot:
    """A plot that says no plant height with the one that it was exported for."""
    if plot.plant_height_m is not None or exported is None or exported.plants is None:
        return plot
    return plot.model_copy(update={"plant_height_m": exported.plants.height_m})


def _plans_beside(file: Path, exported: Sequence[MissionPlot]) -> dict[str, Plan]:
    """The plans of plots that lie beside the mission, by the names and hashes that mission.json gives."""
    loaded: dict[str, Plan | None] = {}
    for plot in exported:
        name, sha256 = plot.plan.name, plot.plan.sha256
        if sha256 not in loaded:
            beside = None if name is None else file.with_name(Path(name).name)
            same = beside is not None and beside.is_file() and _sha256(beside) == sha256
            loaded[sha256] = load_plan(beside) if beside is not None and same else None
    found = {plot.name: loaded[plot.plan.sha256] for plot in exported}
    return {name: plan for name, plan in found.items() if plan is not None}


def _kept_clear(exported: MissionOutline | None, plot: SitePlot, frame: PlotFrame, clearance_m: float) -> bool:
    """Whether an export has kept clear of all plants of a plot."""
    if exported is None or exported.plants is None or exported.plants.clear_m is None or plot.plant_height_m is None:
        return False
    before = PlotFrame.recorded(exported)
    origin = before.to_plot(frame.tangent.latitude_deg, frame.tangent.longitude_deg, frame.ground_m)
    turned = abs((frame.row_heading_deg - before.row_heading_deg + 180.0) % 360.0 - 180.0)
    return bool(
        plot.plant_height_m <= exported.plants.clear_m + same_height_m(exported.plants.clear_m) + 1e-6
        and clearance_m <= exported.plants.clearance_m + 1e-6
        and float(np.linalg.norm(origin)) <= _SAME_M
        and turned <= _SAME_DEG
        and np.allclose(frame.gradient, before.gradient, atol=1e-3)
    )


def site_of(record: MissionRecord) -> Site:
    """The site as far as mission.json has it."""
    low = _TRANSIT_M if record.ceiling_m is None else min(_TRANSIT_M, record.ceiling_m)
    return Site(
        name=record.name,
        home=record.home,
        fence=record.inside,
        ceiling_m=record.ceiling_m,
        no_fly=tuple(NoFly(corners=ring) for ring in record.outside),
        takeoff_m=low,
        transit_m=low,
        plots=tuple(_plot_of(plot) for plot in record.plots),
        neighbours=tuple(_plot_of(plot) for plot in record.neighbours),
        obstacles=tuple(Obstacle(**obstacle.model_dump()) for obstacle in record.obstacles),
    )


def _plot_of(plot: MissionOutline) -> SitePlot:
    along, across = plot.gradient
    percent = 100.0 * math.hypot(along, across)
    uphill = (plot.row_heading_deg + math.degrees(math.atan2(-across, along))) % 360.0 if percent else None
    return SitePlot(
        name=plot.name,
        latitude_deg=plot.origin.latitude_deg,
        longitude_deg=plot.origin.longitude_deg,
        height_m=plot.ground_m,
        datum="home",
        row_heading_deg=plot.row_heading_deg,
        slope_percent=percent,
        uphill_heading_deg=uphill,
        length_m=plot.length_m,
        width_m=plot.width_m,
        row_spacing_m=plot.row_spacing_m,
        plant_height_m=None if plot.plants is None else plot.plants.height_m,
    )


def _sha256(file: Path) -> str:
    return hashlib.sha256(read_regular(file)).hexdigest()
