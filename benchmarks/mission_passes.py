"""Random patterns over random fields, written as missions, read back by other programs, and foretold."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.mission_routes import site_of
from benchmarks.mission_trips import by_pymavlink, mavsdk_importer
from fieldkit.errors import MissionError
from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.export_mission import route_for_files
from fieldkit.missions.files.formats import FORMATS, mission_bytes, read_mission
from fieldkit.missions.settings import MissionSettings
from fieldkit.results.mission import Passing
from fieldkit.results.pattern import Look, Pattern
from fieldkit.results.plan import Plan
from fieldkit.sites.placement import SiteFrame
from fieldkit.sites.site import Site
from fieldkit.vehicles.vehicle_file import load_vehicle

FORMS = (
    ("ardupilot-pitch", "plan"),
    ("ardupilot-pan", "waypoints"),
    ("px4-gimbal", "plan"),
    ("px4-gimbal", "waypoints"),
    ("dji-mavic-3-enterprise", "wpml"),
    ("dji-mini-4-pro", "litchi"),
)
"""Vehicles and formats, in turns."""


@dataclass
class Foretold:
    """Of one vehicle and format; largest differences, metres and seconds."""

    vehicle: str
    form: str
    missions: int = 0
    refused: int = 0
    photographs: int = 0
    missing: int = 0
    extra: int = 0
    """Against the stations of each line."""
    station_m: float = 0.0
    """From a station to the nearest photograph."""
    at_edges: int = 0
    """Flights of which one photograph more or less is foretold, due just as a line ends, by what was read back."""
    place_m: float = 0.0
    time_s: float = 0.0
    """Between mission.json and what the other program read, carried out."""
    spare_m: float = np.inf
    """Least distance to plants, less the vehicle's clearance."""


def foretell(count: int, folder: Path, seed: int) -> list[Foretold]:
    """Write and read back ``count`` missions; ``folder`` is for the files."""
    rng, found = np.random.default_rng(seed), [Foretold(*form) for form in FORMS]
    with ExitStack() as stack:
        importers = {name: stack.enter_context(mavsdk_importer(name)) for name in ("ardupilot", "px4")}
        for number in range(count):
            own = found[number % len(FORMS)]
            form, vehicle = own.form, load_vehicle(own.vehicle)
            plan, site = _drawn(rng)
            frame = SiteFrame(site.home)
            try:
                routed = route_for_files(plan, vehicle, site, form, MissionSettings())
            except MissionError:
                own.refused += 1
                continue
            own.missions += 1
            own.spare_m = min(own.spare_m, (routed.plants_m or np.inf) - vehicle.clearance_m)
            for each in routed.flights:
                path = folder / f"passes{FORMATS[form][0]}"
                path.write_bytes(mission_bytes(form, each.mission, vehicle))
                read = replace(read_mission(path), home=site.home)
                if read.items:
                    items = (
                        importers[vehicle.dialect](path.read_text("utf-8")) if form == "plan" else by_pymavlink(path)
                    )
                    read = replace(read, items=tuple(items[-len(read.items) :]))
                flown = interpret(read, vehicle, vehicle.dialect)
                taken = [shot for shot in flown.photographs if shot.repeat is not None]
                foreseen = [stop for stop in each.stops if isinstance(stop, Passing)]
                there, here, wanted = (
                    frame.points(shot.place for shot in shots if shot.place)
                    for shots in (taken, foreseen, each.mission.passings)
                )
                own.photographs += len(here)
                planned, given = (
                    np.array([shot.line for shot in shots]) for shots in (each.mission.passings, foreseen)
                )
                for line in set(planned.tolist()):
                    stations, places = wanted[planned == line], here[given == line]
                    more = len(places) - len(stations)
                    own.missing -= min(0, more)
                    own.extra += max(0, more)
                    apart = np.linalg.norm(stations[:, None] - places, axis=2).min(axis=1)
                    own.station_m = max(own.station_m, float(apart.max()))
                if len(there) != len(here):
                    own.at_edges += 1
                    continue
                own.place_m = max(own.place_m, float(np.linalg.norm(there - here, axis=1).max()))
                times = [shot.time_s or 0.0 for shot in foreseen]
                own.time_s = max(own.time_s, float(np.abs(np.subtract([shot.time_s for shot in taken], times)).max()))
    return found


def _drawn(rng: np.random.Generator) -> tuple[Plan, Site]:
    """One to three looks, half of the first two to and fro, over up to 8 plots on heights of their own."""
    plants_m, row_deg, *heights = rng.uniform((0.2, 0.0, *[-0.5] * 8), (3.0, 360.0, *[0.5] * 8)).tolist()
    headings = rng.uniform(0.0, 360.0, 3)
    if rng.random() < 0.5:
        headings[1] = (headings[0] + 180.0) % 360.0
    looks = tuple(map(Look, headings.tolist(), rng.uniform(-90.0, -45.0, 3).tolist()))[: int(rng.integers(1, 4))]
    above, *laid = rng.uniform((1.2, 0.5, 1.5, 0.0, 0.3), (12.0, 4.0, 6.0, 1.0, 6.0)).tolist()
    known = {"length_m": 4.0, "width_m": 1.5, "datum": "home", "plant_height_m": plants_m, "row_heading_deg": row_deg}
    site = site_of(int(rng.integers(1, 9)))
    plots = [plot.model_copy(update={**known, "height_m": up}) for plot, up in zip(site.plots, heights, strict=False)]
    return Plan(fieldkit="0", pattern=Pattern(looks, plants_m + above, *laid)), site.model_copy(
        update={"plots": tuple(plots)}
    )
