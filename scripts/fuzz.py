"""Readers of files from elsewhere, family by family, on changed files: `make fuzz`; docs/reliability.md.

Missions, sites, plots and vehicles have `python -m benchmarks missions --only fuzz`. Each family is read in a process
of its own that may take a gigabyte beyond what the readers' libraries hold. A defect is anything but a result or a
FieldkitError, more than five seconds, more memory, or the end of the process; its file is kept.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import psutil

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "sim")]
from benchmarks.fuzzing import LIMIT_S, Target, fuzz  # noqa: E402
from fieldkit.campaign.reading import read_campaign_file  # noqa: E402
from fieldkit.captures.camera_file import read_camera_file  # noqa: E402
from fieldkit.captures.capture import read_photo  # noqa: E402
from fieldkit.captures.folder import Candidate  # noqa: E402
from fieldkit.captures.geo_txt import read_geo_txt  # noqa: E402
from fieldkit.captures.markers_file import read_markers_file  # noqa: E402
from fieldkit.captures.poses_csv import read_poses_csv  # noqa: E402
from fieldkit.captures.programs import PosesFile  # noqa: E402
from fieldkit.captures.programs.results import read_result  # noqa: E402
from fieldkit.clouds import Cloud, read_cloud, write_cloud  # noqa: E402
from fieldkit.documents.json_file import read_model  # noqa: E402
from fieldkit.flightlogs import read_flight_log  # noqa: E402
from fieldkit.results.plan_file import load_plan, save_plan  # noqa: E402
from fieldkit.results.visit import Visit  # noqa: E402
from fieldkit.scenes.library import scenes_folder  # noqa: E402
from fieldkit.scenes.scene_file import read_scene  # noqa: E402
from tests.campaign.examples import PLAN, campaign_folder, field  # noqa: E402
from tests.captures.programs.known_set import known_poses, write_colmap, write_metashape, write_shots  # noqa: E402
from tests.flightlogs.recordings import recording  # noqa: E402
from tests.flightlogs.test_hostile_logs import dataflash  # noqa: E402
from tests.flightlogs.test_px4_logs import flight  # noqa: E402
from tests.flightlogs.ulog_file import write_ulog  # noqa: E402

PLOT = ROOT / "tests" / "data" / "small_plot"
BATCH = 100
MOST_BYTES = 1 << 30
"""That readers may take beyond their libraries."""


def families(folder: Path) -> dict[str, dict[str, Target]]:
    """The readers and their good files."""
    poses, rng = known_poses(), np.random.default_rng(0)
    cloud = Cloud(rng.random((50, 3)), rng.integers(0, 255, (50, 3), dtype=np.uint8))
    made = {}
    for name in ("a.ply", "a.las"):
        write_cloud(folder / name, cloud)
        made[name] = (folder / name).read_bytes()
    model = write_colmap(folder / "model", poses, text=True)
    save_plan(folder / "plan.json", PLAN)
    season = campaign_folder(folder, field(1, 1))
    visit = Visit(plot="r1c1", date="2026-06-18", images=13, chamfer_m=0.01, photographs={"a.jpg": "0" * 64})
    tlog = recording("naive.tlog").read_bytes()
    geo = b"EPSG:4326\nIMG_1.jpg 10.4370 52.2960 81.5 10 -40 0 0.02 0.03\nIMG_2.jpg 10.4371 52.2960 81.5\n"
    markers = b'dictionary = "DICT_4X4_50"\nside_m = 0.1\n[[distance]]\na = 3\nb = 7\ndistance_m = 1.25\n'
    return {
        "photographs": {"jpg": _target(".jpg", read_photograph, *_bytes(PLOT.glob("IMG_000[12].jpg")))},
        "sidecars": {
            "poses.csv": _target(".csv", read_poses_csv, (PLOT / "poses.csv").read_bytes()),
            "geo.txt": _target(".txt", read_geo_txt, geo),
            "camera.toml": _target(".toml", read_camera_file, (PLOT / "camera.toml").read_bytes()),
            "markers.toml": _target(".toml", read_markers_file, markers),
        },
        "programs": {
            "metashape": _target(".xml", read_poses, write_metashape(folder / "m.xml", poses).read_bytes()),
            "odm": _target(".geojson", read_poses, write_shots(folder / "s.geojson", poses).read_bytes()),
            **{
                f"colmap {name}": _target(".txt", partial(read_model_with, model, name), (model / name).read_bytes())
                for name in ("cameras.txt", "images.txt")
            },
        },
        "clouds": {name[2:]: _target(name[1:], read_cloud, data) for name, data in made.items()},
        "logs": {
            "tlog": _target(".tlog", read_flight_log, tlog[:40_000]),
            "BIN": _target(".BIN", read_flight_log, dataflash()),
            "ulg": _target(".ulg", read_flight_log, write_ulog(flight())),
        },
        "results": {
            "plan": _target(".json", load_plan, (folder / "plan.json").read_bytes()),
            "visit": _target(".json", read_visit, visit.model_dump_json(indent=1).encode()),
            "campaign": _target(".toml", read_campaign_file, (season / "campaign.toml").read_bytes()),
            "scene": _target(".toml", read_scene, *_bytes(scenes_folder().glob("case-*.toml"))),
        },
    }


def read_photograph(path: Path) -> object:
    """A photograph's metadata, and whether it decodes."""
    return read_photo(Candidate(path, path.name, "JPEG"))


