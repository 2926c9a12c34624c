"""Runs that are killed, full disks, workers that crash, two runs in one folder: `make soak`; docs/reliability.md.

Every command is run unbroken first. Then it is killed (SIGKILL, with all its processes) at random moments, with a cold
cache and with a warm one; what it leaves has to be absent or whole, and the same command has to give the same result.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "sim")]
from tests.campaign.examples import campaign_folder, field  # noqa: E402
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


def copied(job: Job, source: Path, folder: Path, before: Path) -> None:
    """Put what a job needs into its folder; a campaign for it to evaluate is the one before its visits."""
    for name in job.needs.split():
        shutil.copytree((before if name == job.result else source) / name, folder / name)


def same(a: Path, b: Path) -> bool:
    """Whether two results are alike, but for how long they took; a GeoPackage holds the time of writing."""
    if a.is_file() or b.is_file():
        return a.is_file() and b.is_file() and (a.suffix == ".gpkg" or a.read_bytes() == b.read_bytes())
    first, second = _comparable(a), _comparable(b)
    return first == second


def _comparable(folder: Path) -> dict[str, bytes]:
    found = {}
    for name, data in contents(folder).items():
        if not name.endswith((".jsonl", "outcome.json", "progress.csv", "plots.csv", ".lock")):
            timed = name.endswith(".json")  # those of plots.csv are listed there, too
            data = data.replace(str(folder.parent).encode(), b"") if timed else data  # photographs' places
            found[name] = re.sub(rb'"(bytes|cpu_s|sha256)": [^,}]+', b"", data) if timed else data
    return found


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

    def prepare(self) -> None:
        """Run every command unbroken."""
        for place in (self.unbroken, self.before, self.folder / "made"):
            place.mkdir(parents=True)
        for plot in ("r1c1", "r1c2"):
            shutil.copytree(PHOTOGRAPHS, self.unbroken / "card" / plot / "2026-06-18")
        made = campaign_folder(self.folder / "made", field(1, 2))
        text = (made / "campaign.toml").read_text("utf-8").replace('fidelity = "standard"', 'fidelity = "draft"')
        (made / "campaign.toml").write_text(text, encoding="utf-8")
        shutil.copytree(made, self.unbroken / "season")
        shutil.copytree(made, self.before / "season")
        line = CommandLine(self.unbroken, self.folder / "warm")
        for name in self.jobs:
            job, begun = JOBS[name], time.monotonic()
            done = line.run(*job.words)
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
        process = line.start(*job.words)
        time.sleep(self.random.uniform(0.1, 0.9) * self.seconds[name])
        with_all: list[psutil.Process] = []
        if process.poll() is None:
            command = psutil.Process(process.pid)
            with_all = [command, *command.children(recursive=True)]
        for each in with_all:
            with suppress(psutil.NoSuchProcess):
                each.kill()
        process.communicate()
        self.count["kills" if with_all else "too late"] += 1
        result, expected = line.folder / job.result, self.unbroken / job.result
        if result.exists() and name not in ("plan", "campaign"):  # these grow by whole evaluations and visits
            self.check(name, same(result, expected), "half of a result stood as a whole one")
            shutil.rmtree(result) if result.is_dir() else result.unlink()
        resumed = job.again if job.again and (result / "search.json").exists() else job.words
        begun = time.monotonic()
        done = line.run(*resumed, *(("--overwrite",) if resumed is job.words and name == "plan" else ()))
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
                self.check(name, same(disk / job.result, self.unbroken / job.result), f"another result on {size}")
            elif name != "plan":
                self.check(name, not contents(disk), f"files stayed on a disk of {size}")
        finally:
            subprocess.run(["umount", "-l", str(disk)], check=True)
        shutil.rmtree(line.folder)

    def crash(self) -> None:
        """A worker of a plan ends by a segmentation fault: its call is repeated."""
        job, line = JOBS["plan"], self.line(JOBS["plan"], warm=True)
        process = line.start(*job.words)
        while process.poll() is None and not (found := children(process)):
            time.sleep(0.05)
        if process.poll() is None:
            time.sleep(self.random.uniform(0.0, 3.0))
            try:
                found[0].send_signal(signal.SIGSEGV)
                self.count["crashed workers"] += 1
            except psutil.NoSuchProcess:
                self.count["too late"] += 1
        done = finish(process)
        self.check("plan", done.code == 0, f"exit code {done.code} after a worker crashed: {done.err[-300:]}")
        self.check("plan", same(line.folder / "plan", self.unbroken / "plan"), "another plan after a worker crashed")
        shutil.rmtree(line.folder)

    def two_runs(self, name: str) -> None:
        """Two runs of one command in one folder: one is whole, the other is whole or refused."""
        job, line = JOBS[name], self.line(JOBS[name], warm=True)
        ended = [finish(each) for each in [line.start(*job.words), line.start(*job.words)]]
        codes = sorted(each.code for each in ended)
        self.count["pairs of runs"] += 1
        self.check(name, codes in ([0, 0], [0, 2], [0, 3]), f"two runs in one folder ended with {codes}")
        self.check(name, same(line.folder / job.result, self.unbroken / job.result), "another result of two runs")
        shutil.rmtree(line.folder)


def main() -> int:
    """Soak, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=JOBS, default=list(JOBS), help="with all that they need")
    given = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fieldkit-soak-") as folder:
        soak = Soak(Path(folder), given.seed, given.only)
        soak.prepare()
        for k in range(given.kills):
            soak.kill(given.only[k % len(given.only)], warm=k % 4 > 0)
        for k in range(max(1, given.kills // 20)):
            if "plan" in given.only:
                soak.crash()
            soak.two_runs(given.only[k % len(given.only)])
        for name in given.only:
            for size in DISKS if given.kills >= 100 else DISKS[1:2]:
                if name != "campaign":  # its folder is not made by the command
                    soak.full_disk(name, size)
    for what, number in sorted(soak.count.items()):
        print(f"{what}: {number}")
    print(f"wrong: {len(soak.wrong)}; {(time.monotonic() - begun) / 60:.0f} min")
    return 1 if soak.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
