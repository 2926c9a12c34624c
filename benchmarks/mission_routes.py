"""Routes: tours against the known shortest ones, and a field of many plots from plan to files."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.missions.export import route_plan
from fieldkit.missions.files.formats import mission_bytes
from fieldkit.results.plan import Plan, PlanPlants
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.routing.mission import Home
from fieldkit.routing.tour import shortest_tour
from fieldkit.sites.placement import SiteFrame
from fieldkit.sites.site import Site, SitePlot
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit_sim.simulation import ring

_PLACES = {
    "berlin52": """
565 575 25 185 345 750 945 685 845 655 880 660 25 230 525 1000 580 1175 650 1130 1605 620 1220 580 1465 200 1530 5
845 680 725 370 145 665 415 635 510 875 560 365 300 465 520 585 480 415 835 625 975 580 1215 245 1320 315 1250 400
660 180 410 250 420 555 575 665 1150 1160 700 580 685 595 685 610 770 610 795 645 720 635 760 650 475 960 95 260
875 920 700 500 555 815 830 485 1170 65 830 610 605 625 595 360 1340 725 1740 245
""",
    "eil51": """
37 52 49 49 52 64 20 26 40 30 21 47 17 63 31 62 52 33 51 21 42 41 31 32 5 25 12 42 36 16 52 41 27 23 17 33 13 13 57 58
62 42 42 57 16 57 8 52 7 38 27 68 30 48 43 67 58 48 58 27 37 69 38 46 46 10 61 33 62 63 63 69 32 22 45 35 59 15 5 6
10 17 21 10 5 64 30 15 39 10 32 39 25 32 25 55 48 28 56 37 30 40
""",
    "st70": """
64 96 80 39 69 23 72 42 48 67 58 43 81 34 79 17 30 23 42 67 7 76 29 51 78 92 64 8 95 57 57 91 40 35 68 40 92 34 62 1
28 43 76 73 67 88 93 54 6 8 87 18 30 9 77 13 78 94 55 3 82 88 73 28 20 55 27 43 95 86 67 99 48 83 75 81 8 19 20 18
54 38 63 36 44 33 52 18 12 13 25 5 58 85 5 67 90 9 41 76 25 76 37 64 56 63 10 55 98 7 16 74 89 60 48 82 81 76 29 60
17 22 5 45 79 70 9 100 17 82 74 67 10 68 48 19 83 86 84 94
""",
    "kroA100": """
1380 939 2848 96 3510 1671 457 334 3888 666 984 965 2721 1482 1286 525 2716 1432 738 1325 1251 1832 2728 1698 3815 169
3683 1533 1247 1945 123 862 1234 1946 252 1240 611 673 2576 1676 928 1700 53 857 1807 1711 274 1420 2574 946 178 24
2678 1825 1795 962 3384 1498 3520 1079 1256 61 1424 1728 3913 192 3085 1528 2573 1969 463 1670 3875 598 298 1513
3479 821 2542 236 3955 1743 1323 280 3447 1830 2936 337 1621 1830 3373 1646 1393 1368 3874 1318 938 955 3022 474
2482 1183 3854 923 376 825 2519 135 2945 1622 953 268 2628 1479 2097 981 890 1846 2139 1806 2421 1007 2290 1810
1115 1052 2588 302 327 265 241 341 1917 687 2991 792 2573 599 19 674 3911 1673 872 1559 2863 558 929 1766 839 620
3893 102 2178 1619 3822 899 378 1048 1178 100 2599 901 3416 143 2961 1605 611 1384 3113 885 2597 1830 2586 1286
161 906 1429 134 742 1025 1625 1651 1187 706 1787 1009 22 987 3640 43 3756 882 776 392 1724 1642 198 1810 3950 1558
""",
}

OPTIMA = {"berlin52": 7542, "eil51": 426, "st70": 675, "kroA100": 21282}


def distances(name: str) -> FloatArray:
    """(n, n) EUC_2D distances: rounded to whole numbers."""
    places = np.array(_PLACES[name].split(), dtype=np.float64).reshape(-1, 2)
    matrix: FloatArray = np.rint(np.linalg.norm(places[:, None] - places[None], axis=2))
    return matrix


_COLUMNS, _EAST_M, _NORTH_M = 20, 10.0, 12.0


@dataclass(frozen=True)
class Tour:
    """A tour compared with the shortest."""

    name: str
    """Of the places."""
    places: int
    """Number of places."""
    excess: float
    """Length ÷ shortest − 1."""
    cpu_s: float
    """CPU seconds."""


@dataclass(frozen=True)
class Field:
    """A field from plan to files."""

    plots: int
    stations: int
    flights: int
    """Their numbers."""
    length_m: float
    time_s: float
    """Of all flights."""
    least_plants_m: float
    """Distance of any leg to a plant."""
    route_s: float
    write_s: float
    """CPU seconds of placing and routing, and of writing."""


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
    plan, site = _plan(stations), site_of(plots)
    route_plan(plan, vehicle, site_of(2))  # compiles the kernels
    began = time.process_time()
    routed = route_plan(plan, vehicle, site, seed=seed)
    between = time.process_time()
    for each in routed.flights:
        mission_bytes("plan", each.mission, vehicle)
    ended = time.process_time()
    assert routed.plants_m is not None
    return Field(
        plots,
        routed.photographs,
        len(routed.flights),
        routed.length_m,
        routed.time_s,
        routed.plants_m,
        between - began,
        ended - between,
    )


def _tour(name: str, matrix: FloatArray, shortest: float, seed: int) -> Tour:
    began = time.process_time()
    order = shortest_tour(matrix, seed=seed)
    length = sum(matrix[a, b] for a, b in zip(order, (*order[1:], order[0]), strict=True))
    return Tour(name, len(matrix), float(length) / shortest - 1.0, time.process_time() - began)


def _apart(places: FloatArray) -> FloatArray:
    matrix: FloatArray = np.linalg.norm(places[:, None] - places[None], axis=2)
    return matrix


def _plan(stations: int) -> Plan:
    """A ring about four rows of plants, 2 m high."""
    rng = np.random.default_rng(0)
    points = [
        (x + 0.12 * rng.standard_normal(), y + 0.12 * rng.standard_normal(), rng.uniform(0.0, 2.0))
        for x in np.arange(-1.1, 1.2, 0.75)
        for y in np.arange(-1.2, 1.3, 0.2)
        for _ in range(40)
    ]
    cells = np.unique(np.round(np.array(points) / 0.05) * 0.05, axis=0).round(3)
    plants = PlanPlants(points_m=tuple((x, y, z) for x, y, z in cells.tolist()), cell_m=0.05)
    return plan_from_poses(ring(stations, 2.7, 1.5), plants=plants)


def site_of(plots: int) -> Site:
    """Plots in rows of 20, north-east of home."""
    home = Home(latitude_deg=50.8649, longitude_deg=6.4473)
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