def read_poses(path: Path) -> object:
    """Another program's poses."""
    return read_result(PosesFile(path, "metres" if path.suffix == ".xml" else ""))


def read_model_with(model: Path, name: str, path: Path) -> object:
    """A COLMAP model of which one file is a changed one."""
    good = (model / name).read_bytes()
    (model / name).write_bytes(path.read_bytes())
    try:
        return read_result(PosesFile(model, "metres"))
    finally:
        (model / name).write_bytes(good)


def read_visit(path: Path) -> Visit:
    """A visit."""
    return read_model(Visit, "visit", path, "Evaluate again.", max_bytes=8 << 20)


def _target(suffix: str, read: Any, *seeds: bytes) -> Target:
    return Target(suffix, seeds, read)


def _bytes(paths: Any) -> list[bytes]:
    return [path.read_bytes() for path in sorted(paths)]


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def fuzz_for(targets: Mapping[str, Target], seconds: float, folder: Path, seed: int) -> bool:
    """Fuzz each reader of a family for its share of CPU seconds; whether nothing was found."""
    right = True
    for name, target in targets.items():
        files = accepted = hangs = batch = 0
        slowest, defects, begun = 0.0, dict[str, int](), time.process_time()
        before = _peak_mb()
        while time.process_time() - begun < seconds / len(targets):
            done = fuzz(target, BATCH, folder, seed * 100_003 + batch)
            batch, files, accepted, hangs = batch + 1, files + done.files, accepted + done.accepted, hangs + done.hangs
            slowest = max(slowest, done.slowest_s)
            for kind, number in done.defects.items():
                defects[kind] = defects.get(kind, 0) + number
        more = _peak_mb() - before
        print(
            f"  {name}: {files:,} files, {accepted:,} read, {hangs} hangs, slowest {slowest:.2f} s, {more:.0f} MB more"
        )
        for kind, number in defects.items():
            print(f"    DEFECT {number} × {kind}")
        right &= not defects and not hangs and slowest < LIMIT_S
        sys.stdout.flush()
    return right


def in_a_child(targets: Mapping[str, Target], seconds: float, folder: Path, seed: int, kept: Path) -> bool:
    """`fuzz_for` with limited memory; a file that ends the process is kept."""
    sys.stdout.flush()
    child = os.fork()
    if not child:
        held = psutil.Process().memory_info().vms
        resource.setrlimit(resource.RLIMIT_AS, (held + MOST_BYTES, held + MOST_BYTES))
        os._exit(not fuzz_for(targets, seconds, folder, seed))
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code < 0:
        kept.mkdir(parents=True, exist_ok=True)
        last = max(folder.glob("file.*"), key=lambda file: file.stat().st_mtime)
        shutil.copyfile(last, kept / f"seed-{seed}{last.suffix}")
        print(f"    DEFECT the process ended by {signal.Signals(-code).name}: {kept / f'seed-{seed}{last.suffix}'}")
    return code == 0


def main() -> int:
    """Fuzz the families."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600.0, help="CPU seconds of a family")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", help="families")
    parser.add_argument("--kept", type=Path, default=Path("fuzz-kept"), help="folder of files that ended a process")
    given = parser.parse_args()
    right = True
    with tempfile.TemporaryDirectory(prefix="fieldkit-fuzz-") as folder:
        for family, targets in families(Path(folder)).items():
            print(family)
            if not given.only or family in given.only:
                right &= in_a_child(targets, given.seconds, Path(folder), given.seed, given.kept)
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
