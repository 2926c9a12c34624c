"""Runs that are killed, full disks, workers that crash, two runs in one folder: `make soak`; docs/reliability.md.

Every command is run unbroken first. Then it is killed (SIGKILL, with all its processes, or alone) at random moments,
with a cold cache and with a warm one; what it leaves has to be absent or whole, and the same command has to give the
same result.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import psutil
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "sim")]
from tests.campaign.examples import campaign_folder, field  # noqa: E402
from tests.captures.photographs import exif_block  # noqa: E402
from tests.endtoend.commands import DRAFT, CommandLine, contents, finish, partial_folders  # noqa: E402

PHOTOGRAPHS = ROOT / "tests" / "data" / "small_plot"
DISKS = ("16k", "128k", "600k", "2m")


@dataclass(frozen=True)
class Job:
    """A command and its result, below the folder that it is run in."""

    words: tuple[str, ...]
    result: str
    needs: str = ""
    """What is copied beside it first, from the folder of unbroken runs."""
    again: tuple[str, ...] = ()
    """For going on where the result's folder is there already."""


JOBS = {
    "reference": Job(("reference", str(PHOTOGRAPHS), "-o", "ref", "--no-scene", *DRAFT), "ref"),
    "evaluate": Job(("evaluate", str(PHOTOGRAPHS), "--reference", "ref", "-o", "scores", *DRAFT), "scores", "ref"),
    "plan": Job(
        (
            "plan", "--captures", str(PHOTOGRAPHS), "--reference", "ref", "-n", "5", "--method", "score", "--repeats",
            "1", "--workers", "2", "-o", "plan",
        ),
        "plan", "ref", ("plan", "--resume", "-o", "plan"),
    ),
    "campaign": Job(("evaluate", "card", "--campaign", "season"), "season", "card season"),
    "export": Job(("campaign", "export", "season", "-o", "season.gpkg"), "season.gpkg", "season"),
    "report": Job(("report", "scores", "-o", "report.html"), "report.html", "scores"),
}  # fmt: skip
JOBS["plan on Dask"] = replace(JOBS["plan"], words=(*JOBS["plan"].words, "--scheduler", "DASK"))
_CLUSTER = (
    "import time; from distributed import LocalCluster\n"
    "if __name__ == '__main__':\n"
    "    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)\n"
    "    print(cluster.scheduler_address, flush=True); time.sleep(1e6)\n"
)
_STAY_S = 20.0
"""Within which workers notice that their command is gone."""


def copied(job: Job, source: Path, folder: Path, before: Path) -> None:
    """Put what a job needs into its folder; a campaign for it to evaluate is the one before its visits."""
    for name in job.needs.split():
        shutil.copytree((before if name == job.result else source) / name, folder / name)


def same(a: Path, b: Path) -> bool:
    """Whether two results are alike, but for how long they took; a GeoPackage holds the time of writing."""
    if a.is_file() or b.is_file():
        return a.is_file() and b.is_file() and _told(a) == _told(b)
    first, second = _comparable(a), _comparable(b)
    return first == second


def _told(file: Path) -> object:
    if file.suffix != ".gpkg":
        return file.read_bytes()
    with sqlite3.connect(file) as database:
        return [line for line in database.iterdump() if "gpkg_contents" not in line]


def _comparable(folder: Path) -> dict[str, bytes]:
    found = {}
    for name, data in contents(folder).items():
        if not name.endswith((".jsonl", "outcome.json", "plots.csv", ".lock")):
            timed = name.endswith(".json")  # those of plots.csv are listed there, too
            data = data.replace(str(folder.parent).encode(), b"") if timed else data  # photographs' places
            found[name] = re.sub(rb'"(bytes|cpu_s|sha256)": [^,}]+', b"", data) if timed else data
    return found


