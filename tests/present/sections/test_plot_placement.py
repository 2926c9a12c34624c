"""Plots found again from their stations."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.present.sections.plot_placement import placed_plots
from fieldkit.present.sections.route import Route, RouteStation
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.scenes.rigs import ring

PLAN = plan_from_poses([*ring(7, 1.4, 1.3, (0.1, 0.0, 0.3)), *ring(3, 0.9, 2.1, (0.0, 0.2, 0.3))])
STATIONS = np.array([station.position_m for station in PLAN.stations])


def route(places: np.ndarray, plot: str = "A") -> Route:
    stations = tuple(RouteStation(plot, k, tuple(place), 0.0, -30.0) for k, place in enumerate(places))
    return Route("field", (50.0, 6.0), None, stations, places, (), ())


@settings(deadline=None, max_examples=60)
@given(
    st.floats(0.0, 360.0), st.tuples(*[st.floats(-300.0, 300.0)] * 2), st.floats(-20.0, 20.0),
    st.tuples(*[st.floats(-0.3, 0.3)] * 2),
)  # fmt: skip
def test_a_plot_is_found_wherever_it_lies(
    degrees: float, shift: tuple[float, float], up: float, slope: tuple[float, float]
) -> None:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))

    def flown(points: np.ndarray) -> np.ndarray:
        flat = points[:, :2] @ np.array([[c, -s], [s, c]]).T + shift
        return np.column_stack([flat, points[:, 2] + up + points[:, :2] @ np.array(slope)])

    (plot,) = placed_plots(route(flown(STATIONS)), PLAN)
    plants = np.array([[0.3, -0.2, 0.8], [-0.5, 0.1, 0.0]])
    np.testing.assert_allclose(plot.place(plants), flown(plants), atol=1e-3)


def test_another_plan_is_not_taken_for_it() -> None:
    moved = STATIONS.copy()
    moved[2, 0] += 0.3
    assert placed_plots(route(moved), PLAN) == ()
    assert placed_plots(route(STATIONS[:2]), PLAN) == ()


def test_a_mirrored_plot_is_not_a_turned_one() -> None:
    assert placed_plots(route(STATIONS * (1.0, -1.0, 1.0)), PLAN) == ()
