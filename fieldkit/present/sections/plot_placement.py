"""Where a mission's plots lie, found from its stations and the plan's: the route does not say it otherwise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.present.sections.route import Route
from fieldkit.results.plan import Plan

_LEAST = 3
_FITS_M = 0.05


@dataclass(frozen=True, eq=False)
class PlacedPlot:
    """A plot frame in metres about home.

    Attributes:
        name: of the plot.
        turn: (2, 2) rotation of its axes about z.
        shift_m: (2,) of its origin.
        height: (3,) of its ground: at the origin, and rise per metre along its x and y.
    """

    name: str
    turn: NDArray[np.float64]
    shift_m: NDArray[np.float64]
    height: NDArray[np.float64]

    def place(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """(n, 3) points of the plot frame, east, north and up of home."""
        flat = points[:, :2] @ self.turn.T + self.shift_m
        up = points[:, 2] + self.height[0] + points[:, :2] @ self.height[1:]
        return np.column_stack([flat, up]).astype(np.float32)


def placed_plots(route: Route, plan: Plan) -> tuple[PlacedPlot, ...]:
    """The route's plots on which this plan is flown as it is, to within 5 cm over ground."""
    wanted = np.array([station.position_m for station in plan.stations])
    found = []
    for name in route.plots:
        flown = [s for s in route.stations if s.plot == name and 0 <= s.station < len(wanted)]
        if len(flown) >= _LEAST:
            plot = _fitted(name, wanted[[s.station for s in flown]], np.array([s.position_m for s in flown]))
            if plot is not None:
                found.append(plot)
    return tuple(found)


def _fitted(name: str, planned: NDArray[np.float64], flown: NDArray[np.float64]) -> PlacedPlot | None:
    """Rotation about z and shift by least squares (Kabsch), then the ground's plane from the heights."""
    middles = planned[:, :2].mean(axis=0), flown[:, :2].mean(axis=0)
    u, _, vt = np.linalg.svd((planned[:, :2] - middles[0]).T @ (flown[:, :2] - middles[1]))
    turn = vt.T @ np.diag([1.0, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    shift = middles[1] - turn @ middles[0]
    if float(np.abs(planned[:, :2] @ turn.T + shift - flown[:, :2]).max()) > _FITS_M:
        return None
    table = np.column_stack([np.ones(len(planned)), planned[:, :2]])
    height, *_ = np.linalg.lstsq(table, flown[:, 2] - planned[:, 2], rcond=1e-6)
    return PlacedPlot(name, turn, shift, np.asarray(height, dtype=np.float64))