def draft_campaign(folder: Path, plots: int) -> Path:
    """A campaign of plots side by side."""
    made = campaign_folder(folder, field(1, plots))
    text = (made / "campaign.toml").read_text("utf-8").replace('fidelity = "standard"', 'fidelity = "draft"')
    (made / "campaign.toml").write_text(text, encoding="utf-8")
    return made


def children(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """Its workers."""
    found = psutil.Process(process.pid).children(recursive=True)
    return [each for each in found if "spawn_main" in " ".join(each.cmdline())]


class Soak:
    """The figures, and what went wrong."""

    def __init__(self, folder: Path, seed: int, jobs: Sequence[str]) -> None:
        self.jobs = jobs
        self.folder, self.random = folder, random.Random(seed)  # noqa: S311 - moments of kills
        self.unbroken, self.before = folder / "unbroken", folder / "before"
        self.seconds: dict[str, float] = {}
        self.count: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.cluster: subprocess.Popen[str] | None = None
        if "plan on Dask" in jobs:
            script = folder / "cluster.py"
            script.write_text(_CLUSTER, encoding="utf-8")
            self.cluster = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
            assert self.cluster.stdout is not None
            self.scheduler = self.cluster.stdout.readline().strip()

    def words(self, words: Sequence[str]) -> list[str]:
        """With the cluster's address."""
        return [self.scheduler if word == "DASK" else word for word in words]

    def prepare(self) -> None:
        """Run every command unbroken."""
        for place in (self.unbroken, self.before, self.folder / "made"):
            place.mkdir(parents=True)
        for plot in ("r1c1", "r1c2"):
            shutil.copytree(PHOTOGRAPHS, self.unbroken / "card" / plot / "2026-06-18")
        made = draft_campaign(self.folder / "made", 2)
        shutil.copytree(made, self.unbroken / "season")
        shutil.copytree(made, self.before / "season")
        line = CommandLine(self.unbroken, self.folder / "warm")
        for name in self.jobs:
            job, begun = JOBS[name], time.monotonic()
            if name == "plan on Dask" and "plan" in self.jobs:
                self.seconds[name] = self.seconds["plan"]
                continue
            done = line.run(*self.words(job.words))
            self.seconds[name] = time.monotonic() - begun
            print(f"{name}: {self.seconds[name]:.0f} s unbroken, exit code {done.code}", flush=True)
            assert done.code == 0, done.err

    def line(self, job: Job, *, warm: bool) -> CommandLine:
        """A folder of its own with what a job needs, and a cache."""
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        copied(job, self.unbroken, folder, self.before)
        cache = folder / ".cache"
        if warm:
            shutil.copytree(self.folder / "warm", cache)
        return CommandLine(folder, cache)

    def check(self, name: str, right: bool, what: str) -> None:
        """Note what is wrong."""
        if not right:
            self.wrong.append(f"{name}: {what}")
            print(f"WRONG {self.wrong[-1]}", flush=True)

    def kill(self, name: str, *, warm: bool) -> None:
        """Kill a run, look at what it leaves, and run it again."""
        job, line = JOBS[name], self.line(JOBS[name], warm=warm)
        process = line.start(*self.words(job.words))
        after, alone = self.random.uniform(0.05, 0.95) * self.seconds[name], self.random.random() < 0.3
        time.sleep(after)
        with_all: list[psutil.Process] = []
        if process.poll() is None:
            command = psutil.Process(process.pid)
            with_all = [command, *command.children(recursive=True)]
        for each in with_all[:1] if alone else with_all:
            with suppress(psutil.NoSuchProcess):
                each.kill()
        process.communicate()
        _, stay = psutil.wait_procs(with_all[1:], timeout=_STAY_S)
        self.check(name, not stay, f"{len(stay)} workers stayed when their command was killed")
        self.count[f"kills of {name}" if with_all else "too late"] += 1
        print(f"{name} {'killed' if with_all else 'ended'} after {after:.1f} s{' alone' * alone}", flush=True)
        result, expected = line.folder / job.result, self.unbroken / job.result
        if (
            result.exists() and name != "campaign" and not name.startswith("plan")
        ):  # these grow by whole evaluations and visits
            self.check(name, same(result, expected), "half of a result stood as a whole one")
            shutil.rmtree(result) if result.is_dir() else result.unlink()
        resumed = job.again if job.again and (result / "search.json").exists() else job.words
        begun = time.monotonic()
        done = line.run(
            *self.words(resumed), *(("--overwrite",) if resumed is job.words and name.startswith("plan") else ())
        )
        self.seconds[name] = time.monotonic() - begun
        self.check(name, done.code == 0, f"exit code {done.code} after a kill: {done.err[-300:]}")
        self.check(name, same(result, expected), "another result after a kill")
        self.check(name, not partial_folders(line.folder), "a hidden folder stayed")
        shutil.rmtree(line.folder)

    def full_disk(self, name: str, size: str) -> None:
        """Run on a disk that is full at some write: whole, or told and nothing left."""
        job, line = JOBS[name], self.line(JOBS[name], warm=True)
        disk = line.folder / "disk"
        disk.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(disk)], check=True)
        try:
            words = list(job.words)
            words[words.index("-o") + 1] = str(disk / job.result)
            done = line.run(*words)
            self.count["full disks" if done.code else "disks that sufficed"] += 1
            self.check(name, done.code in (0, 3), f"exit code {done.code} on a disk of {size}: {done.err[-300:]}")
            if done.code == 0:
                shutil.move(disk / job.result, line.folder / job.result)  # results name what they were made of
                self.check(name, same(line.folder / job.result, self.unbroken / job.result), f"another one on {size}")
            elif name != "plan":
                self.check(name, not contents(disk), f"files stayed on a disk of {size}")
        finally:
            subprocess.run(["umount", "-l", str(disk)], check=True)
        shutil.rmtree(line.folder)

    def clock(self, name: str, years: float) -> None:
        """Run with files of before that are from the future, or from long ago."""
        job, line = JOBS[name], self.line(JOBS[name], warm=True)
        then = time.time() + years * 365.25 * 86400
        for path in line.folder.rglob("*"):
            os.utime(path, (then, then))
        done = line.run(*self.words(job.words))
        self.count["clocks set"] += 1
        self.check(name, done.code == 0, f"exit code {done.code} with files of another time: {done.err[-300:]}")
        self.check(name, same(line.folder / job.result, self.unbroken / job.result), "another result at another time")
        shutil.rmtree(line.folder)

    def crash(self, how: signal.Signals) -> None:
        """A worker of a plan ends by a segmentation fault, or hangs until it is killed: its call is repeated."""
        job, line = JOBS["plan"], self.line(JOBS["plan"], warm=True)
        process = line.start(*job.words)
        while process.poll() is None and not (found := children(process)):
            time.sleep(0.05)
        if process.poll() is None:
            time.sleep(self.random.uniform(0.0, 3.0))
            try:
                found[0].send_signal(how)
                self.count[f"workers with {how.name}"] += 1
                if how == signal.SIGSTOP:
                    time.sleep(3.0)
                    found[0].kill()
            except psutil.NoSuchProcess:
                self.count["too late"] += 1
        done = finish(process)
        self.check("plan", done.code == 0, f"exit code {done.code} after a worker crashed: {done.err[-300:]}")
        self.check("plan", same(line.folder / "plan", self.unbroken / "plan"), "another plan after a worker crashed")
        shutil.rmtree(line.folder)

    def campaign_on_dask(self, plots: int) -> None:
        """A campaign of two dates on a cluster, one of whose workers is killed midway, against one on processes."""
        folders = [self.folder / name / "a" for name in ("processes", "cluster")]
        for date in ("2026-06-18", "2026-06-25"):
            for number in range(plots):
                place = folders[0] / "card" / f"r1c{number + 1}" / date
                shutil.copytree(PHOTOGRAPHS, place)
                for k, file in enumerate(sorted(place.glob("*.jpg"))):  # others on every plot: nothing is in the cache
                    taken = f"{date.replace('-', ':')} {9 + number // 6:02}:{number % 6 * 10:02}:{4 * k:02}"
                    with Image.open(file) as image:
                        image.save(file, quality=95 - number, exif=exif_block(detail={0x9003: taken}))
        shutil.copytree(folders[0] / "card", folders[1] / "card")
        lines = [CommandLine(folder, folder / ".cache") for folder in folders]
        for folder in folders:
            draft_campaign(folder, plots)
        words = ["evaluate", "card", "--campaign", "season", *("--workers", "2")]
        done = lines[0].run(*words)
        self.check("campaign", done.code == 0, f"exit code {done.code} on processes: {done.err[-300:]}")
        process = lines[1].start(*words[:-2], "--scheduler", self.scheduler)
        visits, killed = folders[1] / "season" / "visits", False
        while process.poll() is None:
            if not killed and len(list(visits.glob("*/*/visit.json"))) >= plots // 2:
                assert self.cluster is not None
                self.random.choice(children(self.cluster)).kill()
                killed = True
                self.count["workers of Dask killed"] += 1
            time.sleep(0.2)
        done = finish(process)
        self.check("campaign", done.code == 0 and killed, f"exit code {done.code} on Dask: {done.err[-300:]}")
        self.check("campaign", same(folders[1] / "season", folders[0] / "season"), "other results on Dask")
        self.count["visits on Dask"] += len(list(visits.glob("*/*/visit.json")))

    def two_runs(self, name: str) -> None:
        """Two runs of one command in one folder: one is whole, the other is whole or refused."""
        job, line = JOBS[name], self.line(JOBS[name], warm=True)
        ended = [finish(each) for each in [line.start(*self.words(job.words)) for _ in range(2)]]
        codes = sorted(each.code for each in ended)
        self.count["pairs of runs"] += 1
        self.check(name, codes in ([0, 0], [0, 2], [0, 3]), f"two runs in one folder ended with {codes}")
        self.check(name, same(line.folder / job.result, self.unbroken / job.result), "another result of two runs")
        shutil.rmtree(line.folder)


