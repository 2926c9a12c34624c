"""Routes: tours against the known shortest ones, and a field of many plots from plan to files."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.tsplib import OPTIMA, distances
from fieldkit.missions.export import route_plan
from fieldkit.missions.files.writing import mission_bytes
from fieldkit.results.plan import Plan, PlanPlants
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.routing.tour import shortest_tour
from fieldkit.sites.placement import SiteFrame
from fieldkit.sites.site import Site, SiteHome, SitePlot
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit_sim.simulation import ring

_COLUMNS, _EAST_M, _NORTH_M = 20, 10.0, 12.0


@dataclass(frozen=True)
class Tour:
    """A tour compared with the shortest.

    Attributes:
        name: of the places.
        places: number of places.
        excess: length ÷ shortest − 1.
        cpu_s: CPU seconds.
    """

    name: str
    places: int
    excess: float
    cpu_s: float


@dataclass(frozen=True)
class Field:
    """A field from plan to files.

    Attributes:
        plots, stations, flights: their numbers.
        length_m, time_s: of all flights.
        least_plants_m: distance of any leg to a plant.
        route_s, write_s: CPU seconds of placing and routing, and of writing.
    """

    plots: int
    stations: int
    flights: int
    length_m: float
    time_s: float
    least_plants_m: float
    route_s: float
    write_s: float


def tours(seed: int) -> list[Tour]:
    """Tours of TSPLIB, and of places on an ellipse (shortest: outline) and on a grid (shortest: a step per place)."""
    found = [_tour(name, distances(name), OPTIMA[name], seed) for name in OPTIMA]
    rng = np.random.default_rng(seed)
    for count in (100, 300):
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
        outline = np.column_stack([3.0 * np.cos(angles), np.sin(angles)])
        shortest = float(np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1).sum())
        found.append(_tour(f"ellipse of {count}", _apart(rng.permutation(outline)), shortest, seed))
    for side in (10, 18):
        grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2).astype(np.float64)
        found.append(_tour(f"grid of {side * side}", _apart(grid), float(side * side), seed))
    return found


def route_field(plots: int, stations: int, vehicle: Vehicle, seed: int) -> Field:
    """Place a plan on many plots, route, split, check every leg, and write every flight as .plan."""
    plan, site = _plan(stations), _site(plots)
    route_plan(plan, vehicle, _site(2))  # compiles the kernels
    began = time.process_time()
    routed = route_plan(plan, vehicle, site, seed=seed)
    between = time.process_time()
    for each in routed.flights:
        mission_bytes("plan", each.mission, vehicle)
    ended = time.process_time()
    assert routed.plants_m is not None
    return Field(
        plots, routed.photographs, len(routed.flights), routed.length_m, routed.time_s, routed.plants_m,
        between - began, ended - between,
    )  # fmt: skip


def _tour(name: str, matrix: NDArray[np.float64], shortest: float, seed: int) -> Tour:
    began = time.process_time()
    order = shortest_tour(matrix, seed=seed)
    length = sum(matrix[a, b] for a, b in zip(order, (*order[1:], order[0]), strict=True))
    return Tour(name, len(matrix), float(length) / shortest - 1.0, time.process_time() - began)


def _apart(places: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix: NDArray[np.float64] = np.linalg.norm(places[:, None] - places[None], axis=2)
    return matrix


def _plan(stations: int) -> Plan:
    """A ring about four rows of plants, 2 m high."""
    rng = np.random.default_rng(0)
    points = [
        (x + 0.12 * rng.standard_normal(), y + 0.12 * rng.standard_normal(), rng.uniform(0.0, 2.0))
        for x in np.arange(-1.1, 1.2, 0.75) for y in np.arange(-1.2, 1.3, 0.2) for _ in range(40)
    ]  # fmt: skip
    cells = np.unique(np.round(np.array(points) / 0.05) * 0.05, axis=0).round(3)
    plants = PlanPlants(points_m=tuple((x, y, z) for x, y, z in cells.tolist()), cell_m=0.05)
    return plan_from_poses(ring(stations, 2.7, 1.5), plants=plants)


def _site(plots: int) -> Site:
    home = SiteHome(latitude_deg=50.8649, longitude_deg=6.4473)
    frame = SiteFrame(home)
    grid = [(20.0 + _EAST_M * (k % _COLUMNS), 15.0 + _NORTH_M * (k // _COLUMNS), 0.0) for k in range(plots)]
    latitude, longitude, _ = frame.to_geodetic(np.array(grid))
    rows = tuple(
        SitePlot(
            name=f"plot-{k:03}", latitude_deg=float(a), longitude_deg=float(b), row_heading_deg=72.0, plant_height_m=2.0
        )
        for k, (a, b) in enumerate(zip(latitude, longitude, strict=True))
    )
    return Site(name="field", home=home, plots=rows)
