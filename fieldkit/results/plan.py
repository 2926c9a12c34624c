"""What plan.json holds. Units are in the keys: _m metres, _deg degrees.

Positions are in the plot frame, whose z = 0 is the fitted ground; that is the datum of all heights here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, Self

from pydantic import PositiveFloat, model_validator

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.results.fields import Count, Heading, Length, Pitch, Sha256, Strict, Vector
from fieldkit.results.pattern import Pattern


class Station(Strict):
    """Where one photograph is taken."""

    position_m: Vector
    """Plot frame."""
    yaw_deg: Heading
    """Of the optical axis, clockwise from the plot frame's y axis."""
    pitch_deg: Pitch
    """Of the gimbal: 0 at the horizon, −90 straight down."""

    @property
    def pose(self) -> Pose:
        """The commanded pose; its roll is 0."""
        return Pose.from_yaw_pitch(self.position_m, self.yaw_deg, self.pitch_deg)


class PlanEnvelope(Strict):
    """Where stations were allowed to be; null where a limit was not set."""

    lower_m: Vector | None = None
    """Lowest corner of the box, plot frame."""
    upper_m: Vector | None = None
    """Highest corner."""
    plant_distance_m: Length | None = None
    """Least distance from plants."""
    station_distance_m: Length | None = None
    """Least distance between stations."""
    pitch_deg: tuple[float, float] | None = None
    """Lowest and highest gimbal pitch."""


class PlanPlants(Strict):
    """The plants that a flight keeps clear of."""

    points_m: tuple[Vector, ...]
    """Plot frame; one per occupied cell of a grid."""
    cell_m: PositiveFloat
    """The grid's cell: no plant is farther than its diagonal from one of the points."""


class PlanSource(Strict):
    """What the plan was made on."""

    kind: Literal["reference", "scene", "captures"]
    name: str
    """Of the folder or file."""
    sha256: Sha256 | None = None
    """Of its reference.json or scene file."""


class PlanMethod(Strict):
    """How the stations were found."""

    name: str
    seed: Count | None = None
    evaluations: Count | None = None
    chamfer_m: Length | None = None
    """The objective's value at these stations: mean over repeats."""
    chamfer_spread_m: Length | None = None
    """Standard deviation over repeats."""
    repeats: Count | None = None
    """Evaluations at these stations; with 0 they are not confirmed."""
    plots: Count | None = None
    """That it was made for; with more than one each repeat is on a plot that had no part in finding it."""
    expected_m: Length | None = None
    """What the geometric score leads to expect, where the method goes by it alone."""
    weights: tuple[Length, Length, Length] | None = None
    """Of the geometric score's gap, noise and tie, where the method goes by it."""

    @property
    def known_spread_m(self) -> float | None:
        """Standard deviation over repeats, where there are two at least to tell it."""
        return self.chamfer_spread_m if (self.repeats or 0) > 1 else None


class PlanFit(Strict):
    """A plot that a plan was fitted to, and the factors by which its plants were stretched."""

    plot: str
    length: PositiveFloat
    """Along the plot frame's x axis."""
    width: PositiveFloat
    """Across."""
    height: PositiveFloat


class Plan(Strict):
    """plan.json: the stations of a few-view capture of one plot, or the pattern of passes over all plots of a field."""

    kind: Literal["plan"] = "plan"
    version: Literal[1] = 1
    fieldkit: str
    """Version that wrote it."""
    stations: tuple[Station, ...] = ()
    """Of each plot; none where there is a pattern."""
    pattern: Pattern | None = None
    """Null where there are stations."""
    camera: Intrinsics | None = None
    row_heading_deg: Heading | None = None
    """Compass heading of the plot frame's x axis."""
    envelope: PlanEnvelope | None = None
    plants: PlanPlants | None = None
    plant_height_m: PositiveFloat | None = None
    """Height of plants that the stations are stated for: they are fitted to each plot's. Null where they hold as they
    are."""
    source: PlanSource | None = None
    method: PlanMethod | None = None
    fit: PlanFit | None = None
    """Where the stations are those of a plan that was fitted to another plot; ``method`` says what it was worth on its
    own."""

    @model_validator(mode="after")
    def _stations_or_pattern(self) -> Self:
        if bool(self.stations) == (self.pattern is not None):
            raise ValueError("stations: a plan has stations or a pattern, either of the two")
        return self


Plans = Plan | Mapping[str, Plan]
"""One plan for all plots, or one for each by its plot's name."""


def station_number(index: int) -> int:
    """What people call a plan's station, everywhere: its index from 0, counted from 1."""
    return index + 1


def plan_on(plans: Plans, plot: str) -> Plan:
    """The plan of the plot of that name. Raises KeyError: there is none."""
    return plans if isinstance(plans, Plan) else plans[plot]
