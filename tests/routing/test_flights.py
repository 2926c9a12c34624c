"""From stops to flights."""

import math
from itertools import pairwise, permutations, product

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.errors import MissionError
from fieldkit.routing.flights import FileCapacity, Flight, Stop, plan_flights
from fieldkit.routing.motion import flight_time, landing_s, takeoff_s, turns_s
from fieldkit.routing.obstacles import Obstacles, Volume
from fieldkit.routing.plot_tours import Costs, split
from fieldkit.vehicles.vehicle import Battery, Vehicle
from tests.missions.clearance import is_clear
from tests.missions.vehicles import vehicle
from tests.routing.single_leg import safe_leg

HOME = (0.0, 0.0, 0.0)


def copter(endurance_s: float = 1200.0, max_items: int | None = None) -> Vehicle:
    return vehicle(battery=Battery(endurance_s=endurance_s, reserve=0.25), max_items=max_items)


def trial(seed: int, plots: int, stations: int, columns: int = 4) -> tuple[list[Stop], list[Volume]]:
    """Plots of plants in columns, each with stations on a ring at several heights."""
    rng = np.random.default_rng(seed)
    stops, volumes = [], []
    for plot in range(plots):
        middle = np.array([15.0 + 10.0 * (plot % columns), 12.0 + 10.0 * (plot // columns)])
        plants = middle + rng.uniform(-1.5, 1.5, (40, 2))
        ring = shapely.get_coordinates(shapely.MultiPoint(plants).convex_hull)[:-1]
        corners = tuple((float(x), float(y)) for x, y in ring)
        volumes.append(Volume(f"plot-{plot}", corners, float(rng.uniform(1.6, 2.4)), 0.5, "plants"))
        for k in range(stations):
            angle = 2 * math.pi * (k / stations + 0.1 * plot)
            x, y = middle + 3.1 * np.array([math.sin(angle), math.cos(angle)])
            place = (float(x), float(y), float(rng.choice([1.0, 1.5, 2.5, 3.5])))
            stops.append(Stop(place, math.degrees(angle) + 180.0, 5.0, f"plot-{plot}"))
    order = rng.permutation(len(stops))
    return [stops[k] for k in order], volumes


def fly(stops: list[Stop], obstacles: Obstacles, flown_by: Vehicle, seed: int = 0) -> tuple[Flight, ...]:
    return plan_flights(stops, HOME, HOME, obstacles, flown_by, takeoff_m=4.0, transit_m=5.0, seed=seed)


def spare(flight: Flight, most: int | None) -> float:
    return FileCapacity(most).spare(len(flight.stops)) - sum(len(leg.via) for leg in flight.legs)


def check(flights: tuple[Flight, ...], stops: list[Stop], obstacles: Obstacles, flown_by: Vehicle) -> None:
    """What every set of flights keeps."""
    assert sorted(k for flight in flights for k in flight.stops) == list(range(len(stops)))
    flown_plots = [plot for flight in flights for plot in flight.plots]
    assert sorted(flown_plots) == sorted({stop.plot for stop in stops})
    for flight in flights:
        assert [stops[k].plot for k in flight.stops] == sorted(
            (stops[k].plot for k in flight.stops), key=flight.plots.index
        )
        assert flight.time.total_s <= flown_by.battery.usable_s
        assert flight.time.battery <= 1.0
        assert spare(flight, flown_by.max_items) >= 0
        assert len(flight.legs) == len(flight.stops) + 1
        assert flight.legs[0].points[0] == (0.0, 0.0, 4.0)
        assert flight.legs[-1].points[-1] == (0.0, 0.0, 5.0)
        for before, after in pairwise(flight.legs):
            assert before.points[-1] == after.points[0]
        assert [leg.points[-1] for leg in flight.legs[:-1]] == [stops[k].position_m for k in flight.stops]
        assert all(is_clear(leg.points, obstacles) for leg in flight.legs)
        turns = [180.0, *np.diff([stops[k].yaw_deg for k in flight.stops]), 0.0]
        again = flight_time([leg.points for leg in flight.legs], turns, 5.0 * len(flight.stops), flown_by)
        assert again.total_s == pytest.approx(flight.time.total_s)


@settings(max_examples=8)
@given(st.integers(0, 10**6), st.integers(1, 7), st.integers(1, 6), st.sampled_from([250.0, 400.0, 1200.0]))
def test_flights_keep_everything(seed: int, plots: int, stations: int, endurance: float) -> None:
    stops, volumes = trial(seed, plots, stations)
    volumes.append(Volume.cylinder("mast", (20.0, 17.0), 0.2, 9.0, 1.0))
    volumes.append(Volume.no_fly("yard", ((6.0, 4.0), (8.0, 4.0), (8.0, 12.0), (6.0, 12.0)), 0.5))
    fence = (((-5.0, -5.0), (60.0, -5.0), (60.0, 40.0), (-5.0, 40.0)),)
    obstacles = Obstacles(tuple(volumes), fence, 0.5, ceiling_m=12.0)
    flown_by = copter(endurance, max_items=150)
    flights = fly(stops, obstacles, flown_by)
    check(flights, stops, obstacles, flown_by)
    assert flights == fly(stops, obstacles, flown_by)


def test_one_plot_is_flown_in_the_best_order() -> None:
    stops, volumes = trial(5, 1, 5)
    obstacles, flown_by = Obstacles(tuple(volumes)), copter()
    (flight,) = fly(stops, obstacles, flown_by)
    speeds = flown_by.speeds

    def seconds(a: tuple[float, ...], b: tuple[float, ...], turn: float, level: float | None) -> float:
        return max(safe_leg(a, b, obstacles, speeds, level_m=level).time_s, float(turns_s(turn, speeds)))

    table = {
        (i, j): seconds(a.position_m, b.position_m, b.yaw_deg - a.yaw_deg, None)
        for (i, a), (j, b) in product(enumerate(stops), repeat=2)
    }
    out = [seconds((0.0, 0.0, 4.0), stop.position_m, 180.0, 5.0) for stop in stops]
    back = [seconds(stop.position_m, (0.0, 0.0, 5.0), 0.0, 5.0) for stop in stops]
    best = min(
        out[order[0]] + sum(table[step] for step in pairwise(order)) + back[order[-1]]
        for order in permutations(range(len(stops)))
    )
    whole = takeoff_s(4.0, speeds) + best + 25.0 + landing_s(5.0, speeds)
    assert flight.time.total_s == pytest.approx(whole, rel=1e-9)


def test_plots_are_shared_out_to_as_few_flights_as_the_battery_allows() -> None:
    stops, volumes = trial(2, 12, 8)
    obstacles = Obstacles(tuple(volumes))
    (whole,) = fly(stops, obstacles, copter(4000.0))
    half = copter(0.6 * whole.time.total_s / 0.75)
    flights = fly(stops, obstacles, half)
    check(flights, stops, obstacles, half)
    assert len(flights) == 2
    most = 1000 - int(spare(whole, 1000))
    items = copter(4000.0, max_items=most - 1)
    flights = fly(stops, obstacles, items)
    check(flights, stops, obstacles, items)
    assert len(flights) == 2
    assert len(fly(stops, obstacles, copter(4000.0, max_items=most))) == 1


def test_a_plot_that_does_not_fit_is_named_with_how_much_is_lacking() -> None:
    stops, volumes = trial(1, 3, 6)
    far = [Stop((400.0, 0.0, 3.0), 0.0, 5.0, "far plot")]
    words = r"far plot: takes \d+ s alone, \d+ s of it there and back, \d+ s more than the 300 s"
    with pytest.raises(MissionError, match=words) as caught:
        fly(stops + far, Obstacles(tuple(volumes)), copter(400.0))
    taken, away, over = (int(word) for word in caught.value.message.replace("300 s", "").split() if word.isdigit())
    assert 0.3 * taken < away < taken
    assert taken - over == pytest.approx(300, abs=1)
    assert caught.value.exit_code == 5
    with pytest.raises(MissionError, match="plot-0: takes more than the 30 mission items"):
        fly([stop for stop in stops if stop.plot == "plot-0"], Obstacles(tuple(volumes)), copter(max_items=30))


def test_what_cannot_be_flown_is_named() -> None:
    stops, volumes = trial(3, 2, 5)
    inside = Stop((15.0, 12.0, 1.0), 0.0, 5.0, "plot-0", 8)
    with pytest.raises(MissionError, match=r"station 9 of plot-0: is \d\.\d\d m too low over the plants of plot-0"):
        fly([*stops, inside], Obstacles(tuple(volumes)), copter())
    with pytest.raises(MissionError, match="no stations"):
        fly([], Obstacles(), copter())
    with pytest.raises(MissionError, match=r"the take-off's way between the ground and 4.00 m comes too near to roof"):
        roof = Volume("roof", ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)), 2.0)
        fly(stops, Obstacles((*volumes, roof)), copter())
    ring = ((5.0, -50.0), (6.0, -50.0), (6.0, 80.0), (5.0, 80.0))
    with pytest.raises(MissionError, match=r"no safe way from the take-off to station .* of plot-.*no-fly zone road"):
        room = ((-9.0, -40.0), (70.0, -40.0), (70.0, 60.0), (-9.0, 60.0))
        fly(stops, Obstacles((*volumes, Volume.no_fly("road", ring)), (room,)), copter())
    with pytest.raises(MissionError, match=r"transit height of 5 m above home is above the ceiling of 4\.5 m"):
        fly(stops, Obstacles(tuple(volumes), ceiling_m=4.5), copter())


def test_a_fence_between_plots_is_flown_around() -> None:
    stops = [Stop((x, 10.0, 2.0), 0.0, 5.0, name) for x, name in ((-8.0, "west"), (8.0, "east"))]
    notch = ((-12.0, -5.0), (12.0, -5.0), (12.0, 15.0), (1.0, 15.0), (0.0, 3.0), (-1.0, 15.0), (-12.0, 15.0))
    obstacles = Obstacles(fence=(notch,), fence_clearance_m=0.5)
    flights = fly(stops, obstacles, copter())
    check(flights, stops, obstacles, copter())
    assert len(flights) == 1
    (between,) = flights[0].legs[1:-1]
    assert min(y for _, y, _ in between.points) < 3.0


@given(st.integers(0, 10**6), st.integers(1, 6), st.floats(20, 80))
def test_splitting_is_the_best_of_all_splittings(seed: int, plots: int, limit: float) -> None:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 4, plots)
    within = [rng.uniform(2, 12, (k, k)) for k in sizes]
    between = [rng.uniform(0, 9, (a, b)) for a, b in pairwise(sizes)]
    ways = ([rng.uniform(0, 9, k) for k in sizes] for _ in range(2))
    costs = Costs(next(ways), within, between, next(ways), 3.0)

    def flight(first: int, last: int) -> float:
        doors = [list(product(range(k), repeat=2)) for k in sizes[first : last + 1]]
        return 3.0 + min(
            costs.outward[first][chosen[0][0]]
            + sum(within[first + k][chosen[k]] for k in range(len(chosen)))
            + sum(between[first + k][chosen[k][1], chosen[k + 1][0]] for k in range(len(chosen) - 1))
            + costs.homeward[last][chosen[-1][1]]
            for chosen in product(*doors)
        )

    table = {(a, b): flight(a, b) for a in range(plots) for b in range(a, min(plots, a + 4))}
    for (a, b), seconds in table.items():
        found, chosen = costs.ends(a, b)
        assert found == pytest.approx(seconds)
        assert len(chosen) == b - a + 1
    found = split(costs, limit, lambda first, last: last - first < 4)
    ranks = []
    for cuts in product([False, True], repeat=plots - 1):
        ends = [0, *(k + 1 for k, cut in enumerate(cuts) if cut), plots]
        parts = [(a, b - 1) for a, b in pairwise(ends)]
        if all(part in table and table[part] <= limit for part in parts):
            ranks.append((len(parts), sum(table[part] for part in parts)))
    if found is None:
        assert any(table[k, k] > limit for k in range(plots))
        return
    assert all(table[part] <= limit + 1e-9 for part in found.flights)
    assert found.rank[0] >= min(ranks)[0]
    assert found.seconds == pytest.approx(sum(table[part] for part in found.flights))
    # Cost that falls with one plot more is the one case that a sweep from each plot onwards does not look for.
    if all(table[a, b + 1] >= table[a, b] for a, b in table if (a, b + 1) in table):
        assert found.rank == pytest.approx(min(ranks))
