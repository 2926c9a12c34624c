"""A plan fitted to another plot: its distances relative to the plants' height and to the plot's size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.errors import MissionError
from fieldkit.results.plan import Plan, PlanEnvelope, PlanFit, PlanPlants, Plans, Station
from fieldkit.sites.plot_plants import BESIDE_M, STANDS_SHARE, PlanFacts, same_height_m
from fieldkit.sites.site import SitePlot

SMALLEST = 0.5
"""Least factor of height and size at which a plan is still the same plan."""
LARGEST = 2.0
"""Largest such factor."""
_NEAREST_AIM_M = 0.2
"""Least distance of the place that a station is taken to look at, metres."""
_NO_SIZE = {"length_m": None, "width_m": None}


@dataclass(frozen=True, eq=False)
class Stretch:
    """The box about a plan's plants is stretched along its axes to the box about a plot's plants.

    A camera keeps to the stretched box as it kept to the plan's; its distance from the box goes with the plants'
    height, but is never less than the plan's clearance, where it was more. It looks at the stretched place of what it
    looked at.
    """

    low: FloatArray
    high: FloatArray
    """(3,) corners of the box about the plan's plants, plot frame, metres; z above the ground."""
    scale: FloatArray
    """(3,) factors along, across and upwards."""
    clearance_m: float = 0.0
    """Of the plan."""
    lowest_m: float | None = None
    """Least z of a moved camera; None for no limit."""
    pitch_deg: tuple[float, float] | None = None
    """Range of the gimbal; None for no limit."""

    def moved(
        self, positions: FloatArray, yaw_deg: FloatArray, forward: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The moved cameras' positions (n, 3), yaws (n,) and pitches (n,).

        Args:
            positions: (n, 3) of the plan's, plot frame, metres.
            yaw_deg: (n,) of the plan's; kept by a camera that looks straight down.
            forward: (n, 3) unit vectors of the optical axes.
        """
        kept = np.clip(positions, self.low, self.high)
        away = positions - kept
        distance = np.linalg.norm(away, axis=1)
        grown = np.maximum(distance * self.scale[2], np.minimum(distance, self.clearance_m))
        there = kept * self.scale + away * (grown / np.where(distance > 0.0, distance, 1.0))[:, None]
        if self.lowest_m is not None:
            there[:, 2] = np.maximum(there[:, 2], self.lowest_m)
        along = ((0.5 * (self.low + self.high) - positions) * forward).sum(axis=1)
        aims = (positions + np.maximum(along, _NEAREST_AIM_M)[:, None] * forward) * self.scale
        ray = aims - there
        flat = np.hypot(ray[:, 0], ray[:, 1])
        yaw = np.where(flat > 1e-9, np.degrees(np.arctan2(ray[:, 0], ray[:, 1])), yaw_deg)
        pitch = np.degrees(np.arctan2(ray[:, 2], flat))
        return there, yaw, pitch if self.pitch_deg is None else np.clip(pitch, *self.pitch_deg)


def fitted(plan: Plan, plot: SitePlot) -> Plan:
    """The plan for a plot of other plants.

    Along each axis the box about the plan's plants is stretched to the plot's: upwards to ``plant_height_m``, along and
    across the row to ``length_m`` and ``width_m`` where these are beyond the plan's plants or short of them by more
    than 0.25 m. `Stretch` says how stations are moved. Heights and pitches stay within the plan's envelope. A plan that
    was fitted to a plot is not changed by fitting it again. The plan has plants, in the plot frame. The plan itself
    where the plot is the plan's as far as is known: it says no height and no size, or the same.
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
            f"{plot.name}: is too different from the plot of the plan: its plants' length, width and height are "
            f"{scale[0]:.2f}, {scale[1]:.2f} and {scale[2]:.2f} times the plan's",
            remedy="Plan again on a plot like it; --no-fit flies the plan as it is.",
        )
    limits = plan.envelope or PlanEnvelope()
    stretch = Stretch(
        np.append(facts.box[0], 0.0),
        np.append(facts.box[1], _height_m(facts)),
        scale,
        limits.plant_distance_m or 0.0,
        None if limits.lower_m is None else limits.lower_m[2],
        limits.pitch_deg,
    )
    points = tuple((float(x), float(y), float(z)) for x, y, z in facts.points * scale)
    cell_m = plan.plants.cell_m * float(scale.max())
    length, width, height = (float(factor) for factor in scale)
    return plan.model_copy(
        update={
            "stations": _stations(plan, stretch),
            "plant_height_m": None if plan.plant_height_m is None else plan.plant_height_m * height,
            "plants": PlanPlants(points_m=points, cell_m=cell_m),
            "fit": PlanFit(plot=plot.name, length=length, width=width, height=height),
        }
    )


