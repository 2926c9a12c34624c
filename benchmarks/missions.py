"""`python -m benchmarks missions`: files there and back, poses of recorded flights, uploads, routes, fuzzing."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.flown_poses import Flown, flown_poses
from benchmarks.mission_fuzz import fuzz_all, targets
from benchmarks.mission_passes import foretell
from benchmarks.mission_routes import route_field, tours
from benchmarks.mission_trips import make_trips, random_mission
from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.suite import run_studies
from benchmarks.upload_trials import Trials, cut_trials, upload_trials
from fieldkit.missions.autopilots.writing import render
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.routing.mission import Mission
from fieldkit.runtime.progress import Progress
from fieldkit.runtime.shipped import shipped_folder
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit_sim.simulation import ring

NO_RECORDINGS = "the recordings of flights (sim/sitl) come with the repository, not with the installed package"
_LOGS = ("mount_then_yaw", "naive", "hold0", "probe_items")
_LOSSES = (0.05, 0.20)
_SPEED = 16.0


@dataclass(frozen=True)
class MissionOptions:
    """Options of the studies."""

    data: Path | None
    """Folder of the recorded image sets, or None; further recordings of flights are in ``sitl`` beside it."""
    seed: int = 0
    """Of everything random."""
    missions: int = 10_000
    """Of ``trips``, in two formats and dialects each."""
    passes: int = 2_000
    """Missions of ``passes``."""
    uploads: int = 100
    """Number in ``uploads``, at each loss and with broken links."""
    plots: int = 200
    """Of ``routes``."""
    files: int = 100_000
    """Of ``fuzz``."""


def recordings() -> dict[str, Path]:
    """The recorded flights in the repository, by name; empty without the repository."""
    folder = shipped_folder("sim/sitl")
    return {name: file for name in _LOGS if (file := folder / f"{name}.tlog").is_file()}


def _trips(options: MissionOptions, progress: Progress) -> StudyResult:
    vehicles = [load_vehicle("ardupilot-pitch"), load_vehicle("px4-gimbal")]
    with progress.stage("Missions there and back"), tempfile.TemporaryDirectory() as folder:
        found = make_trips(options.missions, vehicles, Path(folder), options.seed)
    return StudyResult(
        name="trips",
        title="Random missions there and back",
        tables=(ResultTable.of("Items equal to 1e-7° and 1 cm, photographs with heading and pitch", found),),
        notes=tuple(problem for t in found for problem in t.wrong),
        figures={"trips": [asdict(t) for t in found]},
    )


def _passes(options: MissionOptions, progress: Progress) -> StudyResult:
    with progress.stage("Passes there and back"), tempfile.TemporaryDirectory() as folder:
        found = foretell(options.passes, Path(folder), options.seed)
    return StudyResult(
        name="passes",
        title="Random missions of passes",
        tables=(ResultTable.of("Photographs foretold", found),),
        figures={"passes": [asdict(each) for each in found]},
    )


def _poses(options: MissionOptions, progress: Progress) -> StudyResult:
    title, near = "Achieved poses of recorded flights", recordings()
    if not near:
        return StudyResult("poses", title, skipped=NO_RECORDINGS)
    folders = [next(iter(near.values())).parent]
    if options.data is not None and (options.data.parent / "sitl").is_dir():
        folders.append(options.data.parent / "sitl")
    found: list[Flown] = []
    for folder in folders:
        for log in sorted([*folder.glob("*.tlog"), *folder.glob("*.BIN.gz")]):
            name = log.name.split(".")[0]
            told = json.loads((folder / f"{name}.json").read_text("utf-8"))
            if log.name not in {each.log for each in found} and told.get("triggers"):
                with progress.stage(log.name):
                    found.append(flown_poses(log, told["triggers"]))
    return StudyResult(
        name="poses",
        title=title,
        tables=(ResultTable.of("Largest difference from what the recording says", found),),
        notes=("The autopilot's estimate, not the simulator's truth. By the track: from its messages only.",),
        figures={"poses": [asdict(f) for f in found]},
    )


def _uploads(options: MissionOptions, progress: Progress) -> StudyResult:
    title, logs = "Uploads over bad links", recordings()
    if "probe_items" not in logs:
        return StudyResult("uploads", title, skipped=NO_RECORDINGS)
    vehicle = load_vehicle("ardupilot-pitch")
    items = render(_thirteen(options.seed), vehicle)[1:]
    found: list[Trials] = []
    figures: dict[str, object] = {}
    for loss in _LOSSES:
        with progress.stage(f"{options.uploads} uploads at {loss:.0%} loss"):
            done = upload_trials(
                options.uploads, loss, options.seed, items=items, recording=logs["probe_items"], speed=_SPEED
            )
        figures[f"loss {loss:g}"] = asdict(done)
        found.append(done)
    with progress.stage(f"{options.uploads} broken links"):
        cut = cut_trials(options.uploads, options.seed, items=items, recording=logs["probe_items"], speed=_SPEED)
    figures["cut"] = asdict(cut)
    cuts = ResultTable.of("Links broken after a random packet, then mended", [cut])
    return StudyResult(
        name="uploads",
        title=title,
        tables=(
            ResultTable.of(
                f"{len(items)} items and home over a connection of MAVSDK, at 5 and 20 % loss each way", found
            ),
            cuts,
        ),
        notes=(f"The vehicle is the replay at {_SPEED:g} times its time, both sides' time-outs scaled alike.",),
        figures=figures,
    )


def _routes(options: MissionOptions, progress: Progress) -> StudyResult:
    with progress.stage("Tours"):
        known = tours(options.seed)
    with progress.stage(f"{options.plots} plots"):
        field = route_field(options.plots, 13, load_vehicle("ardupilot-pitch"), options.seed)
    return StudyResult(
        name="routes",
        title="Routes",
        tables=(
            ResultTable.of("Tours against the shortest", known),
            ResultTable.of("A field from plan to .plan files, every leg checked", [field]),
        ),
        figures={"tours": [asdict(t) for t in known], "field": asdict(field)},
    )


def _fuzz(options: MissionOptions, progress: Progress) -> StudyResult:
    plan = plan_from_poses(ring(5, 1.4, 1.1)).model_dump_json(indent=2).encode()
    found = fuzz_all(targets(recordings(), (plan,)), options.files, options.seed, progress)
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            name,
            f.files,
            f.accepted,
            f.refused,
            sum(f.defects.values()),
            f.hangs,
            f"{f.slowest_s:.2f}",
            len(f.written),
        )
        for name, f in found.items()
    )
    columns = ("files", "read>", "accepted>", "refused>", "tracebacks>", "hangs>", "slowest, s>", "files written>")
    return StudyResult(
        name="fuzz",
        title="Changed files",
        tables=(ResultTable("Whatever is neither read nor refused with a message is a defect", columns, rows),),
        notes=tuple(f"{name}: {kind}, {count} times" for name, f in found.items() for kind, count in f.defects.items()),
        figures={name: {**asdict(f), "written": list(f.written)} for name, f in found.items()},
    )


def _thirteen(seed: int) -> Mission:
    """The first random mission with 13 photographs."""
    rng = np.random.default_rng(seed)
    while len((mission := random_mission(rng)).shots) != 13:
        pass
    return mission


STUDIES: dict[str, Callable[[MissionOptions, Progress], StudyResult]] = {
    "trips": _trips,
    "passes": _passes,
    "poses": _poses,
    "uploads": _uploads,
    "routes": _routes,
    "fuzz": _fuzz,
}


def run_missions(
    output: Path, names: Sequence[str], options: MissionOptions, *, progress: Progress, overwrite: bool = False
) -> list[StudyResult]:
    """Run studies one after the other and write results.json and results.md."""
    return run_studies(output, names, STUDIES, ["poses", "routes"], options, progress=progress, overwrite=overwrite)