def main() -> int:
    """Soak, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--warm", type=float, default=0.75, help="share of kills with a warm cache")
    parser.add_argument("--plots", type=int, default=40, help="of a campaign of two dates on Dask; 0 for none")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=JOBS, default=list(JOBS), help="with all that they need")
    given = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fieldkit-soak-") as folder:
        soak = Soak(Path(folder), given.seed, given.only)
        if given.kills:
            soak.prepare()
        for k in range(given.kills):
            soak.kill(given.only[k % len(given.only)], warm=soak.random.random() < given.warm)
        for k in range(given.kills and max(2, given.kills // 20)):
            if "plan" in given.only:
                soak.crash((signal.SIGSEGV, signal.SIGSTOP)[k % 2])
            soak.clock(given.only[k % len(given.only)], (-40.0, 5.0)[k % 2])
            soak.two_runs(given.only[k % len(given.only)])
        for name in given.only if given.kills else ():
            for size in DISKS if given.kills >= 100 else DISKS[1:2]:
                if name not in ("campaign", "plan on Dask"):  # the campaign's folder is not made by the command
                    soak.full_disk(name, size)
        if given.plots and soak.cluster is not None:
            soak.campaign_on_dask(given.plots)
        if soak.cluster is not None:
            soak.cluster.terminate()
            soak.cluster.wait()
    for what, number in sorted(soak.count.items()):
        print(f"{what}: {number}")
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = used.ru_utime + used.ru_stime
    print(f"wrong: {len(soak.wrong)}; {(time.monotonic() - begun) / 60:.0f} min, {cpu_s / 60:.0f} CPU min")
    return 1 if soak.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
