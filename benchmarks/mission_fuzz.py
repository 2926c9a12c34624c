"""The readers of a flight's files, with good files to change."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from benchmarks.fuzzing import Fuzzed, Target, fuzz
from benchmarks.mission_trips import random_mission
from fieldkit.flightlogs import read_flight_log
from fieldkit.missions.check import check_mission
from fieldkit.missions.files.formats import FORMATS, mission_bytes, read_mission
from fieldkit.results.plan_file import load_plan
from fieldkit.runtime.progress import Progress
from fieldkit.sites.plots_file import load_plots
from fieldkit.sites.site_file import load_site
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.vehicles.vehicle_file import load_vehicle, missions_folder, vehicle_names
from fieldkit_sim.standin.recording import read_messages

_LOG_BYTES = 60_000
_SHARES = {"tlog read": 0.05, "tlog replayed": 0.05}
"""Shares of the files; other targets share the rest evenly."""


def targets(logs: Mapping[str, Path], plans: tuple[bytes, ...]) -> dict[str, Target]:
    """All readers of a flight's files, by name.

    Args:
        logs: recordings (tlog) by name; pieces of them are changed.
        plans: contents of plan.json files.
    """
    sites = missions_folder() / "sites"
    rng = np.random.default_rng(0)
    missions = [random_mission(rng, most=4) for _ in range(6)]
    flown = {
        "plan": ("ardupilot-pitch", "px4-gimbal"),
        "waypoints": ("ardupilot-pitch", "px4-gimbal"),
        "wpml": ("dji-mavic-3-enterprise",),
        "litchi": ("dji-mini-4-pro",),
    }
    found: dict[str, Target] = {}
    for form, names in flown.items():
        vehicles = [load_vehicle(name) for name in names]
        seeds = tuple(mission_bytes(form, mission, vehicle) for mission in missions for vehicle in vehicles)
        found[f"{FORMATS[form][0]} checked"] = Target(FORMATS[form][0], seeds, _checker(vehicles[0]))
    found["plots (GeoJSON)"] = Target(".geojson", _contents(sites, "*.geojson"), load_plots)
    alone = tuple(_without_files(content) for content in _contents(sites, "*.toml"))
    found["site (TOML)"] = Target(".toml", (*alone, *_contents(sites, "*.toml")), load_site)
    profiles = tuple((missions_folder() / "vehicles" / f"{name}.toml").read_bytes() for name in vehicle_names())
    found["vehicle (TOML)"] = Target(".toml", profiles, load_vehicle)
    found["plan.json"] = Target(".json", plans, load_plan)
    pieces = tuple(
        content[start : start + _LOG_BYTES]
        for path in logs.values()
        for content in [path.read_bytes()]
        for start in range(0, len(content), max(len(content) // 3, 1))
    )
    found["tlog read"] = Target(".tlog", pieces, read_flight_log)
    found["tlog replayed"] = Target(".tlog", pieces, lambda path: sum(1 for _ in read_messages(path)))
    return found


def fuzz_all(chosen: Mapping[str, Target], count: int, seed: int, progress: Progress) -> dict[str, Fuzzed]:
    """Read ``count`` changed files in all."""
    even = (1.0 - sum(_SHARES.get(name, 0.0) for name in chosen)) / sum(name not in _SHARES for name in chosen)
    found = {}
    for number, (name, target) in enumerate(chosen.items()):
        with progress.stage(name), tempfile.TemporaryDirectory() as folder:
            share = max(1, round(count * _SHARES.get(name, even)))
            found[name] = fuzz(target, share, Path(folder), seed * 1000 + number)
    return found


def _checker(vehicle: Vehicle) -> Callable[[Path], None]:
    def check(path: Path) -> None:
        check_mission(read_mission(path), vehicle)

    return check


def _without_files(site: bytes) -> bytes:
    """A site file without references to other files, which are not beside a changed one."""
    return b"".join(line for line in site.splitlines(keepends=True) if b".geojson" not in line)


def _contents(folder: Path, pattern: str) -> tuple[bytes, ...]:
    return tuple(path.read_bytes() for path in sorted(folder.glob(pattern)))
