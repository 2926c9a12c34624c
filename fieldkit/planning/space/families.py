"""Structured sets of N cameras, given by a few numbers instead of five per camera.

Every camera of a family looks at one point above the plot's middle. A family's parameters are a point of the unit cube,
which can be searched. The decoded cameras may be infeasible; `PlanningProblem.nearest` makes them feasible.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import NARROWEST, reach_m

SPAN_DEG = (60.0, 360.0)
"""Span of arcs: from ten cameras 6° apart to the whole circle."""
_ELLIPTIC = 0.35
"""Largest stretch of an ellipse."""

Values = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Family:
    """Sets of cameras by a point of the unit cube."""

    name: str
    """``"ring"``, ``"arc"``, ``"spiral"`` or ``"chain"``."""
    limits: Mapping[str, tuple[float, float]]
    """The cube's axes: least and greatest value of each parameter. A name ends with its unit (_m, _deg) if it has one.
    """
    build: Callable[[Values], Cameras]
    """Makes the cameras of given values, which may be infeasible."""

    def __len__(self) -> int:
        return len(self.limits)

    def decode(self, unit: ArrayLike) -> Cameras:
        """The N cameras of a point (k,) of the unit cube; they look at the plot and may be infeasible."""
        shares = np.clip(np.asarray(unit, dtype=np.float64), 0.0, 1.0)
        limits = zip(self.limits.items(), shares, strict=True)
        return self.build({name: float(low + share * (high - low)) for (name, (low, high)), share in limits})


@dataclass(frozen=True)
class Circle:
    """N cameras evenly on a horizontal circle from north, all looking at one point above the plot's middle."""

    radius_m: float
    """Horizontal."""
    altitude_m: float
    """Above the ground below each camera."""
    aim_m: float
    """Z of the point that all look at."""

    def __str__(self) -> str:
        return f"circle {self.radius_m:.2f} m at {self.altitude_m:.2f} m, aim {self.aim_m:.2f} m"

    def cameras(self, problem: PlanningProblem) -> Cameras:
        """The cameras, which may be infeasible."""
        azimuth = 360.0 * np.arange(problem.count) / problem.count
        radius, altitude = np.full(problem.count, self.radius_m), np.full(problem.count, self.altitude_m)
        return placed(problem, azimuth, radius, altitude, self.aim_m)


def circles(
    problem: PlanningProblem, altitudes: int = 5, radii: int = 5, aims: int = 1, *, inner: bool = False
) -> tuple[Circle, ...]:
    """A grid of circles: radii change fastest, then altitudes, then aims.

    Args:
        altitudes, radii, aims: number of values, spread evenly over `PlanningProblem.ranges` including its ends; a
            single value is the middle.
        inner: leaves half a step to each end instead, which suits few circles.
    """
    ranges = problem.ranges
    return tuple(
        Circle(float(radius), float(altitude), float(aim))
        for aim in _spread(ranges.aim_m, aims, inner)
        for altitude in _spread(ranges.altitude_m, altitudes, inner)
        for radius in _spread(ranges.radius_m, radii, inner)
    )