def fitted_to_height(plan: Plan, plant_height_m: float) -> Plan:
    """The plan for plants of a height; itself if its stations are not stated for one. Raises MissionError."""
    if plan.plant_height_m is None:
        return plan
    name = f"plants of {plant_height_m:.2f} m"
    return fitted(plan, SitePlot(name=name, latitude_deg=0.0, longitude_deg=0.0, plant_height_m=plant_height_m))


def flown_plans(plan: Plans, plots: Sequence[SitePlot], fit: bool | None = None) -> Plans:
    """The plans that are flown over plots.

    Args:
        plan: for all plots, or each plot's own by name, which is flown as it is.
        fit: whether to fit the plan to each plot's plant height and size; None fits a plan whose stations are stated
            for plants of a height, to the height only.
    """
    if not isinstance(plan, Plan):
        return plan
    if fit is None:
        stated = plan.plant_height_m is not None
        return fitted_to(plan, [plot.model_copy(update=_NO_SIZE) for plot in plots]) if stated else plan
    return fitted_to(plan, plots) if fit else plan


def flown_plan(plan: Plan, plot: SitePlot, fit: bool | None = None) -> Plan:
    """The plan that is flown over one plot; as `flown_plans`."""
    flown = flown_plans(plan, [plot], fit)
    return flown if isinstance(flown, Plan) else flown[plot.name]


def fitted_to(plan: Plan, plots: Sequence[SitePlot]) -> dict[str, Plan]:
    """A plan for each plot, by name; plots alike to a centimetre have one and the same. Raises MissionError."""
    known: dict[object, Plan] = {}
    found = {}
    for plot in plots:
        alike = (plot.plant_height_m, plot.size_m and tuple(round(side, 2) for side in plot.size_m))
        if alike not in known:
            known[alike] = fitted(plan, plot)
        found[plot.name] = known[alike]
    return found


def _height_m(facts: PlanFacts) -> float:
    """Of the plants that the plan's stations are stated for, else of its highest."""
    known = facts.plan.plant_height_m or facts.top_m
    assert known is not None
    return known


def _scale(facts: PlanFacts, plot: SitePlot) -> FloatArray:
    """(3,) by which the plan's plants are stretched along, across and upwards."""
    scale = np.ones(3)
    assert facts.box is not None
    height_m = _height_m(facts)
    if plot.plant_height_m is not None and abs(plot.plant_height_m - height_m) > same_height_m(height_m):
        scale[2] = plot.plant_height_m / height_m
    if plot.size_m is not None:
        # Leaves and plants that lean reach out of an outline; where plants stand they do not.
        standing = np.abs(facts.points[facts.points[:, 2] <= STANDS_SHARE * (facts.top_m or 0.0), :2])
        reach = 2.0 * np.maximum(np.abs(facts.box[0]), np.abs(facts.box[1]))
        feet = 2.0 * standing.max(axis=0, initial=0.0)
        for axis, side in enumerate(plot.size_m):
            if side > reach[axis] + 2.0 * BESIDE_M:
                scale[axis] = side / reach[axis]
            elif side < min(feet[axis], reach[axis]) - 2.0 * BESIDE_M:
                scale[axis] = side / feet[axis]
    return scale


def _stations(plan: Plan, stretch: Stretch) -> tuple[Station, ...]:
    poses = [station.pose for station in plan.stations]
    positions, yaw, pitch = stretch.moved(
        np.array([station.position_m for station in plan.stations]),
        np.array([station.yaw_deg for station in plan.stations]),
        np.array([pose.forward for pose in poses]),
    )
    return tuple(
        Station(position_m=(x, y, z), yaw_deg=heading, pitch_deg=tilt)
        for (x, y, z), heading, tilt in zip(positions.tolist(), yaw.tolist(), pitch.tolist(), strict=True)
    )
