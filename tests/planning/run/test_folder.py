"""A run's folder: what is logged comes back bit for bit, and what a killed run leaves can be gone on from."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.errors import MetadataError, UsageError
from fieldkit.planning.problem import Trial
from fieldkit.planning.run.folder import LOG_FILE, LogEntry, RunFolder, create_run, open_run, read_log
from fieldkit.planning.run.loop import Job
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.plan_file import SETTINGS_FILE
from tests.planning.bowl import Bowl, bowl_problem, bowl_settings

numbers = st.floats(-1e3, 1e3)
poses = st.tuples(numbers, numbers, numbers, st.floats(-180, 179.999), st.floats(-90, 90))


def log(run: RunFolder, number: int, cameras: Cameras | None = None) -> LogEntry:
    trial = Trial(number, cameras or bowl_problem().sample(number), "test", {"weights": {"rbf": 0.25}, "scale": 0.1})
    return run.log(trial, Job(trial.cameras, 0, "draft"), Bowl().evaluate(trial.cameras), "search", proposal_cpu_s=0.1)


@given(st.lists(poses, min_size=1, max_size=5))
def test_cameras_come_back_bit_for_bit(rows: list[tuple[float, ...]]) -> None:
    cameras = Cameras.from_vector(np.array(rows))
    with TemporaryDirectory() as folder, create_run(Path(folder) / "run", bowl_settings()) as run:
        entry = log(run, 3, cameras)
        assert read_log(run.path) == [entry]  # on the disk at once
    assert entry.trial.cameras == cameras


def test_a_run_is_there_before_it_starts_and_holds_what_was_added(tmp_path: Path) -> None:
    with create_run(tmp_path / "run", bowl_settings()) as run:
        assert (tmp_path / "run" / SETTINGS_FILE).is_file()
        entries = [log(run, number) for number in (0, 1)]
    file = tmp_path / "run" / LOG_FILE
    file.write_bytes(file.read_bytes() + entries[1].model_dump_json().encode()[:200])  # cut off in the middle
    assert read_log(tmp_path / "run") == entries
    with open_run(tmp_path / "run") as run:
        assert run.settings == bowl_settings()
        assert run.entries == entries
        log(run, 2)
    assert [entry.number for entry in read_log(tmp_path / "run")] == [0, 1, 2]


def test_damage_is_named_by_its_line(tmp_path: Path) -> None:
    with create_run(tmp_path / "run", bowl_settings()) as run:
        log(run, 0)
    file = tmp_path / "run" / LOG_FILE
    file.write_bytes(file.read_bytes() + b'{"number": 1}\n')
    with pytest.raises(MetadataError, match="line 2") as caught, open_run(tmp_path / "run"):
        pass
    assert caught.value.path == file
    (tmp_path / "run" / SETTINGS_FILE).write_text('{"kind": "search", "cameras": 1}')
    with pytest.raises(MetadataError), open_run(tmp_path / "run"):
        pass
    with pytest.raises(MetadataError, match="no such file"), open_run(tmp_path / "nowhere"):
        pass


def test_only_one_process_has_a_run(tmp_path: Path) -> None:
    with create_run(tmp_path / "run", bowl_settings()):
        with pytest.raises(UsageError, match="another process"), open_run(tmp_path / "run"):
            pass
        with pytest.raises(UsageError, match="another process"):
            with create_run(tmp_path / "run", bowl_settings(), overwrite=True):
                pass
    with create_run(tmp_path / "run", bowl_settings(), overwrite=True) as run:
        assert run.entries == []
    with pytest.raises(UsageError, match="exists"), create_run(tmp_path / "run", bowl_settings()):
        pass


def test_a_run_of_a_killed_process_can_be_opened(tmp_path: Path) -> None:
    script = f"""
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from fieldkit.planning.run.folder import create_run
from tests.planning.bowl import bowl_settings
with create_run(Path({str(tmp_path / "run")!r}), bowl_settings()):
    print("open", flush=True)
    time.sleep(60)
"""
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])}
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, env=environment) as other:
        assert other.stdout.readline() == b"open\n"
        with pytest.raises(UsageError, match="another process"), open_run(tmp_path / "run"):
            pass
        other.send_signal(signal.SIGKILL)
        other.wait()
    with open_run(tmp_path / "run") as run:
        assert run.entries == []