def families(problem: PlanningProblem) -> tuple[Family, ...]:
    """All families for a problem's N, plot, camera and envelope.

    Radii lie between 0.3 of the envelope's reach and all of it, altitudes in the height band above the ground below
    each camera, the aim point in the inner 80 % of the volume's height. Azimuths of an arc lie span / N apart, so that
    360° is an even ring.

    - ring: radius, altitude, aim, phase within one step, and an ellipse's stretch along x against y.
    - arc: span, azimuth of its middle, radius, altitude, aim, and how much farther apart its outer cameras stand.
    - spiral: an arc whose radius and altitude change evenly from one value to another.
    - chain: two alternating levels along an arc, each with its radius and altitude, the second shifted by a share of a
    step.
    """
    count, reach, ranges = problem.count, reach_m(problem.envelope), problem.ranges
    radii, altitudes, aims = (NARROWEST * reach, reach), ranges.altitude_m, ranges.aim_m
    turned = {"span_deg": SPAN_DEG, "middle_deg": (-180.0, 180.0)}
    level, aim = {"radius_m": radii, "altitude_m": altitudes, "aim_m": aims}, {"aim_m": aims}
    even = (np.arange(count) + 0.5) / count - 0.5

    def ring(v: Values) -> Cameras:
        azimuth = v["phase_deg"] + 360.0 * np.arange(count) / count
        sine, cosine = np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))
        x, y = (1.0 + v["stretch"]) * sine, (1.0 - v["stretch"]) * cosine
        azimuth = np.degrees(np.arctan2(x, y))
        return placed(problem, azimuth, v["radius_m"] * np.hypot(x, y), np.full(count, v["altitude_m"]), v["aim_m"])

    def arc(v: Values) -> Cameras:
        # An odd function that keeps both ends and increases for any widening between −0.5 and 1.
        along = even * (1.0 + v["widening"] * (4.0 * even**2 - 1.0))
        flat = np.full(count, v["radius_m"]), np.full(count, v["altitude_m"])
        return placed(problem, v["middle_deg"] + v["span_deg"] * along, *flat, v["aim_m"])

    def spiral(v: Values) -> Cameras:
        t = np.linspace(0.0, 1.0, count)
        radius = v["first_radius_m"] + t * (v["last_radius_m"] - v["first_radius_m"])
        altitude = v["first_altitude_m"] + t * (v["last_altitude_m"] - v["first_altitude_m"])
        return placed(problem, v["middle_deg"] + v["span_deg"] * even, radius, altitude, v["aim_m"])

    def chain(v: Values) -> Cameras:
        upper = np.arange(count) % 2 == 1
        azimuth = v["middle_deg"] + v["span_deg"] * (even + np.where(upper, v["shift"] / count, 0.0))
        radius = np.where(upper, v["upper_radius_m"], v["lower_radius_m"])
        altitude = np.where(upper, v["upper_altitude_m"], v["lower_altitude_m"])
        return placed(problem, azimuth, radius, altitude, v["aim_m"])

    def two(first: str, second: str) -> dict[str, tuple[float, float]]:
        limits = {"radius_m": radii, "altitude_m": altitudes}
        return {f"{which}_{name}": ends for name, ends in limits.items() for which in (first, second)}

    phase = {"phase_deg": (0.0, 360.0 / count), "stretch": (-_ELLIPTIC, _ELLIPTIC)}
    return (
        Family("ring", level | phase, ring),
        Family("arc", turned | level | {"widening": (-0.4, 0.6)}, arc),
        Family("spiral", turned | two("first", "last") | aim, spiral),
        Family("chain", turned | two("lower", "upper") | aim | {"shift": (-1.0, 1.0)}, chain),
    )


def placed(
    problem: PlanningProblem, azimuth_deg: FloatArray, radius_m: FloatArray, altitude_m: FloatArray, aim_m: float
) -> Cameras:
    """Cameras about a plot's middle that look at one point above it; they may be infeasible.

    Args:
        azimuth_deg: (n,) clockwise from north.
        radius_m: (n,) horizontal.
        altitude_m: (n,) above the ground below each camera.
        aim_m: z of the point.
    """
    x, y, _ = problem.center
    turn = np.radians(azimuth_deg)
    positions = np.column_stack([x + radius_m * np.sin(turn), y + radius_m * np.cos(turn), altitude_m])
    return Cameras.aimed(positions, np.array([x, y, aim_m]))


def _spread(limits: tuple[float, float], count: int, inner: bool) -> FloatArray:
    low, high = limits
    if inner:
        return low + (high - low) * (np.arange(count) + 0.5) / count
    return np.linspace(low, high, count) if count > 1 else np.array([0.5 * (low + high)])
