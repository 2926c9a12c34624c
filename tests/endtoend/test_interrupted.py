"""Runs that are killed or interrupted, and go on with the same result."""

import random
import shutil
import signal
import time
from pathlib import Path

import pytest

from fieldkit.evaluation.reference import Reference
from tests.endtoend.commands import DRAFT, CommandLine, Finished, differing, finish, partial_folders, wait_until
from tests.endtoend.conftest import Built


def resumed(line: CommandLine, images: Path, built: Built) -> Finished:
    """The same command with --resume ends as the unbroken run did, and tidies up after the killed one."""
    done = line.run("reference", str(images), "-o", "out", *DRAFT, "--resume", "--json")
    assert differing(line.folder / "out", built.reference) == []
    assert partial_folders(line.folder) == []
    return done


def test_killed_in_dense_stereo(line: CommandLine, small_plot: Path, built: Built) -> None:
    process = line.start("reference", str(small_plot), "-o", "out", *DRAFT)
    assert wait_until(process, lambda: line.entries("depth") >= 5)
    process.kill()
    assert finish(process).code == -signal.SIGKILL
    assert not (line.folder / "out").exists()
    kept = {path: path.stat().st_mtime_ns for path in line.cache.glob("features/*/*.npz")}
    assert len(kept) == 16  # the photographs' own features, and the ground's
    done = resumed(line, small_plot, built)
    features = next(stage for stage in done.json["times"] if stage["name"] == "Features")
    assert features["cached"] == 8


def test_killed_while_writing_the_result(warm: CommandLine, small_plot: Path, built: Built) -> None:
    process = warm.start("reference", str(small_plot), "-o", "out", *DRAFT)
    assert wait_until(process, lambda: any(warm.folder.glob(".out.*.partial/cloud.ply")))
    process.kill()
    assert finish(process).code == -signal.SIGKILL
    assert not (warm.folder / "out").exists()
    assert len(partial_folders(warm.folder)) == 1
    resumed(warm, small_plot, built)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted(number: signal.Signals, line: CommandLine, small_plot: Path) -> None:
    process = line.start("reference", str(small_plot), "-o", "out", *DRAFT, "--json")
    assert wait_until(process, lambda: line.entries("features") >= 4)
    process.send_signal(number)
    done = finish(process)
    assert done.code == 128 + number
    assert not (line.folder / "out").exists()
    assert partial_folders(line.folder) == []
    assert list(line.cache.rglob("*.partial")) == []
    assert done.error["type"] == ("Interrupted" if number == signal.SIGINT else "Terminated")
    if number == signal.SIGINT:
        assert "--resume" in done.error["remedy"]
        assert "--resume" in done.err


def test_interrupted_in_the_scene_keeps_the_plants(line: CommandLine, small_plot: Path, built: Built) -> None:
    process = line.start("reference", str(small_plot), "-o", "out", *DRAFT)
    out = line.folder / "out"
    assert wait_until(process, out.exists)
    process.send_signal(signal.SIGTERM)
    done = finish(process)
    assert done.code == 143
    assert "the plants' reference is whole in" in done.err
    assert partial_folders(line.folder) == []
    assert Reference(out).report.scene_points is None
    assert (out / "cloud.ply").read_bytes() == (built.reference / "cloud.ply").read_bytes()
    without = line.run("scene", "from-reference", "out", "-o", "proxy", "--json", code=3)
    assert "of the plants alone" in without.error["message"]
    assert "--resume" in without.error["remedy"]
    again = line.run("reference", str(small_plot), "-o", "out", *DRAFT, "--json", code=2)
    assert again.error["type"] == "UsageError"
    other = line.run("reference", str(small_plot), "-o", "out", *DRAFT, "--seed", "1", "--resume", "--json", code=2)
    assert other.error["type"] == "UsageError"
    resumed(line, small_plot, built)


def test_an_interrupted_overwrite_keeps_the_old_result(warm: CommandLine, small_plot: Path, built: Built) -> None:
    shutil.copytree(built.reference, warm.folder / "out")
    process = warm.start("reference", str(small_plot), "-o", "out", *DRAFT, "--overwrite", "--seed", "5")
    assert wait_until(process, lambda: bool(partial_folders(warm.folder)))
    process.send_signal(signal.SIGINT)
    assert finish(process).code == 130
    assert differing(warm.folder / "out", built.reference) == []
    assert partial_folders(warm.folder) == []


@pytest.mark.slow
@pytest.mark.parametrize("draw", range(3))
def test_killed_at_a_random_moment(draw: int, line: CommandLine, small_plot: Path, built: Built) -> None:
    """The moment is drawn over the whole run, from the interpreter's start to the last file."""
    moment = random.Random(draw).uniform(0.0, built.report["seconds"] + 2.0)
    process = line.start("reference", str(small_plot), "-o", "out", *DRAFT)
    time.sleep(moment)
    process.kill()
    finish(process)
    # A run that was quicker than its predecessor has its result already, and a complete one.
    if (line.folder / "out").exists() and Reference(line.folder / "out").report.scene_points is not None:
        assert differing(line.folder / "out", built.reference) == []
    else:
        resumed(line, small_plot, built)
