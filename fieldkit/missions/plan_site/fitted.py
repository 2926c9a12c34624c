"""A plan fitted to another plot: its distances relative to the plants' height and to the plot's size.

A plan's cameras see plants of one height. Flown as it is over plants a third higher, the geometric score expects up to
84 % more error; with its stations moved out and up by as much as the plants have grown it is worth what it was
(docs/vehicles-and-sites.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fieldkit.errors import MissionError
from fieldkit.missions.plan_site.plot_plants import BESIDE_M, PlanFacts
from fieldkit.missions.plan_site.site import SitePlot
from fieldkit.results.plan import Plan, PlanFit, PlanPlants, Station

SMALLEST, LARGEST = 0.5, 2.0
"""Factors of height and size between which a plan is still the same plan."""
_SAME = 0.05
"""Share by which plants may differ in height and still be the plan's."""
_NEAREST_AIM_M = 0.2

Array = NDArray[np.float64]


def fitted(plan: Plan, plot: SitePlot) -> Plan:
    """The plan for a plot of other plants.

    Along each axis the box about the plan's plants is stretched to the plot's: upwards to ``plant_height_m``, along and
    across the row to ``length_m`` and ``width_m`` where these are beyond the plan's plants or short of them by more
    than 0.25 m. A station keeps to the stretched box as it kept to the plan's; its distance from the box goes with the
    plants' height, but is never less than the plan's clearance, where it was more. It looks at the stretched place of
    what it looked at. Heights and pitches stay within the plan's envelope. A plan that was fitted to a plot is not
    changed by fitting it again.

    Args:
        plan: with plants, in the plot frame.
        plot: what the site says of it.

    Returns:
        The plan itself where the plot is the plan's as far as is known: it says no height and no size, or the same.

    Raises:
        MissionError: the plan does not say where plants are, or the plot is too different.
    """
    facts = PlanFacts(plan)
    if plot.plant_height_m is None and plot.size_m is None:
        return plan
    if facts.box is None or facts.top_m is None or facts.top_m <= 0.0 or plan.plants is None:
        raise MissionError(
            f"{plot.name}: the plan does not say where its plants are, so it cannot be fitted to others",
            remedy="Make the plan again with fieldkit plan, or leave --fit out.",
        )
    scale = _scale(facts, plot)
    if (np.abs(scale - 1.0) < 1e-9).all():
        return plan
    if scale.min() < SMALLEST or scale.max() > LARGEST:
        raise MissionError(
            f"{plot.name} is too different from the plot of the plan: its plants' length, width and height are "
            f"{scale[0]:.2f}, {scale[1]:.2f} and {scale[2]:.2f} times the plan's",
            remedy="Plan again on a plot like it.",
        )
    low, high = np.append(facts.box[0], 0.0), np.append(facts.box[1], facts.top_m)
    stations = tuple(_moved(station, plan, low, high, scale) for station in plan.stations)
    points = tuple((float(x), float(y), float(z)) for x, y, z in facts.points * scale)
    cell_m = plan.plants.cell_m * float(scale.max())
    length, width, height = (float(factor) for factor in scale)
    return plan.model_copy(
        update={
            "stations": stations,
            "plants": PlanPlants(points_m=points, cell_m=cell_m),
            "fit": PlanFit(plot=plot.name, length=length, width=width, height=height),
        }
    )


def fitted_to(plan: Plan, plots: Sequence[SitePlot]) -> dict[str, Plan]:
    """A plan for each plot, by name; plots alike have one and the same. Raises MissionError, as `fitted`."""
    known: dict[object, Plan] = {}
    found = {}
    for plot in plots:
        alike = (plot.plant_height_m, plot.size_m)
        if alike not in known:
            known[alike] = fitted(plan, plot)
        found[plot.name] = known[alike]
    return found


def _scale(facts: PlanFacts, plot: SitePlot) -> Array:
    """(3,) by which the plan's plants are stretched along, across and upwards."""
    scale = np.ones(3)
    assert facts.box is not None
    assert facts.top_m is not None
    if plot.plant_height_m is not None and abs(plot.plant_height_m / facts.top_m - 1.0) > _SAME:
        scale[2] = plot.plant_height_m / facts.top_m
    if plot.size_m is not None:
        reach = 2.0 * np.maximum(np.abs(facts.box[0]), np.abs(facts.box[1]))
        for axis, side in enumerate(plot.size_m):
            if abs(side - reach[axis]) > 2.0 * BESIDE_M:
                scale[axis] = side / reach[axis]
    return scale


def _moved(station: Station, plan: Plan, low: Array, high: Array, scale: Array) -> Station:
    position = np.array(station.position_m, dtype=np.float64)
    kept = np.clip(position, low, high)
    away = position - kept
    distance = float(np.linalg.norm(away))
    clearance = 0.0 if plan.envelope is None else plan.envelope.plant_distance_m or 0.0
    grown = max(distance * float(scale[2]), min(distance, clearance))
    there = kept * scale + (away * (grown / distance) if distance > 0.0 else 0.0)
    if plan.envelope is not None and plan.envelope.lower_m is not None:
        there[2] = max(there[2], plan.envelope.lower_m[2])
    forward = station.pose.forward
    along = max(float((0.5 * (low + high) - position) @ forward), _NEAREST_AIM_M)
    ray = (position + along * forward) * scale - there
    flat = math.hypot(ray[0], ray[1])
    yaw = math.degrees(math.atan2(ray[0], ray[1])) if flat > 1e-9 else station.yaw_deg
    pitch = math.degrees(math.atan2(ray[2], flat))
    if plan.envelope is not None and plan.envelope.pitch_deg is not None:
        pitch = min(max(pitch, plan.envelope.pitch_deg[0]), plan.envelope.pitch_deg[1])
    x, y, z = (float(value) for value in there)
    return Station(position_m=(x, y, z), yaw_deg=yaw, pitch_deg=pitch)
