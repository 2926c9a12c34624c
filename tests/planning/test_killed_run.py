"""A real run of 40 evaluations that is killed twenty times ends in the plan of the run nobody disturbed."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from fieldkit.planning.run.folder import LOG_FILE, LogEntry, read_log
from fieldkit.scenes.description import build
from fieldkit.scenes.renderer import Renderer, RenderingError
from fieldkit.scenes.scene_file import read_scene
from tests.cli.test_scene_commands import TINY

pytestmark = pytest.mark.slow
KILLS = 20


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "fieldkit", "plan", *arguments]


def planned(folder: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Everything that must be the same: the plan and the log, without times."""
    entries: list[LogEntry] = read_log(folder)
    times = {"cpu_s", "wall_s", "proposal_cpu_s", "finished_s"}
    listed = [entry.model_dump(exclude=times) for entry in entries]
    return json.loads((folder / "plan.json").read_text()), sorted(
        listed, key=lambda e: (e["stage"], e["number"], e["seed"])
    )


def logged(folder: Path) -> int:
    log = folder / LOG_FILE
    return log.read_bytes().count(b"\n") if log.is_file() else 0


def test_a_run_survives_twenty_kills(tmp_path: Path) -> None:
    scene = tmp_path / "tiny.toml"
    scene.write_text(
        TINY.replace("200", "480").replace("150", "360").replace("[170, 170, 100, 75]", "[408, 408, 240, 180]")
    )
    try:
        Renderer(build(read_scene(scene))).close()
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    settings = ["--scene", str(scene), "-n", "4", "--evaluations", "40", "--repeats", "1", "--workers", "2"]
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    subprocess.run(command(*settings, "-o", str(whole)), check=True, capture_output=True)

    rng = random.Random(4)
    lines: list[int] = []
    again = command(*settings, "-o", str(broken))
    while len(lines) < KILLS:
        before = logged(broken)
        process = subprocess.Popen(again, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        # One in four while it starts, the others up to three seconds after it has logged something.
        more = 0 if rng.random() < 0.25 else rng.randint(1, 3)
        while logged(broken) < before + more and process.poll() is None:
            time.sleep(0.02)
        time.sleep(rng.uniform(0.0, 3.0))
        if process.poll() is not None:
            assert process.returncode == 0
            break
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        lines.append(logged(broken))
        if (broken / LOG_FILE).is_file():
            again = command("--resume", "--workers", "2", "-o", str(broken))
    subprocess.run(again, check=True, capture_output=True)
    assert lines == sorted(lines)
    assert len(set(lines)) >= 10, f"killed after {lines} evaluations"
    assert planned(broken) == planned(whole)
